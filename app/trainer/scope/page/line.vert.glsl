void main() {
  vec4 ring = modelViewMatrix * vec4(uPlace, 1.0);
  vec3 back = (modelViewMatrix * vec4(uBack, 0.0)).xyz;
  float far = clamp(begins(ring, back), 8.0, 40.0), on = mix(2.0, far, 0.5 + 0.5 * place.y);
  vec4 a = ring + vec4(2.0 * back, 0.0), b = ring + vec4(far * back, 0.0);
  vec2 along = b.xy / b.z - a.xy / a.z;
  vOn = vec2(0.5 * place.x, on);
  vPlace = uPlace;
  vNormal = vec3(0.0, 0.0, 1.0);
  vec4 at = ring + vec4(on * back, 0.0);
  at.xy += vOn.x * vec2(-along.y, along.x) / max(length(along), 1e-6);
  gl_Position = projectionMatrix * at;
}
