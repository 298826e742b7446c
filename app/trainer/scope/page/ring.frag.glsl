varying vec2 vOn, vAlong;
// How far a dot is from the line of a ring and of a bar on either side of it, mm.
float off(vec2 on) {
  float ring = abs(length(on) - 2.0), size = length(vAlong);
  if (size < 0.2) return ring;
  vec2 along = vAlong / size;
  float far = abs(dot(on, along)), beside = abs(dot(on, vec2(-along.y, along.x)));
  return min(ring, length(vec2(beside, max(max(2.0 - far, far - 4.5), 0.0))));
}
void main() {
  float d = off(vOn);
  if (outside() || d > 0.6) discard;
  gl_FragColor = drawnLine(d);
}
