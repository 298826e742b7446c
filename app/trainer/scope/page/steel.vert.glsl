attribute float stuff;  // 0 black sleeve, 1 steel, 2 toothed inside of a jaw, 3 gauze, 4 titanium
uniform mat4 uPlace;
varying vec3 vPlace, vNormal, vOwn;
varying float vStuff;
void main() {
  vec4 p = uPlace * vec4(position, 1.0);
  vPlace = p.xyz;
  vNormal = normalize(mat3(uPlace) * normal);
  vOwn = position;
  vStuff = stuff;
  gl_Position = projectionMatrix * modelViewMatrix * p;
}
