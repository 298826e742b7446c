// Lumps of fat at the rim of what has parted: as strands under one part it hangs by the sheet's edge,
// is drawn back to where more still holds, lies loose below, and is gone with the last of them. All
// follows from the sheet's cover, and so from the strands.
(() => {
  const scope = window.bluntdissectScope;
  if (scope.Lumps) return;
  const { clamp, dice, mix } = scope.algebra;
  const MANY = 1, FEW = 0.05;        // of the grid's cells that have a lump: at the rim, and off it
  const MOST = 400;                  // lumps in a picture
  const WHOLE = 0.62, GONE = 0.12;   // cover at which a lump comes off, and at which it is gone
  const SMALLEST = 0.8, LARGEST = 1.8, BACK = 1;  // mm: radii, and how far it is drawn back
  const LOW = 0.6, CLEAR = 2;        // mm of a tube over the floor, and cells beside it: none hides one

  class Lumps {
    constructor({ size }) {
      const throwDice = dice(23);
      this.list = Array.from({ length: size }, () => ({ rank: throwDice(), radius: mix(SMALLEST, LARGEST, throwDice()), off: [throwDice() - 0.5, throwDice() - 0.5] }));
      this.places = new Float32Array(4 * MOST);  // middle and radius, mm
      this.hangs = new Float32Array(4 * MOST);   // the way it hangs, and a seed
      this.count = 0;
    }

    // Find those of a sheet that has been laid.
    hang({ x0, y0, cell, columns, rows, cover, floor, top, kept }) {
      this.count = 0;
      const near = [0, CLEAR, -CLEAR, CLEAR * columns, -CLEAR * columns], tube = k => near.some(off => kept[k + off] - floor[k + off] > LOW);
      for (let k = 0; k < cover.length; k++) {
        const { rank, radius, off } = this.list[k], whole = cover[k], i = k % columns, j = Math.floor(k / columns);
        if (whole > WHOLE || whole < GONE || this.count === MOST || i < 4 || j < 4 || i > columns - 5 || j > rows - 5) continue;
        // What holds it is where more is left.
        const along = cover[k + 1] - cover[k - 1], up = cover[k + columns] - cover[k - columns], steep = Math.hypot(along, up) + 1e-3;
        const parted = (WHOLE - whole) / (WHOLE - GONE), back = BACK * parted / (steep * cell);
        const a = clamp(i + off[0] + back * along, 0, columns - 1), b = clamp(j + off[1] + back * up, 0, rows - 1);
        const m = Math.round(b) * columns + Math.round(a);
        if (rank > mix(MANY, FEW, parted) || tube(m)) continue;
        const low = floor[m] + 0.4 * radius, high = Math.max(low, top[m] - 0.25 * radius), fall = clamp(1.5 * parted, 0, 1);
        const side = (1 - fall) / steep, long = Math.hypot(1 - fall, 0.5), n = 4 * this.count++;
        this.places.set([x0 + a * cell, y0 + b * cell, mix(high, low, fall), radius * (1 - parted ** 2)], n);
        this.hangs.set([-side * along / long, -side * up / long, -0.5 / long, k % 1000 * 0.37], n);
      }
      return this.count;
    }
  }
  scope.Lumps = Lumps;
})();
