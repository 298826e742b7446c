// Colour of fat by its lobules, and by fine and wide noise.
vec3 fatOf(float lobule, float fine, float wide) {
  vec3 fat = mix(vec3(0.64, 0.31, 0.10), vec3(0.86, 0.57, 0.22), smoothstep(0.0, 0.7, lobule)) * (0.86 + 0.28 * fine);
  return mix(fat, vec3(0.62, 0.22, 0.10), 0.35 * smoothstep(0.5, 0.8, wide));
}
