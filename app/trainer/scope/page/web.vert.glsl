// A film between two strands: taut it is plane, slack it sags and waves, parted it draws back.
attribute vec2 place;
attribute vec4 film;  // its strands, and a seed of each
attribute vec2 gone;  // part of the strands under either half that has parted
varying vec3 vPlace, vNormal;
varying vec2 vOn;
varying vec4 vState;
varying float vWide, vSeed;
vec3 along(vec4 a, vec4 b, float t, float seed) {
  float slack = clamp(-a.w, 0.0, 0.5) + 0.04, len = length(a.xyz - b.xyz);
  vec3 off = vec3(hash(seed) - 0.5, hash(seed + 3.1) - 0.5, -0.5 * hash(seed + 5.7));
  return mix(a.xyz, b.xyz, t) + off * len * 0.9 * slack * 4.0 * t * (1.0 - t);
}
void main() {
  vec4 a = end(2.0 * film.x), b = end(2.0 * film.x + 1.0), c = end(2.0 * film.y), d = end(2.0 * film.y + 1.0);
  float x = place.x, t = place.y, lost = smoothstep(0.5, 1.0, mix(gone.x, gone.y, x));
  float keep = mix(1.0, 0.34, lost), tt = t < 0.5 ? t * keep : 1.0 - (1.0 - t) * keep;
  tt = -0.04 + 1.08 * tt;
  vec3 p0 = along(a, b, tt, film.z), p1 = along(c, d, tt, film.w);
  float fan = 1.0 + 0.5 * (1.0 - 4.0 * t * (1.0 - t));
  vec3 p = mix(p0, p1, 0.5 + (x - 0.5) * fan);
  vec3 n = normalize(cross(p1 - p0, mix(b.xyz - a.xyz, d.xyz - c.xyz, x)) + 1e-5);
  p += n * 1.4 * sin(6.28 * x + 9.0 * t + film.z) * (1.0 - t) * t * (1.0 - clamp(0.5 * (a.w + c.w), 0.0, 1.0));
  p.z -= 0.8 * lost * (1.0 - abs(2.0 * t - 1.0));
  vSeed = film.z;
  vWide = max(length(a.xyz - c.xyz), length(b.xyz - d.xyz));
  vOn = vec2(x, t);
  vState = vec4(a.w, c.w, gone);
  vPlace = p;
  vNormal = n;
  if (vWide > 7.0) p = vec3(0.0, 0.0, -1e4);
  gl_Position = projectionMatrix * (modelViewMatrix * vec4(p, 1.0));
}
