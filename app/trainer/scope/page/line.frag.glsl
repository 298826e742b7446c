varying vec2 vOn;
void main() {
  if (outside() || fract(0.4 * vOn.y) > 0.6) discard;
  gl_FragColor = abs(vOn.x) < 0.16 ? vec4(0.75, 1.0, 1.0, 0.8) : vec4(0.0, 0.05, 0.1, 0.4);
}
