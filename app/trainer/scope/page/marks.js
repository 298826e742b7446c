// What an exercise asks for next, in front of all: a faint dot on each strand that is to be parted,
// which goes as its strand parts, and a ring where to, with a bar as jaws are to part.
(() => {
  const scope = window.bluntdissectScope;
  if (scope.mark) return;
  const CORNERS = [-1, -1, 1, -1, 1, 1, -1, 1], FRONT = 9;
  const SEEN = { transparent: true, depthTest: false, depthWrite: false };

  let wanted = [], ringed = null;

  const show = (strands, left = 600) => {
    const { picture } = scope;
    if (strands !== wanted) return;
    if (!picture) { if (left) setTimeout(() => show(strands, left - 1), 50); return; }
    picture.unmark?.();
    picture.unmark = null;
    if (!strands.length) return;
    const dots = square(picture);
    picture.make.each(dots, "strand", new Float32Array(strands), 1);
    picture.unmark = putInFront(picture, dots, picture.material(["ends", "mark.vert"], ["common", "mark.frag"], {}, SEEN));
    viewer.redraw();
  };
  const showRing = (ring, left = 600) => {
    const { picture } = scope;
    if (ring !== ringed) return;
    if (!picture) { if (left) setTimeout(() => showRing(ring, left - 1), 50); return; }
    picture.unring?.();
    picture.unring = null;
    viewer.redraw();
    if (!ring) return;
    const own = { uPlace: ring.slice(0, 3), uAlong: ring.slice(3) };
    picture.unring = putInFront(picture, square(picture), picture.material(["ring.vert"], ["common", "ring.frag"], own, SEEN));
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
  scope.mark = strands => { wanted = strands; show(strands); };
  // Put the ring to a place, mm, with its bar along a direction or none: six numbers; null for none.
  scope.ring = ring => { ringed = ring; showRing(ring); };
})();
