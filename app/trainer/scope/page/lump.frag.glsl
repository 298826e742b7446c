// Fat as on the sheet, wet all round.
varying vec3 vOwn;
varying float vFold;
void main() {
  if (outside()) discard;
  vec3 n = normalize(vNormal), smoothN = n;
  vec2 uv = (vOwn.xy + 0.6 * vOwn.z) / 24.0;
  vec4 f = field(vPlace), t = texture2D(uNoise, uv), t2 = texture2D(uNoise, uv * 3.1 + 0.17);
  vec3 base = fatOf(0.35 + 0.4 * t.g - 0.2 * vFold, t2.r, t.r);
  n = bumped(n, uv, vec3(1, 0, 0), vec3(0, 1, 0), vec2(0.25, 1.0), 1.2);
  float rough = 0.34, wet = 1.7;
  soak(base, rough, wet, n, smoothN, f.g * 2.0, f.a * 2.0, t2.r, vec2(0.0));
  float below = mix(0.45, 1.0, smoothstep(-0.8, 0.3, smoothN.z));
  gl_FragColor = vec4(camera(lit(n, base, vec3(0.40, 0.24, 0.12), rough, wet, below * (1.0 - 0.2 * vFold))), 1.0);
}
