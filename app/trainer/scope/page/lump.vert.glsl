// A lump of fat at the rim of what has parted: several lobules about one middle, drawn out the way
// that it hangs.
attribute vec2 place;  // on a ball: round it and from its top down, rad
attribute vec4 lump;   // its middle and radius, mm
attribute vec4 hangs;  // which way, and a seed
varying vec3 vPlace, vNormal, vOwn;
varying float vFold;  // 1 between lobules
vec3 lobe(float seed) { return normalize(vec3(hash(seed), hash(seed + 1.7), hash(seed + 3.3)) - 0.5); }
void main() {
  vec3 on = vec3(sin(place.y) * cos(place.x), sin(place.y) * sin(place.x), cos(place.y)), middle = on;
  float near = 0.0;
  for (int k = 0; k < 5; k++) {
    vec3 each = lobe(hangs.w + 7.0 * float(k));
    float d = dot(on, each);
    if (d > near) { near = d; middle = each; }
  }
  float dome = near * near * near;
  vec3 own = on * (0.66 + 0.42 * dome), n = normalize(on - 1.26 * near * near * (middle - on * near));
  // Longer the way that it hangs.
  vPlace = lump.xyz + lump.w * (own + 0.55 * hangs.xyz * dot(own, hangs.xyz));
  vNormal = normalize(n - 0.35 * hangs.xyz * dot(n, hangs.xyz));
  vOwn = lump.w * own + hangs.w;
  vFold = 1.0 - smoothstep(0.25, 0.7, dome);
  gl_Position = projectionMatrix * (modelViewMatrix * vec4(vPlace, 1.0));
}
