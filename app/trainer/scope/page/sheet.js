// Height fields on one grid: the floor, the sheet of fat and peritoneum over floor and tubes, how
// much of it is left, and blood and bile that lie on what is uppermost.
(() => {
  const scope = window.bluntdissectScope;
  if (scope.Sheet) return;
  const { clamp, dice, numbers } = scope.algebra;
  const SPANS = 6;           // rounds in which the sheet is stretched between what it lies on
  const THICK = 0.35;        // of the sheet, mm
  const ROUND = 0.7;         // mm of tissue about a tube
  const WRAPS = 0.8;         // mm that it is wider than an organ
  const SINKS = 6;           // mm that it is lower at an organ's top: where they meet it is steep, and no shreds show
  const CLIMBS = 4;          // mm over the floor, at an organ that is drawn about
  const UNEVEN = 2;          // mm by which it is heaped up beside organs, here more, there less
  const EVENS = 12;          // rounds in which lobules on a slope are set apart
  const HEAPED = 2.6;        // of what is pushed aside, at the rim of a hole, mm
  const STAYS = 0.05;        // of a fluid where it has been, mm
  const BESIDE = 4;          // mm beside organs that the sheet is darker
  const REACH = 7;           // of a sucker's tip, mm
  const RUNS = 4;            // rounds a picture in which fluids run down

  class Sheet {
    constructor({ x0, y0, cell, columns, rows, heights }) {
      Object.assign(this, { x0, y0, cell, columns, rows, size: columns * rows, floor: numbers(heights) });
      for (const name of ["top", "cover", "blood", "bile", "cavity", "spare", "kept", "left", "all", "beside", "uneven", "steepX", "steepY"])
        this[name] = new Float32Array(this.size);
      this.cover.fill(1);
      this.aside = new Float32Array(2 * this.size);  // mm, of lobules from where they would lie on a plane
      const throwDice = dice(29);
      for (let k = 0; k < this.size; k++) this.uneven[k] = throwDice();
      this.#blur(this.uneven);
      for (let k = 0; k < this.size; k++) this.uneven[k] = clamp(2.2 * this.uneven[k] - 0.6, 0, 1);
      this.beside.fill(1);
      this.top.set(this.floor);
      this.volumes = { blood: 0, bile: 0 };  // mm^3 of the last frame
      this.bytes = new Uint8Array(4 * this.size);  // cover, blood, cavity, bile
    }

    cellAt(x, y) {
      const i = Math.round((x - this.x0) / this.cell), j = Math.round((y - this.y0) / this.cell);
      return i < 0 || j < 0 || i >= this.columns || j >= this.rows ? -1 : j * this.columns + i;
    }

    // Height of what is uppermost there, mm: the sheet, or where it is gone the floor.
    height(x, y) {
      const k = this.cellAt(x, y);
      return k < 0 ? -1e3 : this.#level(k);
    }

    // Lay the sheet over floor and tubes, and take it away where its strands have parted.
    drape(state) {
      const { top, floor, spare, kept, cell, columns, rows, size } = this;
      top.set(floor);
      for (const tube of state.tubes) this.#lay(state, tube);
      spare.set(top);
      kept.set(top);
      for (let n = 0; n < SPANS; n++) {
        this.#blur(spare);
        for (let k = 0; k < size; k++) spare[k] = Math.max(spare[k], kept[k]);
      }
      top.set(spare);
      this.#blur(top);
      for (let k = 0; k < size; k++) top[k] = Math.max(top[k], kept[k] + 0.25) + THICK;
      this.#takeAway(state);
      // What has gone lies heaped up at the rim, and the deeper a hole the darker it is.
      spare.set(this.cover);
      this.#blur(spare); this.#blur(spare); this.#blur(spare); this.#blur(spare);
      for (let k = 0; k < size; k++) top[k] += HEAPED * this.cover[k] * (this.cover[k] - Math.min(spare[k], this.cover[k])) * 2;
      spare.set(top);
      for (let n = 0; n < 4; n++) this.#blur(spare);
      for (let k = 0; k < size; k++) this.cavity[k] = clamp(1.0 - 0.085 * (spare[k] - floor[k]), 0.30, 1);
      this.#shade(state);
      // Beside organs fat is heaped up unevenly: no straight line is where they meet.
      for (let k = 0; k < size; k++) top[k] += UNEVEN * (1 - spare[k]) * (this.uneven[k] - 0.4);
      this.#setApart();
      return { cell, columns, rows };
    }

    // What is seen is darker beside a ball, (x, y, z, r) mm, the more the nearer it is.
    shadeBeside([x, y, z, r], dark) {
      const { x0, y0, cell, columns, rows, top } = this, reach = r + 2 * BESIDE;
      const low = (a, o) => Math.max(0, Math.floor((a - reach - o) / cell)), high = (a, o, most) => Math.min(most - 1, Math.ceil((a + reach - o) / cell));
      for (let j = low(y, y0); j <= high(y, y0, rows); j++) for (let i = low(x, x0); i <= high(x, x0, columns); i++) {
        const k = j * columns + i, along = x0 + i * cell - x, up = y0 + j * cell - y, over = top[k] - z;
        const gap = Math.max(0, Math.sqrt(along * along + up * up + over * over) - r) / BESIDE;
        // What lies on it has light.
        if (gap < 2) dark[k] = Math.min(dark[k], 1 - 0.6 * Math.exp(-gap * gap) * clamp(1.5 - over / r, 0, 1));
      }
    }

    // The floor is dark as it lies deep, and the sheet beside organs that stand out of it.
    #shade(state) {
      const { size, cover, cavity, beside, spare } = this;
      spare.set(beside);
      for (const tube of state.tubes) if (tube.bare) for (let s = 0; s <= tube.count - 1; s += 0.5) this.shadeBeside(state.at(tube, s), spare);
      for (let k = 0; k < size; k++) cavity[k] += cover[k] * (spare[k] - cavity[k]);
    }

    // Let what has been lost since the last frame well up, run down and lie, and what has been taken
    // up be gone: `volumes` are those in the field, mm^3. Return whether any moves.
    flow(wells, suckers, volumes) {
      let moves = false;
      for (const [kind, now] of Object.entries(volumes)) {
        const film = this[kind], mine = wells.filter(each => each.kind === kind), more = now - this.volumes[kind];
        this.volumes[kind] = now;
        if (more < 0) this.#take(film, suckers, -more, now);
        const rates = mine.reduce((sum, { rate }) => sum + rate, 0);
        for (let n = 0; n < RUNS; n++) {
          if (more > 0) for (const { place, rate } of mine) {
            const k = this.cellAt(place[0], place[1]);
            if (k >= 0) film[k] += more * (rates > 0 ? rate / rates : 1 / mine.length) / RUNS / this.cell ** 2;
          }
          moves = this.#run(film) || moves;
        }
        moves ||= more !== 0;
      }
      return moves;
    }

    // What the shaders read.
    fill() {
      const { bytes, cover, blood, bile, cavity, size } = this;
      for (let k = 0; k < size; k++) {
        bytes[4 * k] = 255 * cover[k];
        bytes[4 * k + 1] = Math.min(127.5 * blood[k], 255);
        bytes[4 * k + 2] = 255 * cavity[k];
        bytes[4 * k + 3] = Math.min(127.5 * bile[k], 255);
      }
    }

    // As far apart as the ground between them is long, and as few as that allows the others: so no
    // lobule is drawn out on a slope. Begun anew each time, it follows from the heights alone.
    #setApart() {
      const { aside, top, steepX, steepY, cell, columns, rows } = this;
      const longer = (k, m) => Math.sqrt((top[m] - top[k]) ** 2 + cell * cell) - cell;
      aside.fill(0);
      for (let j = 1; j < rows - 1; j++) for (let i = 1; i < columns - 1; i++) {
        const k = j * columns + i;
        steepX[k] = (longer(k - 1, k) - longer(k, k + 1)) / 4;
        steepY[k] = (longer(k - columns, k) - longer(k, k + columns)) / 4;
      }
      for (let n = 0; n < EVENS; n++) for (let j = 1; j < rows - 1; j++) for (let i = 1; i < columns - 1; i++) {
        const k = j * columns + i, a = 2 * k, row = 2 * columns;
        aside[a] = steepX[k] + (aside[a - 2] + aside[a + 2] + aside[a - row] + aside[a + row]) / 4;
        aside[a + 1] = steepY[k] + (aside[a - 1] + aside[a + 3] + aside[a + 1 - row] + aside[a + 1 + row]) / 4;
      }
    }

    // It lies on a tube, and goes up an organ's flanks, which stands out of it along an uneven line.
    #lay(state, tube) {
      const { x0, y0, cell, columns, rows, top, floor, uneven } = this, about = tube.bare ? WRAPS : ROUND;
      // Element by element: over balls at its nodes the sheet would lie in rings.
      for (let s = 0; s < tube.count - 1; s++) {
        const [ax, ay, az, ar] = state.at(tube, s), [bx, by, bz, br] = state.at(tube, s + 0.999999);
        const dx = bx - ax, dy = by - ay, long = Math.max(dx * dx + dy * dy, 1e-6), m = Math.max(ar, br) + about;
        const low = (a, b, o) => Math.max(0, Math.floor((Math.min(a, b) - m - o) / cell));
        const last = (a, b, o, most) => Math.min(most - 1, Math.ceil((Math.max(a, b) + m - o) / cell));
        for (let j = low(ay, by, y0); j <= last(ay, by, y0, rows); j++)
          for (let i = low(ax, bx, x0); i <= last(ax, bx, x0, columns); i++) {
            const x = x0 + i * cell - ax, y = y0 + j * cell - ay, t = clamp((x * dx + y * dy) / long, 0, 1), k = j * columns + i;
            const off = (x - t * dx) ** 2 + (y - t * dy) ** 2, r = ar + t * (br - ar) + about;
            if (off >= r * r) continue;
            const high = az + t * (bz - az) + Math.sqrt(r * r - off) - (tube.bare ? uneven[k] + SINKS * (1 - off / (r * r)) : 0);
            top[k] = Math.max(top[k], tube.bare && !tube.still ? Math.min(high, floor[k] + CLIMBS) : high);
          }
      }
    }

    #takeAway(state) {
      const { x0, y0, cell, columns, rows, size, left, all, cover, spare } = this, { ends, strands, parted } = state;
      left.fill(0);
      all.fill(0);
      for (let i = 0; i < state.count; i++) {
        const inSheet = strands[9 * i + 8], o = 8 * i;
        const u = (0.5 * (ends[o] + ends[o + 4]) - x0) / cell, v = (0.5 * (ends[o + 1] + ends[o + 5]) - y0) / cell;
        for (let j = Math.max(0, Math.floor(v) - 2); j <= Math.min(rows - 1, Math.floor(v) + 3); j++)
          for (let m = Math.max(0, Math.floor(u) - 2); m <= Math.min(columns - 1, Math.floor(u) + 3); m++) {
            const w = inSheet * Math.exp(-0.5 * ((m - u) ** 2 + (j - v) ** 2)), k = j * columns + m;
            all[k] += w;
            if (!parted[i]) left[k] += w;
          }
      }
      for (let k = 0; k < size; k++) cover[k] = all[k] > 0.12 ? left[k] / all[k] : Number.NaN;
      // Beyond the strands it is as near them, and further off whole.
      for (let n = 0; n < 8; n++) {
        spare.set(cover);
        for (let j = 1; j < rows - 1; j++) for (let i = 1; i < columns - 1; i++) {
          const k = j * columns + i;
          if (!Number.isNaN(cover[k])) continue;
          let sum = 0, count = 0;
          for (const q of [k - 1, k + 1, k - columns, k + columns]) if (!Number.isNaN(cover[q])) { sum += cover[q]; count++; }
          if (count) spare[k] = n < 5 ? sum / count : 1;
        }
        cover.set(spare);
      }
      for (let k = 0; k < size; k++) if (Number.isNaN(cover[k])) cover[k] = 1;
      // So wide that no cell of the grid shows in the rim, which the shader breaks up.
      this.#blur(cover);
      this.#blur(cover);
    }

    #level(k) { return (this.cover[k] > 0.45 ? this.top[k] : this.floor[k]) + this.blood[k]; }

    #run(film) {
      const { columns, rows } = this;
      let moves = false;
      for (let j = 1; j < rows - 1; j++) for (let i = 1; i < columns - 1; i++) {
        const k = j * columns + i, w = film[k];
        if (w < STAYS + 0.01) continue;
        const here = this.#level(k), near = [k - 1, k + 1, k - columns, k + columns];
        const falls = near.map(m => Math.max(0, here - this.#level(m))), sum = falls[0] + falls[1] + falls[2] + falls[3];
        if (sum <= 0) continue;
        const out = Math.min(w - STAYS, 0.25 * sum * Math.min(1, 2.5 * w));
        for (let m = 0; m < 4; m++) film[near[m]] += out * falls[m] / sum;
        film[k] -= out;
        moves ||= out > 1e-4;
      }
      // What reaches the field's edge runs off.
      for (let i = 0; i < columns; i++) film[i] = film[(rows - 1) * columns + i] = 0;
      for (let j = 0; j < rows; j++) film[j * columns] = film[(j + 1) * columns - 1] = 0;
      return moves;
    }

    // Take a volume, mm^3, of which some stays: from about the suckers first, then everywhere.
    #take(film, suckers, volume, stays) {
      const { x0, y0, cell, columns, size } = this, near = k => suckers.some(tip =>
        Math.hypot(x0 + (k % columns) * cell - tip[0], y0 + Math.floor(k / columns) * cell - tip[1]) < REACH);
      let left = volume / cell ** 2;
      for (const here of [k => near(k), () => true]) {
        let sum = 0;
        for (let k = 0; k < size; k++) if (film[k] > 0 && here(k)) sum += film[k];
        const fraction = stays > 0 ? Math.min(1, left / sum) : 1;
        if (sum > 0) for (let k = 0; k < size; k++) if (film[k] > 0 && here(k)) film[k] *= 1 - fraction;
        left -= fraction * sum;
        if (left <= 0) return;
      }
    }

    #blur(a) {
      const { columns, rows, size } = this, b = this.blurred ??= new Float32Array(size);
      for (let j = 0; j < rows; j++) for (let i = 0; i < columns; i++) {
        const k = j * columns + i;
        b[k] = (a[j * columns + Math.max(i - 1, 0)] + 2 * a[k] + a[j * columns + Math.min(i + 1, columns - 1)]) / 4;
      }
      for (let j = 0; j < rows; j++) for (let i = 0; i < columns; i++) {
        const k = j * columns + i;
        a[k] = (b[Math.max(j - 1, 0) * columns + i] + 2 * b[k] + b[Math.min(j + 1, rows - 1) * columns + i]) / 4;
      }
    }
  }
  scope.Sheet = Sheet;
})();
