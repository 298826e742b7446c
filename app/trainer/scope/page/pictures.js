// One picture of noise for all tissue, made in the page: clouds, lobules, fibres, vessels; and its
// slopes, from which bumps come.
(() => {
  const scope = window.bluntdissectScope;
  if (scope.noisePicture) return;
  const { clamp, mix, dice } = scope.algebra;

  // Values at the points of a lattice of n x n that repeats, smoothed between.
  const lattice = (n, throwDice) => {
    const g = new Float32Array(n * n).map(throwDice), at = k => ((k % n) + n) % n, ease = t => t * t * (3 - 2 * t);
    return (x, y) => {
      const i = Math.floor(x), j = Math.floor(y), a = ease(x - i), b = ease(y - j);
      const value = (p, q) => g[at(q) * n + at(p)];
      return mix(mix(value(i, j), value(i + 1, j), a), mix(value(i, j + 1), value(i + 1, j + 1), a), b);
    };
  };

  // Domes of fat about scattered points, pressed against each other.
  const lobules = (cells, throwDice) => {
    const points = Array.from({ length: cells * cells }, () => [throwDice(), throwDice(), throwDice()]);
    return (x, y) => {
      const ci = Math.floor(x), cj = Math.floor(y), at = k => ((k % cells) + cells) % cells;
      let near = 9, next = 9;
      for (let j = -1; j < 2; j++) for (let i = -1; i < 2; i++) {
        const p = points[at(cj + j) * cells + at(ci + i)];
        const d = Math.hypot(ci + i + p[0] - x, cj + j + p[1] - y) * (0.85 + 0.3 * p[2]);
        if (d < near) { next = near; near = d; } else if (d < next) next = d;
      }
      return 1 - 0.95 * (2 * near / (near + next)) ** 2;
    };
  };

  scope.noisePicture = size => {
    const throwDice = dice(7), out = new Uint8Array(4 * size * size);
    const octaves = [8, 16, 32, 64, 128].map(n => [n, lattice(n, throwDice)]);
    const fine = lattice(96, throwDice), warpX = lattice(12, throwDice), warpY = lattice(12, throwDice);
    const branches = lattice(6, throwDice), twigs = lattice(11, throwDice), fat = lobules(13, throwDice);
    const cloud = (k, u, v) => octaves[k][1](u * octaves[k][0], v * octaves[k][0]);
    const ridge = (x, low, width) => clamp((1 - Math.abs(2 * x - 1) - low) / width, 0, 1);
    for (let y = 0; y < size; y++) for (let x = 0; x < size; x++) {
      const u = x / size, v = y / size;
      let sum = 0;
      for (let k = 0; k < 5; k++) sum += cloud(k, u, v) * 0.5 ** (k + 1);
      const lobe = fat(13 * u + (warpX(12 * u, 12 * v) - 0.5), 13 * v + (warpY(12 * u, 12 * v) - 0.5));
      const fibre = 0.5 * fine(96 * u, 6 * v + 3 * cloud(0, u, v)) + 0.3 * octaves[3][1](64 * u, 4 * v) + 0.2 * sum;
      const trunk = branches(6 * u + 0.7 * (cloud(1, u, v) - 0.5), 6 * v + 0.7 * (cloud(2, u, v) - 0.5));
      const twig = twigs(11 * u, 11 * v + 0.6 * cloud(2, u, v));
      const vessel = Math.max(ridge(trunk, 0.972, 0.022) * clamp(3 * (sum - 0.36), 0, 1), 0.55 * ridge(twig, 0.975, 0.02) * clamp(4 * (0.52 - sum), 0, 1));
      out.set([sum * 1.6 - 0.3, lobe, fibre * 1.7 - 0.35, vessel].map(each => 255 * clamp(each, 0, 1)), 4 * (y * size + x));
    }
    return out;
  };

  // Drops and smears of blood on the lens, as a background of CSS: the same in every page.
  scope.stains = () => {
    const throwDice = dice(5), parts = [];
    for (let i = 0; i < 26; i++) {
      const wide = 1.5 + 9 * throwDice() ** 3, high = wide * (1 + 1.2 * throwDice()), dark = (0.30 + 0.45 * throwDice()).toFixed(2);
      parts.push(`radial-gradient(ellipse ${wide.toFixed(1)}vmin ${high.toFixed(1)}vmin at ${(20 + 60 * throwDice()).toFixed(1)}% ${(8 + 84 * throwDice()).toFixed(1)}%, `
        + `rgba(96, 8, 6, ${dark}) 35%, rgba(120, 22, 14, ${(0.5 * dark).toFixed(2)}) 70%, transparent)`);
    }
    return [...parts, "rgba(110, 40, 30, 0.18)"].join(", ");
  };

  // Of clouds and lobules, along x and y: 128 is none.
  scope.slopesOf = (picture, size) => {
    const out = new Uint8Array(picture.length), slope = d => 128 + 127 * clamp(2 * d / 255, -1, 1);
    for (let y = 0; y < size; y++) for (let x = 0; x < size; x++) {
      const k = 4 * (y * size + x), r = 4 * (y * size + (x + 1) % size), d = 4 * (((y + 1) % size) * size + x);
      for (let c = 0; c < 2; c++) {
        out[k + 2 * c] = slope(picture[r + c] - picture[k + c]);
        out[k + 2 * c + 1] = slope(picture[d + c] - picture[k + c]);
      }
    }
    return out;
  };
})();
