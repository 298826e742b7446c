varying vec2 vOn;
void main() {
  if (outside() || fract(0.4 * vOn.y) > 0.6) discard;
  gl_FragColor = drawnLine(abs(vOn.x));
}
