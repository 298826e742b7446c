// Fat and peritoneum over all: lobules of two sizes, a thin wet film between, and where it is torn
// off whole lobules that go one after the other, and a ragged rim that light shines through.
// Drawn twice: what is opaque first, so that nothing below it is drawn, then what is not. The plain
// look draws all of it once, opaque.
varying float vCover;
varying vec2 vOn;
uniform float uOpaque;
void main() {
  if (outside()) { if (uOpaque < 0.5) discard; gl_FragColor = vec4(0.0, 0.0, 0.0, 1.0); return; }
  vec3 n = normalize(vNormal), smoothN = n;
  vec2 uv = vOn / 30.0;
  vec4 t = texture2D(uNoise, uv), big = texture2D(uNoise, uv * 0.55 + 0.23);
  vec4 t2 = NOISE(uv * 3.1 + 0.17, t.brga), wide = NOISE(uv * 0.43 + 0.6, big);
  float cover = vCover;
#ifndef PLAIN
  // A rim follows clumps of fat and not the grid: noise says how far aside its cover is read.
  cover = texture2D(uField, (vPlace.xy + 4.0 * (vec2(t.r, big.r) - 0.5) - uBox.xy) / uBox.zw).r;
#endif
  // Where little is left no crumbs of it hang on steep walls.
  float crumbs = (1.0 - cover) * (1.0 - smoothN.z);
  float edge = cover + 0.16 * (t2.r - 0.5) + 0.30 * (big.g - 0.5) + 0.24 * (t.g - 0.5) - 0.6 * crumbs;
  float rim = 1.0 - smoothstep(0.40, 0.50, edge);
#ifndef PLAIN
  // It is as thick as a lobule, and rounded: it looks the way that cover falls.
  vec3 dx = dFdx(vPlace), dy = dFdy(vPlace), ax = cross(dy, n), ay = cross(n, dx);
  float area = dot(dx, ax);
  vec3 fall = sign(area) * (dFdx(vCover) * ax + dFdy(vCover) * ay) / max(abs(area), 1e-9);
  float within = clamp(4.0 * (edge - 0.40), 0.0, 1.0);
  n = normalize(n - (1.0 - within) * (1.0 - within) * fall * min(5.0, 1.1 / max(length(fall), 1e-4)));
#endif
  if (edge < 0.40) discard;
  float low = smoothstep(26.0, 4.0, vPlace.x);  // towards the duodenum the omentum is fatter
  float fatty = smoothstep(0.14, 0.82, wide.r * 0.72 + t.r * 0.28 + 0.16 * (t.g - 0.5) + 0.25 * low);
  fatty *= 1.0 - 0.6 * rim;
#ifndef PLAIN
  bool solid = fatty > 0.5 && rim < 0.02;
  if (solid != (uOpaque > 0.5)) discard;
#endif
  vec4 f = field(vPlace);
  float lobule = mix(t.g, big.g, 0.45);
  vec3 fat = fatOf(lobule, t2.r, big.r);
  vec3 film = mix(vec3(0.56, 0.22, 0.13), vec3(0.74, 0.42, 0.26), 0.35 * t2.r + 0.65 * big.r);
  vec3 base = mix(film, fat, fatty);
  base = mix(base, vec3(0.40, 0.03, 0.03), 0.55 * wide.a * (1.0 - rim) + 0.30 * big.a);
  base = mix(base, vec3(0.78, 0.52, 0.36), 0.4 * rim);
  vec3 x = normalize(vec3(n.z, 0.0, -n.x)), y = normalize(vec3(0.0, n.z, -n.y));
  n = bumped(n, uv, x, y, vec2(0.25, 1.0), mix(0.4, 2.4, fatty));
#ifndef PLAIN
  n = bumped(n, uv * 0.55 + 0.23, x, y, vec2(0.3, 1.0), mix(0.6, 3.2, fatty));
  n = bumped(n, uv * 3.1 + 0.17, x, y, vec2(1.0, 0.35), 1.0);
  n = bumped(n, uv * 7.3 + 0.4, x, y, vec2(1.0, 0.2), 0.75);
#endif
  float rough = mix(0.36, 0.34, fatty), wet = mix(1.3, 1.7, fatty);
  soak(base, rough, wet, n, smoothN, f.g * 2.0 * (1.0 - 0.6 * rim), f.a * 2.0, t2.r, slopeOfFluid(vPlace, f.g));
  float folds = mix(1.0, 0.60 + 0.40 * smoothstep(0.0, 0.45, lobule), fatty);
  vec3 c = lit(n, base, vec3(0.40, 0.24, 0.12), rough, wet, folds * f.b * mix(1.0, 0.8, rim));
  float alpha = mix(mix(0.78, 1.0, smoothstep(0.0, 0.5, fatty)), 0.5 + 0.3 * t2.r, rim) * smoothstep(0.40, 0.44, edge);
  gl_FragColor = vec4(camera(c), uOpaque > 0.5 ? 1.0 : alpha);
}
