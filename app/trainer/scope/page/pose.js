// Vectors, and the pose of a laparoscope in its trocar: the algebra of pose.py.
(() => {
  if (window.bluntdissectScope) return;
  const scope = window.bluntdissectScope = {};
  const clamp = (x, low, high) => Math.min(Math.max(x, low), high), mix = (a, b, t) => a + (b - a) * t;
  const add = (a, b, k = 1) => [a[0] + k * b[0], a[1] + k * b[1], a[2] + k * b[2]];
  const sub = (a, b) => add(a, b, -1), dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const unit = a => { const l = Math.hypot(...a) || 1; return [a[0] / l, a[1] / l, a[2] / l]; };
  const turn = (v, axis, angle) => {
    const c = Math.cos(angle), s = Math.sin(angle), x = cross(axis, v), d = dot(axis, v) * (1 - c);
    return [0, 1, 2].map(i => v[i] * c + x[i] * s + axis[i] * d);
  };
  const numbers = text => new Float32Array(Uint8Array.from(atob(text), c => c.charCodeAt(0)).buffer);
  // The same throws in every page, 0 to 1.
  const dice = seed => () => (seed = (Math.imul(seed, 1664525) + 1013904223) >>> 0) / 4294967296;
  scope.algebra = { clamp, mix, add, sub, dot, cross, unit, turn, numbers, dice };

  scope.cameraOf = (pivot, [u0, v0, s0], { pan, tilt, depth, cable, head, angle }) => {
    const made = (x, y, z) => [0, 1, 2].map(k => x * u0[k] + y * v0[k] + z * s0[k]);
    const cp = Math.cos(pan), sp = Math.sin(pan), ct = Math.cos(tilt), st = Math.sin(tilt);
    const u = made(cp, 0, -sp), v = made(-sp * st, ct, -cp * st), s = made(sp * ct, st, cp * ct);
    const sight = add(v.map(x => Math.cos(cable) * x), u, Math.sin(cable));
    const up = add(v.map(x => Math.cos(head) * x), u, Math.sin(head)), prism = unit(cross(s, sight));
    const [right, top, back] = [cross(s, up), up, s.map(x => -x)].map(each => turn(each, prism, angle));
    return { tip: add(pivot, s, depth), right, up: top, back, shaft: s };
  };
})();
