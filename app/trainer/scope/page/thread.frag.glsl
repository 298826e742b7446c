varying vec2 vState, vOn;
void main() {
  if (outside() || (vState.y > 0.5 && abs(vOn.y - 0.5) < 0.10)) discard;
  float taut = clamp(vState.x, 0.0, 1.0);
  vec3 base = mix(vec3(0.60, 0.30, 0.20), vec3(0.84, 0.66, 0.56), taut);
  vec3 c = lit(normalize(vNormal), base, vec3(0.6, 0.45, 0.35), 0.3, 0.8, 1.0);
  gl_FragColor = vec4(camera(c), mix(0.28, 0.75, taut) * smoothstep(0.0, 0.15, vOn.y) * smoothstep(1.0, 0.85, vOn.y));
}
