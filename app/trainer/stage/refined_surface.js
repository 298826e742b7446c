// Draws a moving surface with a finish of its own: fine, smooth, textured and wet.
//
// The server streams the few vertices of a coarse grid as one of viser's simple meshes. Here, in the
// page, a finer grid is laid through them by cubic interpolation, with the normals of that smooth
// surface, and drawn in the material of a GLB file that was sent once. The simple mesh is hidden;
// where this script cannot work it stays what is seen. `viewer` is `viser_bridge.run_in_page`'s.
//
// Behind the places come as many shades, or stresses where the last number of all is 1. Stresses are
// shown in colours of their own, light of no lamp, by the same shader: another would have to be
// compiled while somebody waits.
(() => {
  if (window.bluntdissectSurfaces) return;
  const wears = new Map();
  const numbers = text => {
    const bytes = Uint8Array.from(atob(text), letter => letter.charCodeAt(0));
    return new Float32Array(bytes.buffer);
  };
  const meshIn = node => {
    let found = null;
    node.traverse(child => { if (!found && child.isMesh && !child.userData.dressed) found = child; });
    return found;
  };

  // Where the hook's wire keeps the light out. p is in the hook's frame: the wire is bent around x.
  const HOOK_SHADE = `
    uniform vec4 hook;  // bend, wire, where its tip is, and whether there is one
    uniform vec3 lampDirection;
    float apartFromWire(vec3 p) {
      float turn = atan(-p.z, -p.y);
      turn = turn < -1.5708 ? turn + 6.2832 : turn;
      float beyond = max(max(hook.z - turn, turn - 3.6), 0.0) * hook.x;
      return length(vec3(length(p.yz) - hook.x, p.x, beyond)) - hook.y;
    }
    float hookShade(vec3 p) {
      if (hook.w < 0.5 || abs(p.x) > 8.0 * hook.y) return 1.0;
      float touching = smoothstep(0.0, 1.5 * hook.y, apartFromWire(p) + 0.25 * hook.y);
      // Towards the lamp, at the height where the wire would be.
      float thrown = smoothstep(-0.3 * hook.y, 0.7 * hook.y,
        apartFromWire(p + lampDirection * 1.6 * hook.y));
      return mix(0.3, 1.0, touching) * mix(0.5, 1.0, thrown);
    }`;
  const shared = {
    hookInverse: { value: null }, hook: { value: [1, 1, 0, 0] }, lampDirection: { value: [0, 0, 1] },
    bedInverse: { value: null }, lamp: { value: [0, 0, 1e3] }, reach: { value: [0, 1, 1] },
    axis: { value: new Float32Array(4 * 32) }, shaft: { value: [0, 0, 1] },
    hookAt: { value: [0, 0, -1e3] }, stressed: { value: 0 },
  };

  // A torn end: soaked with blood behind its rim, and frayed into fibres at it.
  const finished = (material, wear, matrix) => {
    if (material.userData.finished) return material;
    material.userData.finished = true;
    shared.hookInverse.value ??= matrix.clone().identity();
    material.vertexColors = true;
    material.side = 2;
    const bleeds = wear.blood !== null;
    const blood = { value: wear.blood ?? [0, 0, 0] };
    const raw = { value: wear.raw };
    material.onBeforeCompile = shader => {
      Object.assign(shader.uniforms, shared, { blood, raw });
      shader.vertexShader = shader.vertexShader
        .replace("#include <common>", `#include <common>
          attribute float behind; varying float vBehind; varying vec2 vPlace;
          varying vec3 vFromHook; uniform mat4 hookInverse;`)
        .replace("#include <begin_vertex>", `#include <begin_vertex>
          vBehind = behind; vPlace = uv;
          vFromHook = (hookInverse * modelMatrix * vec4(position, 1.0)).xyz;`);
      shader.fragmentShader = shader.fragmentShader
        .replace("#include <common>", `#include <common>
          varying float vBehind; varying vec2 vPlace; varying vec3 vFromHook;
          uniform vec3 blood, raw;
          uniform float stressed;
          float soaked = 0.0, shaded = 1.0;
          ${HOOK_SHADE}
          float dice(vec2 p) { return fract(sin(dot(p, vec2(127.1, 311.7))) * 43758.5453); }
          float noise(vec2 p, float around) {
            vec2 i = floor(p), f = fract(p); f = f * f * (3.0 - 2.0 * f);
            float a = mod(i.y, around), b = mod(i.y + 1.0, around);
            return mix(mix(dice(vec2(i.x, a)), dice(vec2(i.x + 1.0, a)), f.x),
                       mix(dice(vec2(i.x, b)), dice(vec2(i.x + 1.0, b)), f.x), f.y);
          }`)
        .replace("#include <color_fragment>", `
          if (stressed > 0.5) {
            if (vBehind < 0.0) discard;  // fibres
            gl_FragColor = vec4(vColor.rgb, 1.0);
            #include <tonemapping_fragment>
            #include <colorspace_fragment>
            #include <fog_fragment>
            return;
          }
          #include <color_fragment>
          shaded = hookShade(vFromHook);
          diffuseColor.rgb *= shaded;
          if (vBehind < 8.0) {
            vec2 p = vec2(vPlace.x * 12.0, vPlace.y);
            if (vBehind < 0.0) {
              // Fibres of many lengths, each ever thinner and with a wave of its own.
              float across = p.y * 210.0 + 0.8 * sin(-vBehind * 14.0 + 40.0 * noise(p * 9.0, 9.0));
              float own = dice(vec2(mod(floor(across), 210.0), 7.0));
              float tuft = noise(vec2(1.0, p.y * 17.0), 17.0);
              float reach = 0.03 + 0.42 * own * own * own * (0.35 + tuft) + 0.09 * tuft;
              float left = 1.0 + vBehind / reach;
              if (left < 0.0 || abs(fract(across) - 0.5) > 0.5 * sqrt(left)) discard;
            }
            float ragged = noise(vec2(p.x * 3.0, p.y * 9.0), 9.0)
              + 0.5 * noise(vec2(p.x * 9.0, p.y * 31.0), 31.0) - 0.75;
            float bruised = smoothstep(2.2, 0.2, vBehind + 0.9 * ragged);
            soaked = smoothstep(0.75, 0.0, abs(vBehind) + 0.5 * ragged);
            diffuseColor.rgb = mix(diffuseColor.rgb, raw, 0.4 * bruised
              + 0.3 * smoothstep(0.25, 0.0, vBehind));
            ${bleeds ? "diffuseColor.rgb = mix(diffuseColor.rgb, blood, 0.8 * soaked);" : ""}
          }`)
        .replace("#include <lights_physical_fragment>", `#include <lights_physical_fragment>
          #ifdef USE_CLEARCOAT
            // No gloss where an instrument keeps the light out.
            material.clearcoat *= shaded * smoothstep(0.25, 0.9, vColor.g);
          #endif`);
    };
    material.customProgramCacheKey = () => `bluntdissect${bleeds}`;
    material.needsUpdate = true;
    return material;
  };

  // The bed, with the shadow of what lies above it: the duct's axis, as wide as the duct, and the
  // hook's shaft, thrown from the lamp to the height of each place of the bed.
  const shadowed = material => {
    if (material.userData.shadowed) return;
    material.userData.shadowed = true;
    material.onBeforeCompile = shader => {
      Object.assign(shader.uniforms, shared);
      shader.vertexShader = shader.vertexShader
        .replace("#include <common>", `#include <common>
          varying vec3 vOnBed; uniform mat4 bedInverse;`)
        .replace("#include <begin_vertex>", `#include <begin_vertex>
          vOnBed = (bedInverse * modelMatrix * vec4(position, 1.0)).xyz;`);
      shader.fragmentShader = shader.fragmentShader
        .replace("#include <common>", `#include <common>
          varying vec3 vOnBed;
          uniform vec4 axis[32]; uniform vec3 lamp, reach, shaft, hookAt;
          float lit = 1.0;
          float edge(float apart, float wide, float high) {
            float soft = 0.3 * wide + 0.10 * high;
            return smoothstep(wide + soft, wide - soft, apart);
          }
          float ductShadow(vec3 p) {
            float at = p.x, dark = 0.0;
            for (int turn = 0; turn < 3; turn++) {
              float place = clamp((at - reach.x) / reach.y, 0.0, 30.999);
              int i = int(place);
              vec4 here = mix(axis[i], axis[i + 1], place - float(i));
              float fraction = (p.z - lamp.z) / (here.z - lamp.z);
              vec2 thrown = lamp.xy + (here.xy - lamp.xy) * fraction;
              at += p.x - thrown.x;
              dark = here.w * edge(distance(p.xy, thrown), reach.z * fraction, here.z - p.z);
            }
            return dark;
          }
          float shaftShadow(vec3 p) {
            vec3 distant = hookAt + 90.0 * shaft;
            float a = (p.z - lamp.z) / (hookAt.z - lamp.z);
            float b = (p.z - lamp.z) / min(distant.z - lamp.z, -4.0);
            vec2 from = lamp.xy + (hookAt.xy - lamp.xy) * a;
            vec2 toward = lamp.xy + (distant.xy - lamp.xy) * b - from;
            float along = clamp(dot(p.xy - from, toward) / dot(toward, toward), 0.0, 1.0);
            return 0.8 * edge(distance(p.xy, from + along * toward), 2.2 * a, hookAt.z - p.z + 6.0);
          }`)
        .replace("#include <color_fragment>", `#include <color_fragment>
          lit = 1.0 - 0.68 * max(ductShadow(vOnBed), shaftShadow(vOnBed));
          diffuseColor.rgb *= lit;`)
        .replace("#include <lights_physical_fragment>", `#include <lights_physical_fragment>
          #ifdef USE_CLEARCOAT
            material.clearcoat *= lit * lit;
          #endif
          material.specularColor *= lit;`);
    };
    material.customProgramCacheKey = () => "bluntdissect bed";
    material.needsUpdate = true;
  };

  // Takes the stress that stands for a colour for the colour of that stress: the table's where the
  // surface faces the viewer, and darker where it turns away.
  const colorStress = ({ table, unknown, darkest, towards }, color, normal, at) => {
    const used = color[at], last = table.length / 3 - 1;
    if (used < 0) {
      for (let k = 0; k < 3; k++) color[at + k] = unknown[k];
      return;
    }
    const place = Math.min(used, 1) * last, below = Math.min(Math.floor(place), last - 1);
    const fraction = place - below;
    let facing = 0;
    for (let k = 0; k < 3; k++) facing += normal[at + k] * towards[k];
    const turn = Math.min((1 - Math.max(facing, 0)) / 0.75, 1);
    const light = 1 - (1 - darkest) * turn * turn;
    for (let k = 0; k < 3; k++) {
      const from = table[3 * below + k];
      color[at + k] = light * (from + fraction * (table[3 * below + 3 + k] - from));
    }
  };

  class Dressed {
    constructor(source, finish, wear) {
      this.source = source;
      this.worn = source.geometry;
      this.wear = wear;
      const Attribute = source.geometry.attributes.position.constructor;
      const sides = wear.sides, columns = 2 * sides + 1;
      this.columns = columns;
      this.grids = [];
      let count = 0, triangles = 0;
      for (const patch of wear.patches) {
        const rows = 2 * patch.rows.length - 1;
        this.grids.push({ ...patch, rows, coarse: patch.rows, start: count });
        count += rows * columns;
        triangles += (rows - 1) * (columns - 1) * 2;
      }
      this.work = new Float32Array(4 * columns * Math.max(...wear.patches.map(p => p.rows.length)));
      const uv = new Float32Array(2 * count), behind = new Float32Array(count);
      const index = new Uint32Array(3 * triangles);
      let at = 0;
      for (const grid of this.grids) {
        const { rows, coarse, start, outwards } = grid;
        for (let r = 0; r < rows; r++) for (let c = 0; c < columns; c++) {
          const a = coarse[r >> 1], b = coarse[(r + 1) >> 1];
          const i = (c >> 1) % sides, j = ((c + 1) >> 1) % sides;
          const mean = values => 0.25 * (values[a + i] + values[a + j] + values[b + i] + values[b + j]);
          const v = start + r * columns + c;
          uv[2 * v] = mean(wear.along);
          uv[2 * v + 1] = (0.5 * c + 0.5) / sides;
          behind[v] = mean(wear.behind);
          if (r + 1 < rows && c + 1 < columns) {
            const p = v, q = v + 1, s = v + columns, t = s + 1;
            index.set(outwards ? [p, q, t, p, t, s] : [p, t, q, p, s, t], at);
            at += 6;
          }
        }
      }
      const geometry = this.geometry = new source.geometry.constructor();
      const set = (name, array, size) => geometry.setAttribute(name, new Attribute(array, size));
      this.position = new Float32Array(3 * count);
      this.normal = new Float32Array(3 * count);
      this.color = new Float32Array(3 * count);
      set("position", this.position, 3);
      set("normal", this.normal, 3);
      set("color", this.color, 3);
      set("uv", uv, 2);
      set("behind", behind, 1);
      geometry.setIndex(new Attribute(index, 1));
      const mesh = this.mesh = new source.constructor(geometry,
        finished(finish ? finish.material : source.material.clone(), wear, source.matrixWorld));
      mesh.userData.dressed = true;
      mesh.frustumCulled = false;
      mesh.raycast = () => {};
      source.parent.add(mesh);
      source.visible = false;
      // viser calls this for every set of vertices that comes, and disposes of what it removes.
      source.geometry.computeVertexNormals = () => this.update();
      source.geometry.addEventListener("dispose", () => geometry.dispose());
      this.update();
    }

    update() {
      const { columns, wear, work, position, normal, color } = this;
      const sides = wear.sides;
      this.given = this.source.geometry.attributes.position.array;
      const given = this.given;
      const shades = given.subarray(3 * wear.count);
      const stress = given[given.length - 1] === 1 ? wear.stress : null;
      shared.stressed.value = stress ? 1 : 0;
      for (const grid of this.grids) {
        const { rows, coarse, start, outwards, smooth, tint } = grid;
        const inside = grid !== this.grids[0];
        // Around each ring: its points, and between each two of them a point of the cubic.
        for (let r = 0; r < coarse.length; r++) {
          const ring = coarse[r];
          for (let c = 0; c < columns; c++) {
            const i = c >> 1, to = 4 * (r * columns + c);
            const b = ring + i % sides;
            if (c & 1) {
              const a = ring + (i + sides - 1) % sides;
              const e = ring + (i + 1) % sides, d = ring + (i + 2) % sides;
              for (let k = 0; k < 3; k++)
                work[to + k] = (9 * (given[3 * b + k] + given[3 * e + k])
                  - given[3 * a + k] - given[3 * d + k]) / 16;
              work[to + 3] = 0.5 * (shades[b] + shades[e]);
            } else {
              for (let k = 0; k < 3; k++) work[to + k] = given[3 * b + k];
              work[to + 3] = shades[b];
            }
          }
        }
        // Along the surface, likewise.
        const last = coarse.length - 1;
        for (let r = 0; r < rows; r++) {
          const i = r >> 1;
          for (let c = 0; c < columns; c++) {
            const to = 3 * (start + r * columns + c);
            const b = 4 * (i * columns + c);
            let shade = work[b + 3];
            if (r & 1) {
              const e = b + 4 * columns;
              const a = i > 0 && smooth ? b - 4 * columns : -1;
              const d = i + 1 < last && smooth ? e + 4 * columns : -1;
              for (let k = 0; k < 3; k++) {
                const before = a < 0 ? 2 * work[b + k] - work[e + k] : work[a + k];
                const after = d < 0 ? 2 * work[e + k] - work[b + k] : work[d + k];
                position[to + k] = (9 * (work[b + k] + work[e + k]) - before - after) / 16;
              }
              shade = 0.5 * (shade + work[e + 3]);
            } else for (let k = 0; k < 3; k++) position[to + k] = work[b + k];
            if (stress) color[to] = inside ? -1 : shade;
            else {
              const tone = shade < 0 ? wear.torn : tint;
              for (let k = 0; k < 3; k++) color[to + k] = Math.abs(shade) * tone[k];
            }
          }
        }
        const sign = outwards ? 1 : -1;
        for (let r = 0; r < rows; r++) {
          const below = r > 0 ? -columns : 0, above = r + 1 < rows ? columns : 0;
          for (let c = 0; c < columns; c++) {
            const v = start + r * columns + c;
            const left = 3 * (v + (c > 0 ? -1 : columns - 2));
            const right = 3 * (v + (c + 1 < columns ? 1 : 2 - columns));
            const under = 3 * (v + below), over = 3 * (v + above);
            const ax = position[right] - position[left];
            const ay = position[right + 1] - position[left + 1];
            const az = position[right + 2] - position[left + 2];
            const bx = position[over] - position[under];
            const by = position[over + 1] - position[under + 1];
            const bz = position[over + 2] - position[under + 2];
            const x = ay * bz - az * by, y = az * bx - ax * bz, z = ax * by - ay * bx;
            const scale = sign / Math.max(Math.hypot(x, y, z), 1e-12);
            normal[3 * v] = x * scale;
            normal[3 * v + 1] = y * scale;
            normal[3 * v + 2] = z * scale;
            if (stress) colorStress(stress, color, normal, 3 * v);
          }
        }
      }
      for (const name of ["position", "normal", "color"])
        this.geometry.attributes[name].needsUpdate = true;
    }
  }

  const surfaces = new Map();
  const dressAll = () => {
    for (const [name, wear] of wears) {
      const node = viewer.node(name), finish = wear.finish && viewer.node(wear.finish);
      const source = node && meshIn(node), cloth = finish && meshIn(finish);
      if (!source || (wear.finish && !cloth?.material.map)) continue;
      // A surface that replaces another of its name may not be the node's yet.
      const worn = source.geometry, size = worn.attributes.position.array.length;
      if (size !== 3 * (wear.count + Math.ceil((wear.count + 1) / 3))) continue;
      const before = surfaces.get(name);
      if (before && before.source === source && before.worn === worn && before.wear === wear)
        continue;
      if (before) before.mesh.removeFromParent();
      const dressed = new Dressed(source, cloth, wear);
      surfaces.set(name, dressed);
      dressed.mesh.updateMatrixWorld(true);
    }
  };
  // Writes the middles of all rings into the table that the bed's shadow is thrown from.
  const light = () => {
    const worn = [...surfaces].filter(([, { wear }]) => wear.finish);
    if (!worn.length) return;
    const bed = viewer.node("/stage/tissue_bed"), hook = viewer.node("/stage/hook");
    if (!bed || !hook) return;
    const cloth = meshIn(bed);
    if (!cloth) return;
    bed.updateMatrixWorld(); hook.updateMatrixWorld();
    const toBed = shared.bedInverse.value = bed.matrixWorld.clone().invert();
    shared.hookInverse.value = hook.matrixWorld.clone().invert();
    shadowed(cloth.material);
    const place = hook.position.clone();
    const inBed = (x, y, z, matrix) => place.set(x, y, z).applyMatrix4(matrix).applyMatrix4(toBed);
    inBed(0, 0, 0, hook.matrixWorld);
    shared.hookAt.value = [place.x, place.y, place.z];
    const points = [];
    for (const [name, { given, wear, mesh }] of worn) {
      if (!viewer.node(name) || !mesh.parent) continue;
      mesh.updateMatrixWorld();
      for (const ring of wear.patches[0].rows) {
        let x = 0, y = 0, z = 0;
        for (let i = 0; i < wear.sides; i++) {
          x += given[3 * (ring + i)]; y += given[3 * (ring + i) + 1]; z += given[3 * (ring + i) + 2];
        }
        inBed(x / wear.sides, y / wear.sides, z / wear.sides, mesh.matrixWorld);
        points.push([place.x, place.y, place.z, name]);
      }
    }
    if (points.length < 2) return;
    points.sort((a, b) => a[0] - b[0]);
    const first = points[0][0], step = (points[points.length - 1][0] - first) / 31;
    shared.reach.value = [first, step, shared.reach.value[2]];
    for (let n = 0, k = 0; n < 32; n++) {
      const x = first + n * step;
      while (k + 2 < points.length && points[k + 1][0] < x) k++;
      const a = points[k], b = points[k + 1];
      const fraction = Math.min(Math.max((x - a[0]) / Math.max(b[0] - a[0], 1e-6), 0), 1);
      const mixed = i => a[i] + fraction * (b[i] - a[i]);
      shared.axis.value.set([mixed(0), mixed(1), mixed(2), a[3] === b[3] ? 1 : 0], 4 * n);
    }
  };
  const watch = () => {
    const scene = viewer.scene();
    if (!scene) { setTimeout(watch, 50); return; }
    const before = scene.onBeforeRender;
    scene.onBeforeRender = (...given) => { before.apply(scene, given); dressAll(); light(); };
  };
  window.bluntdissectSurfaces = {
    surfaces,
    dress(name, wear) {
      wears.set(name, {
        ...wear, along: numbers(wear.along), behind: numbers(wear.behind),
        stress: { ...wear.stress, table: numbers(wear.stress.table) },
      });
    },
    stage({ lamp, radius, bend, wire, tip, shaft, lampDirection }) {
      shared.lamp.value = lamp;
      shared.reach.value[2] = radius;
      shared.hook.value = [bend, wire, tip, 1];
      shared.shaft.value = shaft;
      shared.lampDirection.value = lampDirection;
    },
    undress(name) {
      const dressed = surfaces.get(name);
      if (dressed) {
        dressed.mesh.removeFromParent();
        dressed.source.visible = true;  // viser takes it for the next surface of this name
      }
      wears.delete(name); surfaces.delete(name);
    },
  };
  watch();
})();
