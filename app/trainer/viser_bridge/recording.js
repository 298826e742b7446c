// Keeps the light of a recording's page, which viser would replace whenever the recording starts over.
(function start() {
  const scene = window.__viserMutable?.scene;
  if (!scene) return requestAnimationFrame(start);
  let fog = null;
  const before = scene.onBeforeRender;
  scene.onBeforeRender = (...given) => {
    before.apply(scene, given);
    scene.environment = null;
    scene.fog = fog = scene.fog ?? fog;
    scene.traverse((node) => { if (node.isDirectionalLight) node.visible = false; });
  };
})();
