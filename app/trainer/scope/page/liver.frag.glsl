// The liver's underside: smooth capsule, fine lobular grain, and a broad wet sheen.
varying float vCover;  // height over what lies under it
void main() {
  if (outside()) { gl_FragColor = vec4(0.0, 0.0, 0.0, 1.0); return; }
  vec3 n = normalize(vNormal);
  vec2 uv = vec2(vPlace.y, vPlace.x * 0.7 + vPlace.z) / 60.0;
  vec4 t = texture2D(uNoise, uv), t2 = NOISE(uv * 5.0, t.brga);
  vec3 base = mix(vec3(0.26, 0.060, 0.040), vec3(0.36, 0.10, 0.062), t.r) * (0.85 + 0.3 * t2.r);
  base = mix(base, vec3(0.42, 0.19, 0.10), 0.30 * smoothstep(0.62, 0.80, t.r));
  vec3 across = vec3(0, 1, 0), up = normalize(cross(n, across));
  n = bumped(n, uv * 0.6 + 0.2, across, up, vec2(1, 0), 2.6);  // broad and shallow: no surface is even
  n = bumped(n, uv * 1.5, across, up, vec2(1, 0), 1.6);
#ifndef PLAIN
  n = bumped(n, uv * 8.0, across, up, vec2(0.8, 0.3), 0.55);
#endif
  // It is dark where it meets what lies under it, along an uneven line.
  float clear = smoothstep(0.0, 1.0, vCover + 0.25 * (t.r - 0.5));
  gl_FragColor = vec4(camera(lit(n, base, vec3(0.16, 0.07, 0.05), 0.36, 1.1, mix(0.25, 1.0, clear))), 1.0);
}
