// Bumps of a surface from the picture of slopes, and fluid that lies on it.
vec3 bumped(vec3 n, vec2 uv, vec3 across, vec3 up, vec2 pick, float height) {
  vec4 g = texture2D(uSlopes, uv) - 0.502;
  return normalize(n - height * ((pick.x * g.r + pick.y * g.b) * across + (pick.x * g.g + pick.y * g.a) * up));
}

vec2 slopeOfFluid(vec3 p, float depth) {
  if (depth < 0.01) return vec2(0.0);
  vec2 e = vec2(1.2, 0.0);
  return 1.3 * vec2(field(p + e.xyy).g - field(p - e.xyy).g, field(p + e.yxy).g - field(p - e.yxy).g);
}

// Blood, w mm of it, hides what it lies on, levels its bumps and shines; bile is thin and green.
void soak(inout vec3 albedo, inout float rough, inout float wet, inout vec3 n, vec3 smoothN,
    float w, float bile, float noise, vec2 slope) {
  if (w + bile < 0.004) return;
  w *= 0.75 + 0.7 * noise;
  float film = smoothstep(0.03, 0.20, w), deep = smoothstep(0.12, 1.2, w);
  vec3 blood = mix(vec3(0.30, 0.010, 0.008), vec3(0.085, 0.002, 0.003), deep);
  albedo = mix(albedo, blood, film * mix(0.82, 1.0, deep));
  albedo = mix(albedo, vec3(0.30, 0.24, 0.02), 0.75 * smoothstep(0.03, 0.35, bile) * (1.0 - film));
  float lies = max(smoothstep(0.08, 0.45, w), smoothstep(0.08, 0.45, bile));
  vec3 pool = normalize(mix(smoothN, vec3(0, 0, 1), deep * 0.7) - vec3(slope, 0.0));
  n = normalize(mix(n, pool, lies * 0.92));
  rough = mix(rough, 0.30, lies);
  wet = mix(wet, 2.2, lies);
}
