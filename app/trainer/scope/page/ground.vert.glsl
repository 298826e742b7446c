// Height fields and other sheets that come with their normals.
attribute float cover;
varying vec3 vPlace, vNormal;
varying float vCover;
void main() {
  vPlace = position;
  vNormal = normal;
  vCover = cover;
  gl_Position = projectionMatrix * (modelViewMatrix * vec4(position, 1.0));
}
