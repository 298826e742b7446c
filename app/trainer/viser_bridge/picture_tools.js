// What a picture of its own needs of viser's page beyond `viewer`: kinds of three.js, the canvas, the
// camera's controls, and messages to widgets. Leans on window.__viserMutable of viser 1.1.1, and on
// three.js's numbers for formats and filters.
Object.assign(viewer, (() => {
  const page = () => window.__viserMutable;
  const RGBA = 1023, BYTE = 1009, FLOAT = 1015, NEAREST = 1003, LINEAR = 1006, NEAR_MIPMAPS = 1007, MIPMAPS = 1008, REPEAT = 1000, CLAMP = 1001;
  const NONE = 0;  // of the actions of camera-controls

  // Makers of three.js's objects, by the kinds of a mesh that viser has made and of its background;
  // undefined while there is none.
  const makers = source => {
    const backdrop = page()?.backgroundMaterial, picture = backdrop?.uniforms.colorMap.value;
    if (!source || !picture) return undefined;
    const Mesh = source.constructor, Geometry = source.geometry.constructor, Matrix = source.matrix.constructor;
    const Attribute = source.geometry.attributes.position.constructor, Shader = backdrop.constructor, Texture = picture.constructor;
    return {
      geometry(attributes, index) {
        const made = new Geometry();
        for (const [name, [array, size]] of Object.entries(attributes)) made.setAttribute(name, new Attribute(array, size));
        made.setIndex(new Attribute(index, 1));
        return made;
      },
      // An attribute that is each instance's.
      each(geometry, name, array, size) {
        const made = new Attribute(array, size);
        Object.assign(made, { isInstancedBufferAttribute: true, meshPerAttribute: 1 });
        geometry.setAttribute(name, made);
        Object.assign(geometry, { isInstancedBufferGeometry: true, instanceCount: array.length / size });
      },
      matrix: () => new Matrix(),
      material({ vertexShader, fragmentShader, uniforms, settings }) {
        const made = new Shader({ vertexShader, fragmentShader, uniforms: {}, ...settings });
        return Object.assign(made, { uniforms, toneMapped: false });
      },
      mesh(geometry, material) {
        const made = new Mesh(geometry, material);
        return Object.assign(made, { frustumCulled: false, raycast() {}, castShadow: false, receiveShadow: false });
      },
      texture(data, width, height, { whole = false, repeats = false, quick = false }) {
        return Object.assign(new Texture(), {
          isDataTexture: true, image: { data, width, height }, format: RGBA, type: whole ? FLOAT : BYTE,
          magFilter: whole ? NEAREST : LINEAR, minFilter: whole ? NEAREST : !repeats ? LINEAR : quick ? NEAR_MIPMAPS : MIPMAPS,
          generateMipmaps: repeats, flipY: false, unpackAlignment: 1, wrapS: repeats ? REPEAT : CLAMP,
          wrapT: repeats ? REPEAT : CLAMP, needsUpdate: true,
        });
      },
    };
  };

  // Let viser's controls do nothing with mouse and fingers, and hide its background, or undo it.
  let kept = null;
  const hold = held => {
    const controls = page()?.cameraControl, backdrop = page()?.backgroundMaterial;
    if (held && !controls) { setTimeout(() => { if (kept === "wanted") hold(true); }, 50); kept = "wanted"; return; }
    if (held && (!kept || kept === "wanted")) {
      kept = { mouse: { ...controls.mouseButtons }, touches: { ...controls.touches } };
      Object.assign(controls.mouseButtons, { left: NONE, middle: NONE, right: NONE, wheel: NONE });
      Object.assign(controls.touches, { one: NONE, two: NONE, three: NONE });
    } else if (!held && kept) {
      if (kept !== "wanted" && controls) {
        Object.assign(controls.mouseButtons, kept.mouse);
        Object.assign(controls.touches, kept.touches);
      }
      kept = null;
    }
    page()?.scene?.traverse(mesh => { if (mesh.isMesh && mesh.material === backdrop) mesh.visible = !held; });
  };
  // The page's layout is asked for again only when the canvas or the panel changes its size.
  let hiddenFraction = null;
  const sizes = new ResizeObserver(() => {
    const before = hiddenFraction;
    hiddenFraction = null;
    if (before !== null && page()?.canvas?.isConnected) requestAnimationFrame(() => page()?.requestRender?.());
  });
  return {
    makers, hold,
    canvas: () => page()?.canvas,
    // What a phone's panel covers of the canvas's height from below, as a fraction of it.
    covered() {
      if (hiddenFraction !== null) return hiddenFraction;
      const { canvas } = page(), box = canvas.getBoundingClientRect();
      const panel = document.querySelector(".mantine-Paper-root:has([data-testid=readout])"), its = panel?.getBoundingClientRect();
      const now = its && its.left < box.left + 0.1 * box.width && its.width > 0.9 * box.width ? Math.min(Math.max((box.bottom - its.top) / box.height, 0), 0.8) : 0;
      if (!panel || !canvas.clientHeight) return now;
      sizes.disconnect();
      for (const each of [canvas, panel]) sizes.observe(each);
      return (hiddenFraction = now);
    },
    send: (uuid, value) => page()?.sendMessage({ type: "GuiUpdateMessage", uuid, updates: { value } }),
  };
})());
