// Dots on strands, in front of all but faint: what is to be parted next. A dot goes as its strand parts.
(() => {
  const scope = window.bluntdissectScope;
  if (scope.mark) return;
  const CORNERS = [-1, -1, 1, -1, 1, 1, -1, 1], FRONT = 9;

  let wanted = [];

  const show = (strands, left = 600) => {
    const { picture } = scope;
    if (strands !== wanted) return;
    if (!picture) { if (left) setTimeout(() => show(strands, left - 1), 50); return; }
    picture.unmark?.();
    picture.unmark = null;
    if (!strands.length) return;
    const { make } = picture, place = new Float32Array(CORNERS);
    const dots = make.geometry({ position: [new Float32Array(12), 3], place: [place, 2] }, new Uint32Array([0, 1, 2, 0, 2, 3]));
    make.each(dots, "strand", new Float32Array(strands), 1);
    const settings = { transparent: true, depthTest: false, depthWrite: false };
    const mesh = picture.put(dots, picture.material(["ends", "mark.vert"], ["common", "mark.frag"], {}, settings), FRONT);
    picture.unmark = () => {
      picture.group.remove(mesh);
      dots.dispose();
      mesh.material.dispose();
      picture.meshes.splice(picture.meshes.indexOf(mesh), 1);
    };
    viewer.redraw();
  };

  // Mark strands, by their numbers, instead of those that are marked.
  scope.mark = strands => { wanted = strands; show(strands); };
})();
