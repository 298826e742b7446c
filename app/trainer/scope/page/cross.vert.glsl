// A cross that faces the lens where the pointer comes to the path: from there the wheel leads in.
void main() {
  vec4 ring = modelViewMatrix * vec4(uPlace, 1.0);
  vec3 back = (modelViewMatrix * vec4(uBack, 0.0)).xyz;
  float far = begins(ring, back);
  vOn = 1.7 * place;
  vPlace = uPlace;
  vNormal = vec3(0.0, 0.0, 1.0);
  // Where the tip is in the ring, or too deep for it, there is none.
  gl_Position = far > 2.0 ? projectionMatrix * (ring + vec4(far * back, 0.0) + vec4(vOn, 0.0, 0.0)) : vec4(2.0, 2.0, 2.0, 1.0);
}
