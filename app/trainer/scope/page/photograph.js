// A photograph for the record: the round picture as it is drawn next, small enough for a message,
// goes to a widget of the server's; `viewer` is `run_picture`'s.
(() => {
  const scope = window.bluntdissectScope;
  if (scope.photograph) return;
  const SIDE = 480, QUALITY = 0.8;
  const LONGEST = 100_000;   // characters that the server takes of a page
  const SMALLER = 0.85;      // times as wide, where a picture is longer: of PNG, which all browsers have
  scope.photograph = uuid => {
    const scene = viewer.scene();
    if (!scene || !scope.picture) return;
    const before = scene.onAfterRender;
    scene.onAfterRender = (renderer, ...rest) => {
      scene.onAfterRender = before;
      before.call(scene, renderer, ...rest);
      const from = renderer.domElement, high = from.height * (1 - (scope.picture?.covered ?? 0));
      const side = Math.min(from.width, high), to = document.createElement("canvas");
      const taken = wide => {
        to.width = to.height = wide;
        to.getContext("2d").drawImage(from, (from.width - side) / 2, (high - side) / 2, side, side, 0, 0, wide, wide);
        const url = to.toDataURL("image/webp", QUALITY);
        return url.startsWith("data:image/webp") ? url : to.toDataURL("image/jpeg", QUALITY);
      };
      let wide = SIDE, url = taken(wide);
      while (url.length > LONGEST) url = taken(wide = Math.floor(SMALLER * wide));
      viewer.send(uuid, url);
    };
    viewer.redraw();
  };
})();
