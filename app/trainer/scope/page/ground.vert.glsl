// Height fields and other sheets that come with their normals.
attribute float cover;
attribute vec2 aside;  // mm, of what is seen on it from where it would lie on a plane
varying vec3 vPlace, vNormal;
varying float vCover;
varying vec2 vOn;
#ifndef PLAIN
uniform int uRods;
uniform vec4 uRodFrom[8], uRodTo[8];
#endif
void main() {
  vPlace = position;
  vNormal = normal;
#ifndef PLAIN
  // Shafts and jaws that touch it press it in.
  float dent = 0.0;
  vec2 aside = vec2(0.0);
  for (int m = 0; m < 8; m++) {
    if (m >= uRods) break;
    vec3 d = uRodTo[m].xyz - uRodFrom[m].xyz, w = position - uRodFrom[m].xyz;
    w -= clamp(dot(w, d) / dot(d, d), 0.0, 1.0) * d;
    float off = max(length(w) - uRodFrom[m].w, 0.0), here = 1.6 * exp(-0.25 * off * off);
    if (here > dent) { dent = here; aside = w.xy / max(length(w), 0.3); }
  }
  vPlace.z -= dent;
  vNormal.xy -= 0.35 * dent * aside;
#endif
  vCover = cover;
  vOn = position.xy + aside;
  gl_Position = projectionMatrix * (modelViewMatrix * vec4(vPlace, 1.0));
}
