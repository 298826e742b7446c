varying vec2 vOn;
void main() {
  float d = min(abs(vOn.x), abs(vOn.y));
  if (outside() || d > 0.4 || length(vOn) > 1.7) discard;
  gl_FragColor = d < 0.18 ? vec4(0.75, 1.0, 1.0, 0.95) : vec4(0.0, 0.05, 0.1, 0.5);
}
