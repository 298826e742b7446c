// Draws the connective tissue between a duct and its bed from the few numbers that are streamed.
//
// For each strand the server streams where it holds the duct, how taut it is and which rod it lies
// against (strands.py), in the vertices of one of viser's simple meshes, which itself is not seen.
// Here, in the page, each becomes ribbons that face the camera: sagging while slack, whiter when
// taut, and two stubs that draw back and curl once it has parted. Films are stretched between
// neighbours and fray with them. The bed is laid through the strands' feet, drawn up by taut
// strands and pressed in by rods. `viewer` is `viser_bridge.run_in_page`'s.
(() => {
  if (window.bluntdissectStrands) return;
  const POINTS = 8;            // along a ribbon; a parted strand's two stubs have half of them each
  const ROWS = 6, COLUMNS = 3; // of a film between two strands
  const CURL_MS = 200;
  const PARTED = -9;
  const CELL = 1.0, MARGIN = 6.0;  // mm, of the grid on which the bed is drawn up
  const TENT = 1.9, TENT_REACH = 1.5;  // mm
  const beds = new Map(), drawn = new Map(), glosses = new Map();
  const numbers = text => new Float32Array(Uint8Array.from(atob(text), c => c.charCodeAt(0)).buffer);
  const meshIn = node => {
    let found = null;
    node.traverse(child => { if (!found && child.isMesh && !child.userData.drawn) found = child; });
    return found;
  };
  // The same throw of dice for the same strand in every page, -1 to 1.
  const dice = (i, k) => {
    const x = Math.sin(12.9898 * i + 78.233 * k) * 43758.5453;
    return 2 * (x - Math.floor(x)) - 1;
  };
  const clamp = (x, low, high) => Math.min(Math.max(x, low), high);

  // A mesh beside the source whose arrays are written anew with each picture.
  const sheet = (source, vertices, index, settings) => {
    const Attribute = source.geometry.attributes.position.constructor;
    const geometry = new source.geometry.constructor();
    const arrays = {};
    for (const [name, size] of [["position", 3], ["normal", 3], ["color", 4]]) {
      arrays[name] = new Float32Array(size * vertices);
      geometry.setAttribute(name, new Attribute(arrays[name], size));
    }
    geometry.setIndex(new Attribute(index, 1));
    const material = source.material.clone();
    Object.assign(material, { vertexColors: true, transparent: true, side: 2, ...settings });
    const mesh = new source.constructor(geometry, material);
    mesh.userData.drawn = true;
    mesh.frustumCulled = false;
    mesh.raycast = () => {};
    source.parent.add(mesh);
    source.geometry.addEventListener("dispose", () => geometry.dispose());
    return { mesh, ...arrays, changed() {
      for (const name of ["position", "normal", "color"]) geometry.attributes[name].needsUpdate = true;
    } };
  };

  class Strands {
    constructor(source, bed) {
      Object.assign(this, { source, bed, worn: source.geometry });
      const { count, fibres, pairs } = bed;
      const ribbons = count * fibres, films = pairs.length / 2;
      let at = 0;
      const strips = new Uint32Array(ribbons * (POINTS - 1) * 6);
      for (let r = 0; r < ribbons; r++) for (let k = 0; k + 1 < POINTS; k++) {
        const p = 2 * (r * POINTS + k);
        strips.set([p, p + 1, p + 3, p, p + 3, p + 2], at);
        at += 6;
      }
      const quads = new Uint32Array(films * (ROWS - 1) * (COLUMNS - 1) * 6);
      at = 0;
      for (let f = 0; f < films; f++) for (let r = 0; r + 1 < ROWS; r++)
        for (let c = 0; c + 1 < COLUMNS; c++) {
          const p = (f * ROWS + r) * COLUMNS + c, q = p + COLUMNS;
          quads.set([p, p + 1, q + 1, p, q + 1, q], at);
          at += 6;
        }
      this.films = sheet(source, films * ROWS * COLUMNS, quads,
        { roughness: 0.3, metalness: 0, depthWrite: false });
      this.films.mesh.renderOrder = 1;
      this.ribbons = sheet(source, 2 * ribbons * POINTS, strips, { roughness: 0.55, metalness: 0 });
      this.ribbons.mesh.renderOrder = 2;
      this.parted = new Float64Array(count).fill(NaN);  // when, ms of the page; NaN: whole
      this.middle = new Float32Array(3 * count);
      this.foot = new Float32Array(3 * count);
      this.eye = [0, 0, 0];
      this.lay();
      source.visible = false;
      // viser calls this for every set of vertices that comes.
      source.geometry.computeVertexNormals = () => { this.stale = true; };
      this.stale = this.fresh = true;
    }

    remove() {
      for (const { mesh } of [this.films, this.ribbons]) mesh.removeFromParent();
    }

    // The grid about the feet on which the bed is drawn up.
    lay() {
      const { feet, count } = this.bed;
      const low = [Infinity, Infinity], high = [-Infinity, -Infinity];
      for (let i = 0; i < count; i++) for (let k = 0; k < 2; k++) {
        low[k] = Math.min(low[k], feet[3 * i + k]);
        high[k] = Math.max(high[k], feet[3 * i + k]);
      }
      this.low = low.map(x => x - MARGIN);
      this.cells = [0, 1].map(k => Math.ceil((high[k] + MARGIN - this.low[k]) / CELL) + 1);
      this.tent = new Float32Array(this.cells[0] * this.cells[1]);
      this.ground = null;
    }

    tentAt(x, y) {
      const [columns, rows] = this.cells;
      const u = (x - this.low[0]) / CELL, v = (y - this.low[1]) / CELL;
      const i = Math.floor(u), j = Math.floor(v);
      if (i < 0 || j < 0 || i + 1 >= columns || j + 1 >= rows) return 0;
      const a = u - i, b = v - j, t = this.tent, p = j * columns + i;
      return (1 - b) * ((1 - a) * t[p] + a * t[p + 1])
        + b * ((1 - a) * t[p + columns] + a * t[p + columns + 1]);
    }

    drawUp() {
      const { bed: { feet, count, header }, tent, low, given } = this;
      const [columns, rows] = this.cells, reach = Math.ceil(2.2 * TENT_REACH / CELL);
      tent.fill(0);
      for (let i = 0; i < count; i++) {
        const taut = given[header + 5 * i + 3];
        if (!(taut > 0.02)) continue;
        const u = (feet[3 * i] - low[0]) / CELL, v = (feet[3 * i + 1] - low[1]) / CELL;
        for (let n = Math.max(0, Math.ceil(v - reach)); n <= Math.min(rows - 1, v + reach); n++)
          for (let m = Math.max(0, Math.ceil(u - reach)); m <= Math.min(columns - 1, u + reach); m++) {
            const d = ((m - u) ** 2 + (n - v) ** 2) * CELL * CELL;
            tent[n * columns + m] += 0.22 * taut * Math.exp(-0.5 * d / TENT_REACH ** 2);
          }
      }
      for (let p = 0; p < tent.length; p++) tent[p] = TENT * (1 - Math.exp(-tent[p]));
    }

    // How far a place of the bed is raised, so that the feet lie in it.
    towardsFeet(x, y, z) {
      const { feet, count } = this.bed;
      let sum = 1e-9, height = 1e-9 * z;
      for (let i = 0; i < count; i++) {
        const w = Math.exp(-((feet[3 * i] - x) ** 2 + (feet[3 * i + 1] - y) ** 2) / 8);
        sum += w;
        height += w * feet[3 * i + 2];
      }
      return 0.9 * (1 - Math.exp(-sum / 1.5)) * (height / sum - z);
    }

    // The bed's own surface: its vertices near the feet, and how far each is from their surface.
    ownGround() {
      const node = viewer.node("/stage/tissue_bed"), mesh = node && meshIn(node);
      if (!mesh) return null;
      if (this.ground?.mesh === mesh) return this.ground;
      const { floor, scale } = this.bed;
      const place = mesh.geometry.attributes.position, normal = mesh.geometry.attributes.normal;
      // Other strands may have moved it already.
      const was = mesh.userData.own ??= place.array.slice();
      const near = [], base = [];
      for (let v = 0; v < place.count; v++) {
        const x = floor[0] + scale * was[3 * v], y = floor[1] + scale * was[3 * v + 1];
        const z = floor[2] + scale * was[3 * v + 2];
        const out = [0, 1].map(k => {
          const p = k ? y : x, end = this.low[k] + (this.cells[k] - 1) * CELL;
          return Math.max(this.low[k] - p, p - end);
        });
        if (Math.max(...out) > 0) continue;
        near.push(v);
        base.push(this.towardsFeet(x, y, z));
      }
      return this.ground = { mesh, place, normal, was, near, base };
    }

    // What has run out of a torn duct lies on the bed as it is raised.
    laySpill() {
      const { floor, scale } = this.bed;
      viewer.node("/stage/spill")?.traverse(mesh => {
        const place = mesh.isMesh && mesh.geometry.attributes.position;
        if (!place || mesh.userData.laid) return;
        mesh.userData.laid = true;
        for (let v = 0; v < place.count; v++) {
          const [x, y, z] = [0, 1, 2].map(k => floor[k] + scale * place.array[3 * v + k]);
          const raised = this.towardsFeet(x, y, z);
          if (raised > 0) place.array[3 * v + 2] += (raised + 0.1) / scale;
        }
        place.needsUpdate = true;
      });
    }

    layBed() {
      this.laySpill();
      const ground = this.ownGround();
      if (!ground) return;
      const { floor, scale } = this.bed, { place, normal, was, near, base } = ground;
      const height = n => base[n] + this.tentAt(
        floor[0] + scale * was[3 * near[n]], floor[1] + scale * was[3 * near[n] + 1]);
      for (let n = 0; n < near.length; n++) {
        const v = near[n];
        const x = floor[0] + scale * was[3 * v], y = floor[1] + scale * was[3 * v + 1];
        let z = floor[2] + scale * was[3 * v + 2] + height(n);
        z = this.pressed(x, y, z);
        place.array[3 * v + 2] = (z - floor[2]) / scale;
      }
      if (!ground.rows) {
        // The bed is a grid stored row by row, so normals follow from its neighbours.
        const columns = this.bed.columns;
        ground.rows = near.filter(v => v % columns > 0 && v % columns < columns - 1
          && v >= columns && v < place.count - columns);
      }
      const p = place.array, c = this.bed.columns;
      for (const v of ground.rows) {
        const l = 3 * (v - 1), r = 3 * (v + 1), d = 3 * (v - c), u = 3 * (v + c);
        const ax = p[r] - p[l], ay = p[r + 1] - p[l + 1], az = p[r + 2] - p[l + 2];
        const bx = p[u] - p[d], by = p[u + 1] - p[d + 1], bz = p[u + 2] - p[d + 2];
        const x = ay * bz - az * by, y = az * bx - ax * bz, z = ax * by - ay * bx;
        const size = Math.sign(z) / Math.max(Math.hypot(x, y, z), 1e-12);
        normal.array.set([x * size, y * size, z * size], 3 * v);
      }
      place.needsUpdate = normal.needsUpdate = true;
    }

    // The height of the bed at a place, pressed in by rods.
    pressed(x, y, z) {
      const { rods, rodNumbers } = this.bed, { given } = this;
      for (let m = 0; m < rods; m++) {
        const at = rodNumbers * m;
        if (given[at + 7] === 0) continue;
        const ux = given[at + 3], uy = given[at + 4], uz = given[at + 5], r = given[at + 6] + 0.15;
        const flat = Math.max(ux * ux + uy * uy, 1e-6);
        const s = Math.max(0, ((x - given[at]) * ux + (y - given[at + 1]) * uy) / flat);
        if (s > 30) continue;
        const d = (x - given[at] - s * ux) ** 2 + (y - given[at + 1] - s * uy) ** 2;
        if (d >= r * r) continue;
        z = Math.min(z, given[at + 2] + s * uz - Math.sqrt(r * r - d));
      }
      return z;
    }

    // Middles and feet of all strands as they are drawn.
    place() {
      const { bed: { feet, count, header }, given, middle, foot } = this;
      for (let i = 0; i < count; i++) {
        const a = header + 5 * i, b = 3 * i, taut = given[a + 3];
        for (let k = 0; k < 3; k++) foot[b + k] = feet[b + k];
        foot[b + 2] += this.tentAt(feet[b], feet[b + 1]) - 0.12;
        const dx = foot[b] - given[a], dy = foot[b + 1] - given[a + 1], dz = foot[b + 2] - given[a + 2];
        const length = Math.hypot(dx, dy, dz);
        const loose = taut > 0 ? 0 : Math.sqrt(clamp(-taut, 0, 0.35));
        const sway = length * (0.05 * clamp(1 - 2.5 * taut, 0, 1) + 0.45 * loose);
        middle[b] = given[a] + 0.5 * dx + sway * dice(i, 1);
        middle[b + 1] = given[a + 1] + 0.5 * dy + sway * dice(i, 2);
        middle[b + 2] = given[a + 2] + 0.5 * dz - 0.5 * sway * Math.abs(dice(i, 3)) - 0.2 * length * loose;
        const bend = given[a + 4];
        if (bend > 0) this.bend(i, bend);
      }
    }

    // Takes a strand's middle round the rod that it lies against: code 1 + 2 rod + (side > 0).
    bend(i, code) {
      const { bed: { header, rodNumbers }, given, middle, foot } = this;
      const at = rodNumbers * ((code - 1) >> 1), side = (code - 1) & 1 ? 1 : -1, a = header + 5 * i, b = 3 * i;
      const u = [given[at + 3], given[at + 4], given[at + 5]], r = given[at + 6];
      const from = k => given[a + k] - given[at + k], to = k => foot[b + k] - given[at + k];
      const p = [0, 1, 2].map(from), q = [0, 1, 2].map(to);
      const pu = p[0] * u[0] + p[1] * u[1] + p[2] * u[2], qu = q[0] * u[0] + q[1] * u[1] + q[2] * u[2];
      for (let k = 0; k < 3; k++) { p[k] -= pu * u[k]; q[k] -= qu * u[k]; }
      const turn = u[0] * (p[1] * q[2] - p[2] * q[1]) + u[1] * (p[2] * q[0] - p[0] * q[2])
        + u[2] * (p[0] * q[1] - p[1] * q[0]);
      const lp = Math.hypot(...p) || 1, lq = Math.hypot(...q) || 1;
      let n = [0, 1, 2].map(k => p[k] / lp + q[k] / lq), size = Math.hypot(...n);
      if (size < 1e-3) return;
      size *= turn * side < 0 ? -1 : 1;  // more than half way round
      for (let k = 0; k < 3; k++)
        middle[b + k] = given[at + k] + 0.5 * (pu + qu) * u[k] + (r + 0.05) * n[k] / size;
    }

    draw(now) {
      const { bed, given, ribbons, middle, foot, parted } = this;
      const { count, header, fibres, widths, pairs } = bed;
      let moving = false;
      const line = new Float32Array(3 * POINTS), wide = new Float32Array(POINTS);
      for (let i = 0; i < count; i++) {
        const a = header + 5 * i, b = 3 * i, taut = given[a + 3];
        const whole = taut !== PARTED;
        if (whole) parted[i] = NaN;
        else if (Number.isNaN(parted[i])) parted[i] = this.fresh ? -1e9 : now;
        const back = whole ? 0 : clamp((now - parted[i]) / CURL_MS, 0, 1);
        moving ||= !whole && back < 1;
        for (let f = 0; f < fibres; f++) {
          const spread = f ? 0.85 : 0;
          const o = k => spread * dice(i, 10 * f + k);
          // Some threads hold higher up the wall: no line parts tissue and duct.
          const A = [given[a] + o(1), given[a + 1] + o(2), given[a + 2] + 1.5 * Math.max(0, o(8))];
          const B = [foot[b] + 2.2 * o(3), foot[b + 1] + 1.6 * o(4), foot[b + 2]];
          const M = [middle[b] + 0.5 * o(5), middle[b + 1] + 0.5 * o(6), middle[b + 2] + 0.3 * o(7)];
          const width = widths[i] * (f ? 0.45 : 1) * (1 - 0.25 * clamp(taut, 0, 1));
          if (whole) {
            for (let k = 0; k < POINTS; k++) {
              const t = -0.03 + 1.06 * k / (POINTS - 1), flare = Math.abs(2 * t - 1);
              const wa = (1 - t) * (1 - 2 * t), wm = 4 * t * (1 - t), wb = t * (2 * t - 1);
              for (let c = 0; c < 3; c++) line[3 * k + c] = wa * A[c] + wm * M[c] + wb * B[c];
              wide[k] = width * (0.62 + 1.15 * flare ** 4);
            }
          } else this.stubs(i, f, A, B, back, width, line, wide);
          this.ribbon(i * fibres + f, line, wide, taut, f);
        }
      }
      ribbons.changed();
      this.film(pairs);
      this.fresh = false;
      return moving;
    }

    // A parted strand: half of it draws back to the duct, half to the bed, and both curl.
    stubs(i, f, A, B, back, width, line, wide) {
      const half = POINTS / 2;
      const span = [0, 1, 2].map(k => B[k] - A[k]), gap = Math.hypot(...span) || 1;
      for (const [end, sign, from] of [[A, 1, 0], [B, -1, half]]) {
        const own = 0.55 + 0.45 * dice(i, 30 + from + f) + (sign < 0 ? 0.25 : 0);
        const reach = (1 - back) * 0.5 * Math.min(gap, 6) + back * Math.max(0.3, 1.3 * own);
        const lean = [dice(i, 40 + from + f), dice(i, 50 + from + f), sign < 0 ? 0.55 : -0.35];
        const ll = Math.hypot(...lean);
        for (let k = 0; k < half; k++) {
          const t = k / (half - 1), at = from ? POINTS - 1 - k : k;
          for (let c = 0; c < 3; c++) {
            const straight = sign * span[c] / gap, curled = lean[c] / ll;
            const turn = back * (0.35 + 0.65 * t);
            line[3 * at + c] = end[c] + reach * t * ((1 - turn) * straight + turn * curled);
          }
          // The curl: the tip comes round again.
          const curl = back * reach * 0.55 * t * t;
          line[3 * at] += curl * dice(i, 60 + from);
          line[3 * at + 1] += curl * dice(i, 61 + from);
          line[3 * at + 2] -= 0.5 * curl * (sign < 0 ? 1 : -0.4);
          wide[at] = width * (1.15 - 0.75 * t) * (k + 1 === half ? 0.35 : 1);
        }
      }
    }

    ribbon(r, line, wide, taut, f) {
      const { position, normal, color } = this.ribbons, { eye } = this, half = POINTS / 2;
      const whole = taut !== PARTED, pull = whole ? clamp(taut, 0, 1) : 0;
      // As through the scope (thread.frag.glsl): rosy where slack, pale and opaque where taut.
      const red = 0.60 + 0.24 * pull, green = 0.30 + 0.36 * pull, blue = 0.20 + 0.36 * pull;
      const alpha = (f ? 0.75 : 1) * (whole ? 0.5 + 0.5 * pull : 0.85);
      for (let k = 0; k < POINTS; k++) {
        const k0 = !whole && k === half ? k : Math.max(k - 1, 0);
        const k1 = !whole && k === half - 1 ? k : Math.min(k + 1, POINTS - 1);
        const tx = line[3 * k1] - line[3 * k0], ty = line[3 * k1 + 1] - line[3 * k0 + 1];
        const tz = line[3 * k1 + 2] - line[3 * k0 + 2];
        const x = line[3 * k], y = line[3 * k + 1], z = line[3 * k + 2];
        let vx = eye[0] - x, vy = eye[1] - y, vz = eye[2] - z;
        const vl = 1 / Math.hypot(vx, vy, vz);
        vx *= vl; vy *= vl; vz *= vl;
        let sx = ty * vz - tz * vy, sy = tz * vx - tx * vz, sz = tx * vy - ty * vx;
        const sl = 1 / Math.max(Math.hypot(sx, sy, sz), 1e-9);
        sx *= sl; sy *= sl; sz *= sl;
        // Between the two stubs of a parted strand there is nothing.
        const cut = !whole && (k === half - 1 || k === half);
        for (let side = 0; side < 2; side++) {
          const p = 3 * (2 * (r * POINTS + k) + side), s = side ? 1 : -1;
          position[p] = x + s * wide[k] * sx;
          position[p + 1] = y + s * wide[k] * sy;
          position[p + 2] = z + s * wide[k] * sz;
          // As of a thread: turned to both sides at its edges.
          normal[p] = 0.75 * vx + 0.65 * s * sx;
          normal[p + 1] = 0.75 * vy + 0.65 * s * sy;
          normal[p + 2] = 0.75 * vz + 0.65 * s * sz;
          const q = p / 3 * 4;
          color[q] = red; color[q + 1] = green; color[q + 2] = blue;
          color[q + 3] = cut ? 0 : alpha * (1 - 0.75 * (k / (POINTS - 1)) ** 6);  // into the bed
        }
      }
    }

    // Films between neighbours: whole, torn along one strand, or tatters on duct and bed.
    film(pairs) {
      const { films, given, middle, foot, bed: { header } } = this;
      const { position, normal, color } = films;
      const point = (i, t, out) => {
        const a = header + 5 * i, b = 3 * i;
        const wa = (1 - t) * (1 - 2 * t), wm = 4 * t * (1 - t), wb = t * (2 * t - 1);
        for (let k = 0; k < 3; k++)
          out[k] = wa * given[a + k] + wm * middle[b + k] + wb * foot[b + k];
      };
      const P = [0, 0, 0], Q = [0, 0, 0];
      for (let f = 0; f < pairs.length / 2; f++) {
        const i = pairs[2 * f], j = pairs[2 * f + 1];
        const ti = given[header + 5 * i + 3], tj = given[header + 5 * j + 3];
        const wi = ti !== PARTED, wj = tj !== PARTED;
        const pull = clamp(0.5 * ((wi ? ti : 0) + (wj ? tj : 0)), 0, 1);
        for (let r = 0; r < ROWS; r++) {
          const t = r / (ROWS - 1);
          // Where both have parted, shreds of it are left at either end.
          const left = 0.10 + 0.10 * Math.abs(dice(i, 70 + r));
          const shred = wi || wj ? t : t < 0.5 ? left * t : 1 - left * (1 - t);
          point(i, shred, P);
          point(j, shred, Q);
          // A film torn from one strand hangs along the other.
          const rag = 0.28 + 0.22 * dice(j, 80 + r);
          const lo = !wi && wj ? 1 - rag : 0, hi = wi && !wj ? rag : 1;
          const neck = 1 - 0.35 * pull * 4 * t * (1 - t);
          for (let c = 0; c < COLUMNS; c++) {
            const s = lo + (hi - lo) * (0.5 + (c / (COLUMNS - 1) - 0.5) * (wi && wj ? 1 : neck));
            const p = 3 * ((f * ROWS + r) * COLUMNS + c);
            const inward = 0.18 * 4 * s * (1 - s) * 4 * t * (1 - t) * dice(i, 90);
            for (let k = 0; k < 3; k++) position[p + k] = P[k] + s * (Q[k] - P[k]);
            position[p + 1] += inward;
            const side = position[p + 1] < 0 ? -1 : 1;
            normal[p] = 0.35 * dice(i, 91) + 0.2 * dice(j, 92 + r);
            normal[p + 1] = side * 0.8;
            normal[p + 2] = 0.55;
            const q = p / 3 * 4;
            color[q] = 0.62 + 0.18 * pull; color[q + 1] = 0.32 + 0.30 * pull; color[q + 2] = 0.20 + 0.33 * pull;
            const gone = !wi && !wj && (r === ROWS >> 1 || r + 1 === ROWS >> 1);
            color[q + 3] = gone ? 0 : (0.3 + 0.16 * pull + 0.1 * Math.abs(dice(i, 93)))
              * (wi || wj ? 1 : 0.8) * (1 - 0.85 * t ** 3);  // it runs out into the bed
          }
        }
      }
      films.changed();
    }

    // Brings the picture up to now; returns whether something still moves by itself.
    update(now, camera) {
      const p = camera.position.clone();
      // New ones come after the renderer has placed what it draws in this picture.
      for (const { mesh } of [this.films, this.ribbons]) mesh.updateWorldMatrix(true, false);
      this.ribbons.mesh.worldToLocal(p.setFromMatrixPosition(camera.matrixWorld));
      const away = Math.hypot(p.x - this.eye[0], p.y - this.eye[1], p.z - this.eye[2]);
      if (this.bed.columns && !this.ground) this.stale = true;
      if (!this.stale && !this.moving && away < 0.2) return false;
      this.eye = [p.x, p.y, p.z];
      if (this.stale) {
        this.stale = false;
        this.given = this.source.geometry.attributes.position.array;
        if (this.bed.columns) {
          this.drawUp();
          this.layBed();
        }
        this.place();
      }
      return this.moving = this.draw(now);
    }
  }

  const watch = () => {
    const scene = viewer.scene();
    if (!scene) { setTimeout(watch, 50); return; }
    const before = scene.onBeforeRender;
    scene.onBeforeRender = (...given) => {
      before.apply(scene, given);
      let moving = false;
      for (const [name, bed] of beds) {
        const node = viewer.node(name), source = node && meshIn(node);
        if (!source) continue;
        // Strands that replace others of their name may not be the node's yet.
        const worn = source.geometry, size = worn.attributes.position.array.length;
        if (size !== 3 * Math.ceil((bed.header + 5 * bed.count) / 3)) continue;
        let strands = drawn.get(name);
        if (strands?.source !== source || strands.worn !== worn || strands.bed !== bed) {
          strands?.remove();
          drawn.set(name, strands = new Strands(source, bed));
        }
        moving = strands.update(performance.now(), given[2]) || moving;
      }
      for (const [name, gloss] of glosses) {
        const node = viewer.node(name), mesh = node && meshIn(node);
        if (mesh && mesh.material.userData.gloss !== gloss) {
          Object.assign(mesh.material, gloss);
          mesh.material.userData.gloss = gloss;
        }
      }
      if (moving) setTimeout(viewer.redraw, 30);
    };
  };
  window.bluntdissectStrands = {
    drawn,
    show(name, bed) {
      const pairs = Array.from(numbers(bed.pairs), Math.round);
      const header = bed.rods * bed.rodNumbers;
      beds.set(name, { ...bed, header, feet: numbers(bed.feet), widths: numbers(bed.widths), pairs });
    },
    polish(name, gloss) { glosses.set(name, gloss); },
    remove(name) {
      drawn.get(name)?.remove();
      beds.delete(name);
      drawn.delete(name);
    },
  };
  watch();
})();
