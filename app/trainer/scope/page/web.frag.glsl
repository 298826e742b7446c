// Areolar tissue: a wet translucent film with few fibres, paler where taut, with holes where it is
// strained, and tufts at both ends once it has parted.
varying vec2 vOn;
varying vec4 vState;
varying float vWide, vSeed;
float dice(float x) { return fract(sin(x * 12.9898) * 43758.5453); }
void main() {
  if (outside()) discard;
  float x = vOn.x, t = vOn.y, taut = clamp(mix(vState.x, vState.y, x), 0.0, 1.0);
  float gone = mix(vState.z, vState.w, smoothstep(0.25, 0.75, x)), mid = 1.0 - abs(2.0 * t - 1.0);
  vec2 uv = vec2(0.085 * x + dice(vSeed), 0.14 * t + dice(vSeed + 1.3));
  vec4 f = texture2D(uNoise, uv), g = texture2D(uNoise, uv * vec2(2.6, 2.0) + 0.37);
  float fibre = 0.6 * f.b + 0.4 * g.b, thin = smoothstep(1.8, 6.0, vWide);
  float hole = mix(0.05, 0.42, max(thin, 0.75 * taut) * (0.4 + 0.6 * mid));
  hole += 0.6 * gone * smoothstep(0.35, 0.75, mid + 0.5 * (g.b - 0.5));
  float body = smoothstep(hole, hole + 0.42, 0.55 * f.r + 0.45 * fibre);
  // Frayed at its sides, where the next film overlaps it.
  float fray = x + 0.3 * (g.b - 0.5), side = smoothstep(0.0, 0.35, fray) * smoothstep(1.0, 0.65, fray);
  float both = smoothstep(0.0, 0.10, t) * smoothstep(1.0, 0.86, t);
  float alpha = body * (0.15 + 0.10 * taut + 0.42 * smoothstep(0.50, 0.82, fibre)) * side * mix(0.35, 1.0, both);
  alpha *= 1.0 - smoothstep(0.75, 1.0, gone) * smoothstep(0.05, 0.45, mid + 0.5 * (fibre - 0.5));
  if (alpha < 0.02) discard;
  vec3 n = normalize(vNormal), v = normalize(uEye - vPlace);
  if (dot(n, v) < 0.0) n = -n;
  // Seen along it, a film is longer in the ray's way.
  alpha *= 1.0 + 1.2 * pow(1.0 - dot(n, v), 3.0);
  n = normalize(n + 0.8 * vec3(f.b - 0.5, g.b - 0.5, g.r - 0.5));
  vec3 base = mix(vec3(0.62, 0.32, 0.20), vec3(0.80, 0.62, 0.53), clamp(0.15 + 0.75 * taut + 0.3 * (fibre - 0.5), 0.0, 1.0));
  vec4 fluid = field(vPlace);
  base = mix(base, vec3(0.40, 0.02, 0.015), 0.9 * smoothstep(0.03, 0.4, fluid.g + 0.15 * (f.r - 0.5)));
  vec3 c = lit(n, base, vec3(0.6, 0.42, 0.34), 0.30, 0.9, 1.0);
  float shine = smoothstep(0.7, 1.6, max(c.r, c.g));
  gl_FragColor = vec4(camera(c), min(1.0, alpha + 0.25 * shine * body * side));
}
