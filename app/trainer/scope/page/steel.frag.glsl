// Instruments: what they mirror is the cavity, warm below and dark above; teeth inside the jaws.
uniform float uLit;  // 1 of the hand that has made an error: it glows, most at its outline
varying float vStuff;
varying vec3 vOwn;
void main() {
  if (outside()) { gl_FragColor = vec4(0.0, 0.0, 0.0, 1.0); return; }
  vec3 n = normalize(vNormal), v = normalize(uEye - vPlace), l = uLamp - vPlace;
  float d = length(l);
  l /= d;
  float shade = 1.0;
  if (vStuff > 1.5 && vStuff < 2.5) {
    float tooth = sin(7.5 * vOwn.z);
    n = normalize(n + 0.55 * cos(7.5 * vOwn.z) * normalize(cross(n, vec3(n.y, -n.x, 0.01))));
    shade = 0.55 + 0.45 * smoothstep(-0.6, 0.5, tooth);
  }
  vec3 r = reflect(-v, n), h = normalize(l + v), c;
  float fall = fallOff(d, dot(-l, uAxis)), nl = max(dot(n, l), 0.0), nh = max(dot(n, h), 0.0);
  if (vStuff > 2.5 && vStuff < 3.5) {
    vec4 t = texture2D(uNoise, vOwn.xz / 9.0 + 0.1 * vOwn.y);
    float weave = 0.75 + 0.25 * sin(9.0 * vOwn.z) * sin(9.0 * (vOwn.x + vOwn.y));
    c = fall * vec3(0.60, 0.54, 0.47) * weave * (0.7 + 0.4 * t.r) * (0.25 + 0.75 * nl);
  } else if (vStuff > 0.5) {
    float band = 0.5 + 0.5 * sin(4.0 * r.x + 3.0 * r.y + 5.0 * r.z);
    vec3 around = mix(vec3(0.030, 0.018, 0.016), vec3(0.20, 0.17, 0.15), smoothstep(0.15, 0.95, band) * smoothstep(-0.9, 0.4, r.z));
    around += vec3(0.22, 0.09, 0.045) * smoothstep(0.0, -0.9, r.z) * 0.45;
    float dull = vStuff > 3.5 ? 1.6 : 1.0;
    c = fall * (around + vec3(0.60, 0.62, 0.66) * (0.05 * dull * nl + 0.20 * gloss(nh, 0.46) + 0.10 * gloss(nh, 0.22)));
    c *= mix(0.55, 1.0, nl) * shade;
  } else {
    c = fall * (vec3(0.012, 0.012, 0.014) * (0.4 + nl) + 0.045 * gloss(nh, 0.38) + 0.012 * gloss(nh, 0.2)
      + vec3(0.02, 0.006, 0.004) * pow(1.0 - abs(dot(n, v)), 2.0));
  }
  c += uLit * (0.10 + 0.9 * pow(1.0 - abs(dot(n, v)), 1.5));
  gl_FragColor = vec4(camera(c), 1.0);
}
