varying vec2 vOn;
void main() {
  float d = min(abs(vOn.x), abs(vOn.y));
  if (outside() || d > 0.6 || length(vOn) > 1.7) discard;
  gl_FragColor = drawnLine(d);
}
