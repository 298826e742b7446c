// Instruments through trocars: shafts that always pass their pivots, jaws that open, and the rods
// that keep light off the tissue.
(() => {
  const scope = window.bluntdissectScope;
  if (scope.Instrument) return;
  const { mix, add, sub, cross, unit, dot } = scope.algebra;
  const SLEEVE = 0, STEEL = 1, TEETH = 2, GAUZE = 3, TITANIUM = 4;
  const SHAFT = 320;  // mm behind the hinge: it always leaves the picture

  // Length of the jaws, mm; how far they bow; half their width at the hinge and at the end; how far
  // the last third turns aside; and what else there is. The tip is always where the closed jaws end.
  const KINDS = {
    hook: { length: 14, single: true, wide: [1.3, 0.55], aside: 5.5, turn: 0.75 },
    grasper: { length: 20, wide: [1.9, 1.7], flat: 1.25, teeth: true },
    dissector: { length: 17, wide: [1.6, 0.6], bow: 0.30, teeth: true },
    "right angle": { length: 18, wide: [1.6, 0.7], aside: 14, turn: 0.62, teeth: true },
    swab: { length: 12, single: true, wide: [1.9, 1.9], ball: 3.6 },
    "clip applier": { length: 16, wide: [1.7, 1.5], flat: 0.7 },
    scissors: { length: 15, wide: [1.7, 0.35], flat: 0.45, bow: 0.15 },
    suction: { length: 30, single: true, wide: [2.5, 2.5], open: true },
  };

  // Rings round lines, as one geometry's numbers.
  const swept = parts => {
    const position = [], normal = [], stuff = [], index = [];
    for (const { line, wide, flat = 1, made = STEEL, inner = 0, sides = 16 } of parts) {
      const base = position.length / 3, last = line.length - 1;
      line.forEach((point, j) => {
        const t = unit(sub(line[Math.min(j + 1, last)], line[Math.max(j - 1, 0)]));
        const across = unit(cross(t, [0, 1, 0])), up = cross(across, t);
        for (let i = 0; i <= sides; i++) {
          const a = 2 * Math.PI * i / sides, c = Math.cos(a), s = Math.sin(a);
          // The inside of a jaw is flat and has the teeth.
          const inside = inner * s > 0.15, squeeze = inside ? 0.28 : 1;
          position.push(...add(add(point, across, wide[j] * c * flat), up, wide[j] * s * squeeze));
          normal.push(...unit(add(across.map(x => x * c * (inside ? 0.25 : 1)), up, s * flat)));
          stuff.push(inside ? TEETH : made);
        }
      });
      for (let j = 0; j < last; j++) for (let i = 0; i < sides; i++) {
        const a = base + j * (sides + 1) + i;
        index.push(a, a + 1, a + sides + 2, a, a + sides + 2, a + sides + 1);
      }
    }
    return { position, normal, stuff, index };
  };

  const jawLine = (kind, sign, n = 18) => Array.from({ length: n }, (_, i) => {
    const t = i / (n - 1), after = kind.aside ? Math.max(0, (t - kind.turn) / (1 - kind.turn)) : 0;
    const bow = (kind.bow ?? 0) * kind.length * 0.5 * (t * t - t);
    const back = kind.aside ? kind.length * (kind.turn * Math.min(1, t / kind.turn) + 0.22 * (1 - (1 - after) ** 2)) : kind.length * t;
    return [bow + (kind.aside ?? 0) * (after ** 1.4), sign * 0.45, -back];
  });

  class Instrument {
    // `put` makes a mesh of numbers and returns the matrix that places it, and how to remove it.
    constructor(name, pivot, put) {
      const kind = KINDS[name] ?? KINDS.dissector, n = 18;
      this.kind = kind;
      this.pivot = pivot;
      this.parts = [];
      const widths = Array.from({ length: n }, (_, i) => {
        const t = i / (n - 1);
        return mix(...kind.wide, t) * (kind.open ? 1 : Math.min(1, Math.sqrt(7 * (1.01 - t))));
      });
      const jaw = sign => put(swept([{ line: jawLine(kind, sign), wide: widths, flat: kind.flat ?? 0.85, inner: kind.teeth ? -sign : 0 }]));
      if (kind.single) this.jaws = [put(swept([{ line: jawLine(kind, 0), wide: widths }, ...(kind.ball ? [this.#ball(kind)] : [])]))];
      else this.jaws = [jaw(1), jaw(-1)];
      this.end = jawLine(kind, 0).at(-1);
      this.shaft = put(swept([
        { line: [[0, 0, SHAFT], [0, 0, 5.2]], wide: [2.5, 2.5], made: SLEEVE, sides: 24 },
        { line: [[0, 0, 5.3], [0, 0, 5.0], [0, 0, 1.0], [0, 0, -2.2]], wide: [2.35, 2.2, 2.1, 1.5], sides: 20 },
      ]));
    }

    #ball({ length, ball }) {
      const line = [], wide = [];
      for (let i = 0; i <= 12; i++) {
        const a = Math.PI * i / 12;
        line.push([0, 0, -length + ball - 1.0 + ball * Math.cos(a)]);
        wide.push(ball * Math.max(0.02, Math.sin(a)) * (1 + 0.05 * Math.sin(5 * a)));
      }
      return { line, wide, made: GAUZE, sides: 20 };
    }

    // Place it by its tip; `rods` gets the capsules of its parts.
    show({ tip, opening, roll }, rods) {
      const { kind, pivot, end } = this, back = unit(sub(pivot, tip));
      const level = unit(cross([0, 0, 1], back)), over = cross(back, level), c = Math.cos(roll), s = Math.sin(roll);
      const x = add(level.map(v => v * c), over, s), y = cross(back, x);
      // From the tip back to the hinge, and from there through the trocar.
      const hinge = add(add(tip, x, -end[0]), back, -end[2]), axis = unit(sub(pivot, hinge));
      const sx = unit(cross(cross(axis, x), axis)), sy = cross(axis, sx);
      this.shaft.set(sx, sy, axis, hinge);
      const angle = kind.single ? 0 : 0.5 * Math.min(opening / kind.length, 1.2);
      this.jaws.forEach((jaw, k) => {
        const a = k ? -angle : angle, ca = Math.cos(a), sa = Math.sin(a);
        const jy = add(y.map(v => v * ca), back, sa), jz = add(back.map(v => v * ca), y, -sa);
        jaw.set(x, jy, jz, hinge);
        const far = [0, 1, 2].map(i => hinge[i] + end[0] * x[i] + end[2] * jz[i]);
        rods.push({ from: hinge, to: far, radius: kind.ball ?? 0.75 * kind.wide[0] });
      });
      rods.push({ from: hinge, to: add(hinge, axis, 160), radius: 2.4 });
      const off = sub(pivot, hinge);
      return Math.hypot(...sub(off, axis.map(v => v * dot(off, axis))));
    }

    // Light it up, as the hand that has made an error, or not.
    light(on) { for (const piece of [this.shaft, ...this.jaws]) piece.light(on); }

    hide() { for (const piece of [this.shaft, ...this.jaws]) piece.hide(); }
    remove() { for (const piece of [this.shaft, ...this.jaws]) piece.remove(); }
  }

  // A closed clip across a tube: two bars, and the bow that joins them.
  scope.clipShape = () => swept([
    { line: [[-1.9, 0.42, 0], [1.7, 0.42, 0], [2.15, 0, 0], [1.7, -0.42, 0], [-1.9, -0.42, 0]], wide: [0.38, 0.38, 0.34, 0.38, 0.38], made: TITANIUM, sides: 8 },
  ]);
  scope.Instrument = Instrument;
  // Light up one hand's instrument, by the hand's number; null lights none.
  scope.light = hand => {
    scope.lit = hand;
    scope.picture?.instruments.forEach((shown, i) => { shown?.light(i === hand); });
    viewer.redraw();
  };
})();
