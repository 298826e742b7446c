// The floor of the cavity: retroperitoneal tissue, muscle red with islands of fat.
void main() {
  if (outside()) { gl_FragColor = vec4(0.0, 0.0, 0.0, 1.0); return; }
  vec4 f = field(vPlace);
  vec2 uv = vPlace.xy / 46.0;
  vec3 n = normalize(vNormal), smoothN = n;
  vec4 t = texture2D(uNoise, uv), t2 = NOISE(uv * 2.7 + 0.31, t.brga);
  float fat = smoothstep(0.36, 0.74, t.r + 0.25 * t2.r - 0.06 + 0.20 * (t2.g - 0.5));
  vec3 base = mix(vec3(0.40, 0.135, 0.088), vec3(0.62, 0.34, 0.12), fat * (0.45 + 0.4 * t2.g));
#ifndef PLAIN
  // Loose tissue that is left lies over it in pale strands.
  float loose = smoothstep(0.40, 0.85, t.b) * smoothstep(0.35, 0.70, t2.r) * (1.0 - 0.5 * fat);
  base = mix(base, vec3(0.66, 0.42, 0.32), 0.28 * loose);
#endif
  base = mix(base, vec3(0.40, 0.03, 0.03), 0.45 * t2.a) * (0.75 + 0.5 * t2.r);
  n = bumped(n, uv * 2.0, vec3(1, 0, 0), vec3(0, 1, 0), vec2(0.8, 0.9 * fat), 2.6);
#ifndef PLAIN
  n = bumped(n, uv * 0.7 + 0.13, vec3(1, 0, 0), vec3(0, 1, 0), vec2(1, 0), 4.0);  // nowhere is it flat
  n = bumped(n, uv * 7.0, vec3(1, 0, 0), vec3(0, 1, 0), vec2(1, 0), 0.9);
#endif
  float rough = 0.38, wet = 1.0;
  soak(base, rough, wet, n, smoothN, f.g * 2.0, f.a * 2.0, t2.r, slopeOfFluid(vPlace, f.g));
  gl_FragColor = vec4(camera(lit(n, base, vec3(0.28, 0.14, 0.09), rough, wet,
    f.b * mix(1.0, 0.5, smoothstep(0.05, 0.45, f.r)))), 1.0);  // under the rim it is dark
}
