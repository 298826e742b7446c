// A dot that faces the lens, at the middle of a strand.
attribute vec2 place;
attribute float strand;
varying vec3 vPlace, vNormal;
varying vec2 vOn;
varying float vParted;
void main() {
  vec4 a = end(2.0 * strand), b = end(2.0 * strand + 1.0);
  vPlace = mix(a.xyz, b.xyz, 0.5);
  vNormal = vec3(0.0, 0.0, 1.0);
  vOn = place;
  vParted = b.w;
  gl_Position = projectionMatrix * (modelViewMatrix * vec4(vPlace, 1.0) + vec4(0.28 * place, 0.0, 0.0));
}
