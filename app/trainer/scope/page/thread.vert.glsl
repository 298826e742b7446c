// A single fibre, a ribbon that faces the lens; parted it leaves two stubs that shrink and curl.
attribute vec2 place;
attribute vec2 strand;  // its number, and a seed
uniform vec3 uEye;
varying vec3 vPlace, vNormal;
varying vec2 vState, vOn;
void main() {
  vec4 a = end(2.0 * strand.x), b = end(2.0 * strand.x + 1.0);
  float t = place.y, seed = strand.y, keep = mix(1.0, 0.22 + 0.2 * hash(seed), b.w);
  float tt = t < 0.5 ? t * keep : 1.0 - (1.0 - t) * keep, middle = 1.0 - abs(2.0 * t - 1.0);
  tt = -0.05 + 1.1 * tt;
  float slack = clamp(-a.w, 0.0, 0.5) + 0.05, len = length(a.xyz - b.xyz);
  vec3 along = normalize(b.xyz - a.xyz + 1e-4);
  vec3 off = (vec3(hash(seed), hash(seed + 1.0), hash(seed + 2.0)) - 0.5) * len * 4.8 * slack * tt * (1.0 - tt);
  off += b.w * (vec3(hash(seed + 4.0), hash(seed + 5.0), 0.2) - 0.5) * 1.6 * middle;
  vec3 p = mix(a.xyz, b.xyz, tt) + off, v = normalize(uEye - p), s = normalize(cross(along, v));
  float wide = (0.025 + 0.05 * hash(seed + 7.0)) * (0.6 + 1.4 * pow(1.0 - middle, 3.0)) * (1.0 - 0.7 * b.w * middle);
  p += s * wide * (2.0 * place.x - 1.0);
  vPlace = p;
  vNormal = normalize(v + 0.7 * s * (2.0 * place.x - 1.0));
  vState = vec2(a.w, b.w);
  vOn = place;
  gl_Position = projectionMatrix * (modelViewMatrix * vec4(p, 1.0));
}
