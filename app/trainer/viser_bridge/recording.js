// Keeps the light of a recording's page, which viser would replace whenever the recording starts over,
// and its camera so far away that a window of any shape shows the picture's whole width.
(function start() {
  const scene = window.__viserMutable?.scene;
  if (!scene) return requestAnimationFrame(start);
  const about = document.getElementById("about");
  if (!about) return requestAnimationFrame(start);
  const distance = Number(about.dataset.distance), widthByHeight = Number(about.dataset.aspect);
  let fog = null, shaped = 0;
  const fit = ({aspect}) => {
    const farther = aspect < 0.8 * widthByHeight ? widthByHeight / aspect : 1;
    const control = window.__viserMutable.cameraControl;
    // viser puts the camera back to its first place.
    if (control && (aspect !== shaped || (farther > 1 && Math.abs(control.distance / distance - 1) < 1e-4))) {
      shaped = aspect;
      control.maxDistance = Math.max(control.maxDistance, 2 * farther * distance);
      control.dollyTo(farther * distance, false);
    }
    if (!fog) return;
    fog.nearest ??= [fog.near, fog.far];
    [fog.near, fog.far] = fog.nearest.map(each => farther * each);
  };
  const before = scene.onBeforeRender;
  scene.onBeforeRender = (...given) => {
    before.apply(scene, given);
    scene.environment = null;
    scene.fog = fog = scene.fog ?? fog;
    fit(given[2]);
    scene.traverse((node) => { if (node.isDirectionalLight) node.visible = false; });
  };
})();
