// A photograph for the record: the round picture as it is drawn next, small enough for a message,
// goes to a widget of the server's; `viewer` is `run_picture`'s.
(() => {
  const scope = window.bluntdissectScope;
  if (scope.photograph) return;
  const SIDE = 480, QUALITY = 0.8;
  scope.photograph = uuid => {
    const scene = viewer.scene();
    if (!scene || !scope.picture) return;
    const before = scene.onAfterRender;
    scene.onAfterRender = (renderer, ...rest) => {
      scene.onAfterRender = before;
      before.call(scene, renderer, ...rest);
      const from = renderer.domElement, high = from.height * (1 - (scope.picture?.covered ?? 0));
      const side = Math.min(from.width, high), to = document.createElement("canvas");
      to.width = to.height = SIDE;
      to.getContext("2d").drawImage(from, (from.width - side) / 2, (high - side) / 2, side, side, 0, 0, SIDE, SIDE);
      viewer.send(uuid, to.toDataURL("image/webp", QUALITY));
    };
    viewer.redraw();
  };
})();
