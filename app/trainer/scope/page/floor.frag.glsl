// The floor of the cavity: retroperitoneal tissue, muscle red with islands of fat.
void main() {
  if (outside()) { gl_FragColor = vec4(0.0, 0.0, 0.0, 1.0); return; }
  vec4 f = field(vPlace);
  vec2 uv = vPlace.xy / 46.0;
  vec3 n = normalize(vNormal), smoothN = n;
  vec4 t = texture2D(uNoise, uv), t2 = NOISE(uv * 2.7 + 0.31, t.brga);
  float fat = smoothstep(0.42, 0.62, t.r + 0.25 * t2.r - 0.1);
  vec3 base = mix(vec3(0.40, 0.115, 0.075), vec3(0.62, 0.33, 0.10), fat * 0.75);
  base = mix(base, vec3(0.40, 0.03, 0.03), 0.45 * t2.a) * (0.75 + 0.5 * t2.r);
  n = bumped(n, uv * 2.0, vec3(1, 0, 0), vec3(0, 1, 0), vec2(0.6, 0.9 * fat), 2.2);
#ifndef PLAIN
  n = bumped(n, uv * 7.0, vec3(1, 0, 0), vec3(0, 1, 0), vec2(1, 0), 0.8);
#endif
  float rough = 0.42, wet = 0.9;
  soak(base, rough, wet, n, smoothN, f.g * 2.0, f.a * 2.0, t2.r, slopeOfFluid(vPlace, f.g));
  gl_FragColor = vec4(camera(lit(n, base, vec3(0.28, 0.14, 0.09), rough, wet, f.b)), 1.0);
}
