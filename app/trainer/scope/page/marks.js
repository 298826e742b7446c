// What an exercise asks for next, in front of all: a faint dot on each strand that is to be parted,
// which goes as its strand parts, and a ring where to, with a bar as jaws are to part. A dashed line
// leads there along the shaft, from where the pointer comes to it.
(() => {
  const scope = window.bluntdissectScope;
  if (scope.mark) return;
  const CORNERS = [-1, -1, 1, -1, 1, 1, -1, 1], FRONT = 9;
  const SEEN = { transparent: true, depthTest: false, depthWrite: false };

  const wanted = {};

  // Draw something in front, by its name, once there is a picture; null takes it away.
  const show = (name, given, draw, left = 600) => {
    const { picture } = scope;
    if (given !== wanted[name]) return;
    if (!picture) { if (left) setTimeout(() => show(name, given, draw, left - 1), 50); return; }
    const shown = picture.marks ??= {};
    shown[name]?.();
    shown[name] = given && draw(picture, given);
    viewer.redraw();
  };
  const drawDots = (picture, strands) => {
    const dots = square(picture);
    picture.make.each(dots, "strand", new Float32Array(strands), 1);
    return putInFront(picture, dots, picture.material(["ends", "mark.vert"], ["common", "mark.frag"], {}, SEEN));
  };
  const drawRing = (picture, ring) => {
    const back = ring.slice(6, 9), own = { uPlace: ring.slice(0, 3), uAlong: ring.slice(3, 6), uBack: back, uHand: ring[9] };
    const put = (vertex, fragment) => putInFront(picture, square(picture), picture.material(vertex, ["common", fragment], own, SEEN));
    const shown = [put(["ring.vert"], "ring.frag")];
    if (back.some(Boolean)) shown.push(put(["path", "line.vert"], "line.frag"));
    return () => { for (const remove of shown) remove(); };
  };
  const square = ({ make }) =>
    make.geometry({ position: [new Float32Array(12), 3], place: [new Float32Array(CORNERS), 2] }, new Uint32Array([0, 1, 2, 0, 2, 3]));
  const putInFront = (picture, geometry, material) => {
    const mesh = picture.put(geometry, material, FRONT);
    return () => {
      picture.group.remove(mesh);
      geometry.dispose();
      material.dispose();
      picture.meshes.splice(picture.meshes.indexOf(mesh), 1);
    };
  };

  // Mark strands, by their numbers, instead of those that are marked.
  scope.mark = strands => show("dots", wanted.dots = strands.length ? strands : null, drawDots);
  // Put the ring to a place, mm, with its bar along a direction or none, and its line along a shaft
  // or none, of a hand: ten numbers; null for no ring.
  scope.ring = ring => show("ring", wanted.ring = ring, drawRing);
})();
