varying vec2 vOn;
varying float vParted;
void main() {
  float off = dot(vOn, vOn);
  if (outside() || vParted > 0.0 || off > 1.0) discard;
  gl_FragColor = vec4(0.45, 0.95, 1.0, 0.45 * (1.0 - off));
}
