// The picture through the scope. All is drawn in the page from the frames of packing.py: this sets
// viser's camera to the scope's, or leaves it free, and draws with shaders of its own in viser's scene.
// `viewer` is `viser_bridge.run_in_page`'s.
(() => {
  const scope = window.bluntdissectScope;
  if (scope.show) return;
  const { add, sub, unit, cross, numbers, clamp, dice } = scope.algebra;
  const PICTURE = 256;                         // dots of the noise
  const MOVED = 0.12, DRAPED_MS = 90;          // mm that a node moves before the sheet is laid anew
  const NEAR = 1, FAR = 800, FIELD = Math.PI / 3;
  const BEAT_HZ = 1.2, SWELLS = 0.035;         // of an artery: heart's rate, and part of its radius
  const COARSE = 0.5;                          // dots a pixel of the plain look
  const SHADED = 12;                           // mm over what lies under the liver that it is darker
  const BEYOND = 60;                           // cells
  const AROUND = 15, DOWN = 10;                // places round a lump of fat, and from its top down
  const ROUND = 1.10;                          // of half the picture's shorter side
  // Round the picture it is black, and darker towards its edge.
  const EDGE = "position: absolute; inset: 0; pointer-events: none; z-index: 1; background: radial-gradient(circle closest-side, "
    + "transparent 62%, rgba(0, 0, 0, 0.15) 92%, rgba(4, 1, 1, 0.5) 107%, #000 110.4%)";

  class Picture {
    constructor(source, given, shaders) {
      Object.assign(this, { source, given, shaders, group: source.parent, meshes: [], version: -1, gain: 1, drawn: 0, pivotError: 0 });
      source.visible = false;
      source.raycast = () => {};
      const make = viewer.makers(source);
      this.make = make;
      this.state = new scope.State(given, (data, w, h) => make.texture(data, w, h, { whole: true }));
      this.sheet = new scope.Sheet(given.floor);
      const { sheet, state } = this, noise = scope.noise ??= scope.noisePicture(PICTURE);
      const slopes = scope.slopes ??= scope.slopesOf(noise, PICTURE);
      this.field = make.texture(sheet.bytes, sheet.columns, sheet.rows, {});
      this.rods = [new Float32Array(32), new Float32Array(32)];
      this.wells = new Float32Array(16);
      this.dents = new Float32Array(8);
      this.tips = new Float32Array(6);
      const wide = sheet.columns * sheet.cell, high = sheet.rows * sheet.cell;
      this.shared = {
        uEye: [0, 0, 0], uLamp: [0, 0, 0], uAxis: [0, 0, -1], uGain: 1, uRound: [0, 0, 1],
        uNoise: make.texture(noise, PICTURE, PICTURE, { repeats: true, quick: given.plain }), uSlopes: make.texture(slopes, PICTURE, PICTURE, { repeats: true, quick: given.plain }),
        uField: this.field, uBox: [sheet.x0 - sheet.cell / 2, sheet.y0 - sheet.cell / 2, wide, high],
        uRods: 0, uRodFrom: this.rods[0], uRodTo: this.rods[1], uWell: this.wells, uDent: this.dents, uTips: this.tips,
        uNodes: state.nodeTexture, uEnds: state.endTexture,
      };
      for (const [name, value] of Object.entries(this.shared)) this.shared[name] = { value };
      this.#makeGround();
      this.#makeTubes();
      if (!given.plain) { this.#makeWebs(); this.#makeLumps(); }
      this.#makeInstruments();
      this.frame = document.createElement("div");
      this.frame.className = "bd-scope-frame";
      this.frame.style.cssText = EDGE;
      this.lens = document.createElement("div");
      this.lens.className = "bd-scope-lens";
      this.lens.style.cssText = `position: absolute; inset: 0; pointer-events: none; z-index: 1; background: ${scope.stains()}`;
      viewer.canvas().parentElement.append(this.lens, this.frame);
    }

    // A material of two shaders; `own` are its uniforms besides those that all share.
    material(vertex, fragment, own = {}, settings = {}) {
      const { shaders, given } = this, plain = given.plain ? "#define PLAIN\n" : "";
      const parts = names => names.map(name => shaders[name]).join("\n");
      const uniforms = { ...this.shared };
      for (const [name, value] of Object.entries(own)) uniforms[name] = { value };
      return this.make.material({ vertexShader: plain + parts(vertex), fragmentShader: plain + parts(fragment), uniforms, settings });
    }

    put(geometry, material, order = 0) {
      const mesh = this.make.mesh(geometry, material);
      mesh.renderOrder = order;
      this.group.add(mesh);
      mesh.updateMatrixWorld(true);  // it may be put while a picture is drawn, and is part of it
      this.meshes.push(mesh);
      return mesh;
    }

    #makeGround() {
      const { sheet, make } = this, { columns, rows } = sheet;
      const field = () => {
        const position = new Float32Array(3 * sheet.size), normal = new Float32Array(3 * sheet.size);
        for (let k = 0; k < sheet.size; k++) {
          position[3 * k] = sheet.x0 + spread(k % columns, columns) * sheet.cell;
          position[3 * k + 1] = sheet.y0 + spread(Math.floor(k / columns), rows) * sheet.cell;
        }
        const geometry = make.geometry({ position: [position, 3], normal: [normal, 3], cover: [new Float32Array(sheet.size), 1], aside: [new Float32Array(2 * sheet.size), 2] }, gridIndex(columns, rows, this.given.plain ? 2 : 1));
        return { position, normal, geometry };
      };
      this.floor = field();
      this.skin = field();
      raise(this.floor, sheet.floor, sheet);
      this.put(this.floor.geometry, this.material(["ground.vert"], ["common", "wet", "floor.frag"]), 3);
      const cloth = ["common", "wet", "fat", "sheet.frag"];
      this.put(this.skin.geometry, this.material(["ground.vert"], cloth, { uOpaque: 1 }, { side: 2 }), 1);
      if (!this.given.plain) this.put(this.skin.geometry, this.material(["ground.vert"], cloth, { uOpaque: 0 }, { side: 2, transparent: true }), 6);
      const liver = liverOf(this.given.liver), off = new Float32Array(liver.position.length / 3);
      off.forEach((_, k) => {
        const [x, y, z] = liver.position.subarray(3 * k, 3 * k + 3), under = sheet.floor[sheet.cellAt(x, y)] ?? -SHADED;
        off[k] = (z - under) / SHADED;
        if (z - under < 3) sheet.shadeBeside([x, y, under, 2], sheet.beside);
      });
      this.put(make.geometry({ position: [liver.position, 3], normal: [liver.normal, 3], cover: [off, 1], aside: [new Float32Array(2 * off.length), 2] }, gridIndex(liver.columns, liver.rows)),
        this.material(["ground.vert"], ["common", "wet", "liver.frag"], {}, { side: 2 }), 3);
    }

    #makeTubes() {
      const { state, make } = this;
      this.tubes = state.tubes.map(tube => {
        const { place, wall, rings } = wallOf(tube, this.given);
        const geometry = make.geometry({ position: [new Float32Array(1.5 * place.length), 3], place: [place, 2], wall: [wall, 3] }, gridIndex(this.given.sides + 1, rings));
        const look = tube.look, own = {
          uFirst: tube.first, uCount: tube.count, uTorn: [-1, -1], uNick: new Float32Array(8), uPulse: 0, uColor: look.color, uDeep: look.deep,
          uLook: [look.vessels, look.bumps, look.rough, look.wet], uCoat: [look.fibres, look.fat], uLump: look.lumps, uFold: look.folds, uOnto: tube.onto,
        };
        return { tube, uniforms: this.put(geometry, this.material(["tube.vert"], ["common", "wet", "tube.frag"], own, { side: 2 }), 2).material.uniforms };
      });
    }

    #makeWebs() {
      const { given, state, make } = this, throwDice = dice(11);
      const runs = numbers(given.runs), films = numbers(given.films), count = films.length / 2;
      this.runs = runs;
      this.films = films;
      this.filmRows = new Float32Array(4 * count);
      this.gone = new Float32Array(2 * count);
      this.shown = new Int32Array(count);
      this.exposed = new Uint8Array(state.count);
      const grid = (columns, rows) => {
        const place = new Float32Array(2 * columns * rows);
        for (let k = 0; k < columns * rows; k++) place.set([(k % columns) / (columns - 1), Math.floor(k / columns) / (rows - 1)], 2 * k);
        return make.geometry({ position: [new Float32Array(1.5 * place.length), 3], place: [place, 2] }, gridIndex(columns, rows));
      };
      const clear = { transparent: true, depthWrite: false, side: 2 };
      const webs = grid(3, 7);
      make.each(webs, "film", this.filmRows, 4);
      make.each(webs, "gone", this.gone, 2);
      this.webs = this.put(webs, this.material(["ends", "web.vert"], ["common", "web.frag"], {}, clear), 4);
      this.threadList = [];
      for (let i = 0; i < state.count; i++) if (throwDice() < 0.36) this.threadList.push(i);
      this.threadRows = new Float32Array(2 * this.threadList.length);
      const threads = grid(2, 7);
      make.each(threads, "strand", this.threadRows, 2);
      this.threads = this.put(threads, this.material(["ends", "thread.vert"], ["common", "thread.frag"], {}, clear), 5);
    }

    #makeLumps() {
      const { make } = this, lumps = this.lumps = new scope.Lumps(this.sheet), place = new Float32Array(2 * AROUND * DOWN);
      for (let k = 0; k < AROUND * DOWN; k++) place.set([2 * Math.PI * (k % AROUND) / (AROUND - 1), Math.PI * Math.floor(k / AROUND) / (DOWN - 1)], 2 * k);
      const ball = make.geometry({ position: [new Float32Array(1.5 * place.length), 3], place: [place, 2] }, gridIndex(AROUND, DOWN));
      make.each(ball, "lump", lumps.places, 4);
      make.each(ball, "hangs", lumps.hangs, 4);
      this.lumpMesh = this.put(ball, this.material(["ends", "lump.vert"], ["common", "wet", "fat", "lump.frag"], {}, { side: 2 }), 2);
    }

    #makeInstruments() {
      this.instruments = this.given.trocars.map(() => null);
      this.clipMeshes = Array.from({ length: 8 }, () => this.#piece(scope.clipShape()));
    }

    // A mesh that is placed by three axes and a place.
    #piece(shape) {
      const geometry = this.make.geometry({ position: [new Float32Array(shape.position), 3], normal: [new Float32Array(shape.normal), 3], stuff: [new Float32Array(shape.stuff), 1] }, new Uint32Array(shape.index));
      const matrix = this.make.matrix(), mesh = this.put(geometry, this.material(["steel.vert"], ["common", "steel.frag"], { uPlace: matrix, uLit: 0 }, { side: 2 }));
      const hide = () => { mesh.visible = false; };
      hide();
      return {
        set(x, y, z, p) { mesh.visible = true; matrix.set(x[0], y[0], z[0], p[0], x[1], y[1], z[1], p[1], x[2], y[2], z[2], p[2], 0, 0, 0, 1); },
        light(on) { mesh.material.uniforms.uLit.value = on ? 1 : 0; },
        hide,
        remove: () => { this.group.remove(mesh); geometry.dispose(); mesh.material.dispose(); this.meshes.splice(this.meshes.indexOf(mesh), 1); },
      };
    }

    // A new frame has come.
    #take(now) {
      const { state, given } = this;
      state.take(this.source.geometry.attributes.position.array, given.nodes, now);
      const parted = state.parted.reduce((a, b) => a + b, 0), rows = state.rows;
      const moved = !this.drapedRows || parted !== this.drapedParted || this.drapedRows.some((x, k) => Math.abs(x - rows[k]) > MOVED);
      this.stale ||= moved;
      const torn = state.torn;
      this.tubes.forEach(({ uniforms, tube }, number) => {
        const mine = torn.filter(([which]) => which === number).map(([, element]) => element);
        uniforms.uTorn.value = [mine.at(-1) ?? -1, mine.at(-2) ?? -1];
        tube.torn = mine;
        const nicks = state.nicks.filter(([which]) => which === number).slice(-2);
        uniforms.uNick.value.fill(0);
        nicks.forEach((nick, k) => { uniforms.uNick.value.set([...nick.slice(1), this.#gap(tube, nick)], 4 * k); });
      });
      this.#fluids();
      this.#showClips();
      this.#soil(state.soil);
    }

    // Through a soiled lens it is blurred, and stained.
    #soil(soil) {
      if (soil === this.soiled) return;
      this.soiled = soil;
      this.lens.hidden = soil <= 0;
      this.lens.style.opacity = Math.min(1, 0.15 + 0.85 * soil);
      this.lens.style.backdropFilter = `blur(${(5 * soil).toFixed(1)}px)`;
    }

    // Half the width of a nick at the skin, in elements: it gapes as it goes through.
    #gap(tube, [, at, , depth]) {
      const i = clamp(Math.floor(at), 0, tube.count - 2), [a, b] = [this.state.at(tube, i), this.state.at(tube, i + 1)];
      return a[3] * (0.25 + 0.5 * depth) / Math.hypot(...sub(a, b).slice(0, 3));
    }

    #drape(now) {
      const { sheet, state } = this;
      this.stale = false;
      this.drapedAt = now;
      this.drapedRows = state.rows.slice();
      this.drapedParted = state.parted.reduce((a, b) => a + b, 0);
      sheet.drape(state);
      raise(this.skin, sheet.top, sheet);
      for (const name of ["cover", "aside"]) {
        this.skin.geometry.attributes[name].array.set(sheet[name]);
        this.skin.geometry.attributes[name].needsUpdate = true;
      }
      if (this.webs) this.#expose();
      if (this.lumps) {
        this.lumpMesh.geometry.instanceCount = this.lumps.hang(sheet);
        for (const name of ["lump", "hangs"]) this.lumpMesh.geometry.attributes[name].needsUpdate = true;
      }
      sheet.fill();
      this.field.needsUpdate = true;
    }

    // What lies under the whole sheet is not drawn.
    #expose() {
      const { sheet, state, exposed, films, runs, shown, filmRows, threadList, threadRows } = this;
      for (let i = 0; i < state.count; i++) {
        const o = 8 * i, k = sheet.cellAt(0.5 * (state.ends[o] + state.ends[o + 4]), 0.5 * (state.ends[o + 1] + state.ends[o + 5]));
        exposed[i] = k < 0 || sheet.cover[k] < 0.9 ? 1 : 0;
      }
      let n = 0, m = 0;
      for (let f = 0; f < films.length / 2; f++) {
        const i = runs[films[2 * f]], j = runs[films[2 * f + 1]];
        if (!exposed[i] && !exposed[j]) continue;
        filmRows.set([i, j, i * 0.37, j * 0.37], 4 * n);
        shown[n++] = f;
      }
      for (const i of threadList) if (exposed[i]) threadRows.set([i, i * 0.37], 2 * m++);
      this.webs.geometry.instanceCount = this.filmCount = n;
      this.threads.geometry.instanceCount = m;
      this.webs.geometry.attributes.film.needsUpdate = this.threads.geometry.attributes.strand.needsUpdate = true;
    }

    // How much of each film's strands has parted, on either half.
    #fray() {
      const { shown, films, runs, gone, state } = this;
      for (let n = 0; n < this.filmCount; n++) {
        const a = films[2 * shown[n]], b = films[2 * shown[n] + 1], middle = (a + b) / 2, sums = [0, 0, 0, 0];
        for (let i = a; i <= b; i++) {
          const frayed = state.ends[8 * runs[i] + 7];
          if (i <= middle) { sums[0] += frayed; sums[1]++; }
          if (i >= middle) { sums[2] += frayed; sums[3]++; }
        }
        gone[2 * n] = sums[0] / sums[1];
        gone[2 * n + 1] = sums[2] / sums[3];
      }
      this.webs.geometry.attributes.gone.needsUpdate = true;
    }

    #fluids() {
      this.wells.fill(0);
      this.state.wells.forEach(({ place, rate, kind }, i) => { this.wells.set([...place, kind === "bile" ? -rate : rate], 4 * i); });
    }

    #showClips() {
      const { state } = this, clips = state.clips;
      this.clipMeshes.forEach((mesh, i) => {
        if (!clips[i]) { mesh.hide(); return; }
        const tube = state.tubes[clips[i][0]], [x, y, z, r] = state.at(tube, clips[i][1]);
        const along = state.along(tube, clips[i][1]), up = unit(sub([0, 0, 1], along.map(v => v * along[2]))), side = cross(along, up);
        const wide = (r + 1.1) / 1.9;
        mesh.set(side.map(v => v * wide), up.map(v => v * 1.75 * r), along, [x, y, z]);
      });
    }

    #showHands() {
      const { state, given } = this, rods = [];
      this.dents.fill(0);
      this.instruments.forEach((shown, i) => {
        const hand = state.hand(i), name = given.instruments[hand.instrument];
        if (shown?.name !== name) {
          shown?.remove();
          const made = name ? new scope.Instrument(name, given.trocars[i], shape => this.#piece(shape)) : null;
          this.instruments[i] = shown = made && Object.assign(made, { name });
          shown?.light(i === scope.lit);
        }
        if (!shown) return;
        this.pivotError = Math.max(this.pivotError, shown.show(hand, rods));
        this.tips.set(hand.tip, 3 * i);
        if (hand.holds) this.dents.set([...hand.tip, 2.5], 4 * i);
      });
      rods.slice(0, 8).forEach(({ from, to, radius }, m) => { this.rods[0].set([...from, radius], 4 * m); this.rods[1].set([...to, 0], 4 * m); });
      this.shared.uRods.value = Math.min(rods.length, 8);
    }

    // Set the camera and draw what has changed; runs before each picture.
    draw(renderer, camera, now) {
      const { source, state, sheet, given } = this, at = source.geometry.attributes.position;
      source.visible = false;
      const fresh = at.version !== this.version || at.array !== this.array;
      if (fresh) { this.version = at.version; this.array = at.array; this.#take(now); }
      if (this.stale && (this.drapedAt === undefined || now - this.drapedAt > DRAPED_MS)) this.#drape(now);
      let moving = this.stale === true;
      if (fresh || this.shrinking) {
        this.shrinking = state.shrink(now);
        if (this.webs) this.#fray();
        moving ||= this.shrinking;
      }
      const suckers = this.instruments.map((_, i) => state.hand(i)).filter(hand => given.instruments[hand.instrument] === "suction" && hand.opening > 0).map(hand => hand.tip);
      if (sheet.flow(state.wells, suckers, state.pools)) { sheet.fill(); this.field.needsUpdate = true; moving = true; }
      if (given.plain) this.#coarsen(renderer);
      const pose = this.pose = scope.cameraOf(given.pivot, given.base, state.pose);
      if (!scope.free) this.#place(camera, pose);
      this.#frame(camera);
      this.#light(renderer, scope.free ? this.#poseOf(camera) : pose);
      this.#showHands();
      if (!given.plain) {
        const beat = Math.exp(-3 * ((BEAT_HZ * now / 1000) % 1)) - 0.3;
        for (const { tube, uniforms } of this.tubes) if (tube.look.pulse) uniforms.uPulse.value = SWELLS * beat;
      }
      this.drawn++;
      // An artery's pulse is seen where pictures cost little.
      const quick = this.times === undefined || this.times < 45;
      this.times = 0.8 * (this.times ?? 60) + 0.2 * Math.min(now - (this.lastDraw ?? now), 500);
      this.lastDraw = now;
      if (moving || (quick && !given.plain)) setTimeout(viewer.redraw, 15);
    }

    // A processor that draws takes time for every dot: a quarter of them is enough to work by.
    #coarsen(renderer) {
      const dots = renderer.getPixelRatio();
      if (dots <= COARSE) return;
      this.finer = () => renderer.setPixelRatio(dots);
      setTimeout(() => { renderer.setPixelRatio(COARSE); viewer.redraw(); });
    }

    #place(camera, { right, up, back, tip }) {
      const m = camera.matrix.clone().set(right[0], up[0], back[0], tip[0], right[1], up[1], back[1], tip[1], right[2], up[2], back[2], tip[2], 0, 0, 0, 1).premultiply(this.group.matrixWorld);
      m.decompose(camera.position, camera.quaternion, camera.scale);
    }

    // Where a free camera is, as the scope's pose says it.
    #poseOf(camera) {
      const m = this.group.matrixWorld.clone().invert().multiply(camera.matrixWorld).elements;
      const [right, up, back, tip] = [0, 4, 8, 12].map(k => [m[k], m[k + 1], m[k + 2]]);
      return { right, up, back, tip };
    }

    #frame(camera) {
      // The round picture touches the shorter sides of what a phone's panel leaves of the window; a
      // free camera's fills the window.
      const covered = viewer.covered(), side = scope.free ? 1 : ROUND * Math.min(camera.aspect, 1 - covered);
      const fov = 360 / Math.PI * Math.atan(Math.tan(FIELD / 2) / side);
      this.frame.style.backgroundSize = scope.free ? "0 0" : "";
      this.lens.style.display = scope.free ? "none" : "";
      this.high = Math.tan(fov * Math.PI / 360);
      if (Math.abs(camera.fov - fov) > 1e-6 || camera.near !== NEAR || camera.far !== FAR || covered !== this.covered) {
        Object.assign(camera, { fov, near: NEAR, far: FAR });
        camera.setViewOffset(camera.aspect, 1, 0, covered / 2, camera.aspect, 1);  // which updates the projection
        this.covered = covered;
        this.lens.style.bottom = this.frame.style.bottom = `${100 * covered}%`;
        this.camera = camera;
      }
      camera.updateMatrixWorld(true);
    }

    #light(renderer, pose) {
      const { shared, sheet } = this, canvas = renderer.domElement;
      const covered = this.covered * canvas.height;
      const radius = scope.free ? 1e9 : 1.005 * ROUND * Math.min(canvas.width, canvas.height - covered) / 2;
      shared.uRound.value = [canvas.width / 2, (canvas.height + covered) / 2, radius];
      shared.uEye.value = pose.tip;
      shared.uLamp.value = add(add(pose.tip, pose.up, 6), pose.right, -2);
      shared.uAxis.value = pose.back.map(x => -x);
      // The camera's head holds the middle of the picture equally bright.
      let d = 20;
      for (; d < 160; d += 2) { const q = add(pose.tip, pose.back, -d); if (q[2] < sheet.height(q[0], q[1])) break; }
      this.distance = d;
      this.gain += ((d * d + 150) / 3750 * 0.98 - this.gain) * (this.drawn > 4 ? 0.15 : 1);
      shared.uGain.value = this.gain;
    }

    remove() {
      for (const shown of [...this.instruments]) shown?.remove();
      for (const mesh of this.meshes) { this.group.remove(mesh); mesh.geometry.dispose(); mesh.material.dispose(); }
      for (const name of ["uNoise", "uSlopes", "uField", "uNodes", "uEnds"]) this.shared[name].value.dispose();
      this.frame.remove();
      this.lens.remove();
      this.camera?.clearViewOffset();
      this.finer?.();
    }
  }

  // A tube's grid, closed at both ends, from its wall in tube_walls.py: places along it, in elements,
  // and round it, rad; distances from the curve, mm, with their slopes along and round it.
  const wallOf = (tube, { rings: each, sides }) => {
    const given = numbers(tube.wall), last = each * (tube.count - 1), rings = last + 3;
    const place = new Float32Array(2 * rings * (sides + 1)), wall = new Float32Array(3 * rings * (sides + 1));
    const at = (j, i) => given[clamp(j, 0, last) * sides + (i + sides) % sides];
    for (let k = 0; k < rings; k++) for (let i = 0; i <= sides; i++) {
      const j = clamp(k - 1, 0, last), n = k * (sides + 1) + i, end = k === 0 ? -1 : k === rings - 1 ? 1 : 0;
      place.set([j / each, 2 * Math.PI * i / sides], 2 * n);
      const along = (at(j + 1, i) - at(j - 1, i)) * each / (Math.min(j + 1, last) - Math.max(j - 1, 0));
      const round = (at(j, i + 1) - at(j, i - 1)) * sides / (4 * Math.PI);
      // An end is closed by a ring of no size that looks along the tube.
      wall.set(end ? [0, -1e3 * end, 0] : [at(j, i), along, round], 3 * n);
    }
    return { place, wall, rings };
  };

  // Two triangles for each cell of a grid, or for each of some cells' width.
  const gridIndex = (columns, rows, width = 1) => {
    const index = [];
    for (let r = 0; r + 1 < rows; r += width) for (let c = 0; c + 1 < columns; c += width) {
      const p = r * columns + c, q = p + Math.min(width, columns - 1 - c), down = columns * Math.min(width, rows - 1 - r);
      index.push(p, q, q + down, p, q + down, p + down);
    }
    return new Uint32Array(index);
  };

  // The outermost cells of the ground reach far: nowhere does one look past its edge.
  const spread = (i, count) => i === 0 ? -BEYOND : i === count - 1 ? i + BEYOND : i;

  // Give a grid new heights, and normals of them.
  const raise = ({ position, normal, geometry }, heights, { columns, rows, cell }) => {
    for (let j = 0; j < rows; j++) for (let i = 0; i < columns; i++) {
      const k = j * columns + i, along = heights[j * columns + Math.min(i + 1, columns - 1)] - heights[j * columns + Math.max(i - 1, 0)];
      const up = heights[Math.min(j + 1, rows - 1) * columns + i] - heights[Math.max(j - 1, 0) * columns + i];
      const l = 1 / Math.sqrt(along * along + up * up + 4 * cell * cell);
      position[3 * k + 2] = heights[k];
      normal[3 * k] = -along * l;
      normal[3 * k + 1] = -up * l;
      normal[3 * k + 2] = 2 * cell * l;
    }
    geometry.attributes.position.needsUpdate = geometry.attributes.normal.needsUpdate = true;
  };

  // The liver's underside and edge: a profile, (x, z) mm, drawn along y.
  const liverOf = profile => {
    const columns = 60, rows = 26, position = new Float32Array(3 * columns * rows), normal = new Float32Array(3 * columns * rows);
    const at = (s, e) => {
      const k = Math.min(Math.floor(s), profile.length - 2), t = s - k, q = m => profile[clamp(m, 0, profile.length - 1)][e];
      return 0.5 * (2 * q(k) + (q(k + 1) - q(k - 1)) * t + (2 * q(k - 1) - 5 * q(k) + 4 * q(k + 1) - q(k + 2)) * t * t + (3 * q(k) - q(k - 1) - 3 * q(k + 1) + q(k + 2)) * t ** 3);
    };
    for (let j = 0; j < rows; j++) for (let i = 0; i < columns; i++) {
      const y = -80 + 180 * i / (columns - 1), s = j / (rows - 1) * (profile.length - 1);
      const x = at(s, 0) + 0.0035 * (y - 35) ** 2 * (y < 35 ? 0.7 : 0.4) - 7 * Math.exp(-(((y + 22) / 16) ** 2)) + 1.6 * Math.sin(0.13 * y);
      position.set([x, y, at(s, 1) + 2.2 * Math.sin(0.07 * y + 1) + 0.9 * Math.sin(0.19 * y)], 3 * (j * columns + i));
    }
    const point = (i, j) => { const k = 3 * (clamp(j, 0, rows - 1) * columns + clamp(i, 0, columns - 1)); return [position[k], position[k + 1], position[k + 2]]; };
    for (let j = 0; j < rows; j++) for (let i = 0; i < columns; i++) {
      const n = unit(cross(sub(point(i + 1, j), point(i - 1, j)), sub(point(i, j + 1), point(i, j - 1))));
      normal.set(n[0] > 0.05 || n[2] < -0.2 ? n.map(v => -v) : n, 3 * (j * columns + i));
    }
    return { position, normal, columns, rows };
  };

  // The scene node's picture, made anew when viser makes the node anew, as after a reconnection.
  const hooked = new WeakSet();
  let wanted = null;
  const source = () => {
    let found = null;
    viewer.node(wanted.name)?.traverse(mesh => { if (!found && mesh.isMesh) found = mesh; });
    return found;
  };
  const hook = scene => {
    if (hooked.has(scene)) return;
    hooked.add(scene);
    const before = scene.onBeforeRender;
    scene.onBeforeRender = (...given) => {
      before.apply(scene, given);
      const [renderer, , camera] = given;
      if (!wanted || !camera.isPerspectiveCamera) return;
      const now = performance.now(), node = source();
      if (scope.picture && scope.picture.source !== node) { scope.picture.remove(); scope.picture = null; }
      if (!node || !viewer.makers(node)) return;
      if (!scope.picture) scope.picture = new Picture(node, wanted.given, wanted.shaders);
      scope.picture.draw(renderer, camera, now);
    };
  };
  const ready = () => viewer.scene() && wanted && source() && viewer.makers(source());
  const begin = (left = 1200) => {
    if (ready()) { hook(viewer.scene()); viewer.redraw(); }
    else if (wanted && left) setTimeout(() => begin(left - 1), 50);
  };
  scope.show = (name, given, shaders) => {
    scope.hide();
    wanted = { name, given, shaders };
    viewer.hold(true);
    begin();
  };
  scope.hide = () => {
    wanted = null;
    scope.leave();
    scope.picture?.remove();
    scope.picture = scope.lit = null;
    scope.free = false;
    viewer.hold(false);
    viewer.redraw();
  };
  // Look with viser's own camera, which mouse and fingers turn then, or through the scope again.
  scope.setFree = free => {
    scope.letGo();
    scope.free = free;
    viewer.hold(!free);
    viewer.redraw();
  };
})();
