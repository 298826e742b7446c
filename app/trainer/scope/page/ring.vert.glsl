// A ring that faces the lens, where jaws are asked for, with a bar as they are to part.
uniform vec3 uPlace, uAlong;
attribute vec2 place;
varying vec3 vPlace, vNormal;
varying vec2 vOn, vAlong;
void main() {
  vPlace = uPlace;
  vNormal = vec3(0.0, 0.0, 1.0);
  vOn = 5.0 * place;
  vAlong = (modelViewMatrix * vec4(uAlong, 0.0)).xy;
  gl_Position = projectionMatrix * (modelViewMatrix * vec4(uPlace, 1.0) + vec4(vOn, 0.0, 0.0));
}
