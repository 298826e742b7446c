// What all fragments share: one lamp beside the lens, its shadows, and the camera's own colours.
precision highp float;
uniform vec3 uEye, uLamp, uAxis;
uniform float uGain;
uniform sampler2D uNoise, uSlopes, uField;
uniform vec4 uBox;       // of the field: its corner, and its sizes, mm
uniform vec3 uRound;     // of the picture, in its dots: middle and radius
uniform int uRods;
uniform vec4 uRodFrom[8], uRodTo[8];  // ends of shafts and jaws, and their radii, mm
varying vec3 vPlace, vNormal;

bool outside() { return distance(gl_FragCoord.xy, uRound.xy) > uRound.z; }

// The picture of noise at a place of it. The plain look takes `seen`, a part that it has already.
#ifdef PLAIN
#define NOISE(uv, seen) seen
#else
#define NOISE(uv, seen) texture2D(uNoise, uv)
#endif

// Cover of the sheet, blood, 2 mm as 1, darkness of the cavity, and bile, of a place.
vec4 field(vec3 p) { return texture2D(uField, (p.xy - uBox.xy) / uBox.zw); }

// Light that shafts and jaws keep off: dark where they touch, and their shadow away from the lamp.
float rodShade(vec3 p) {
#ifdef PLAIN
  return 1.0;
#else
  float shade = 1.0;
  vec3 ray = uLamp - p;
  for (int m = 0; m < 8; m++) {
    if (m >= uRods) break;
    float r = uRodFrom[m].w;
    vec3 from = uRodFrom[m].xyz, d = uRodTo[m].xyz - from, w = p - from;
    float dd = dot(d, d), h = clamp(dot(w, d) / dd, 0.0, 1.0);
    shade *= mix(0.35, 1.0, smoothstep(-0.3, 1.6 * r, length(w - h * d) - r));
    float rr = dot(ray, ray), b = dot(ray, d), c = dot(ray, w), e = dot(d, w);
    float t = clamp((b * e - c * dd) / max(rr * dd - b * b, 1e-4), 0.02, 1.0);
    float q = clamp((b * t + e) / dd, 0.0, 1.0);
    t = clamp((b * q - c) / rr, 0.0, 1.0);
    float near = length(w + t * ray - q * d), soft = 0.25 * r + 0.10 * t * sqrt(rr);
    shade *= 1.0 - 0.62 * smoothstep(0.01, 0.05, t) * (1.0 - smoothstep(r - 0.4 * soft, r + soft, near));
  }
  return shade;
#endif
}

// Trowbridge and Reitz's distribution of facets.
float gloss(float nh, float rough) {
  float a = rough * rough, q = nh * nh * (a * a - 1.0) + 1.0;
  return a * a / (3.1416 * q * q);
}

// The camera's knee (Narkowicz's fit of the ACES curve) and sRGB's gamma.
vec3 camera(vec3 c) {
  c = 1.05 * max(c, 0.0);
  c = (c * (2.51 * c + 0.03)) / (c * (2.43 * c + 0.59) + 0.14);
#ifdef PLAIN
  return sqrt(clamp(c, 0.0, 1.0));
#else
  return pow(clamp(c, 0.0, 1.0), vec3(1.0 / 2.2));
#endif
}

float fallOff(float d, float along) { return uGain * 3600.0 / (d * d + 150.0) * smoothstep(0.60, 0.96, along); }

// Wet flesh under the lamp: light goes further round an edge the redder it is (`soft`).
vec3 lit(vec3 n, vec3 albedo, vec3 soft, float rough, float wet, float cavity) {
  vec3 l = uLamp - vPlace, v = normalize(uEye - vPlace);
  float d = length(l);
  l /= d;
  float nl = dot(n, l), nh = clamp(dot(n, normalize(l + v)), 0.0, 1.0);
  vec3 diffuse = clamp((nl + soft) / (1.0 + soft), 0.0, 1.0);
  diffuse *= diffuse * 0.45 + 0.55;
  float edge = 1.0 - clamp(dot(n, v), 0.0, 1.0), fresnel = 0.04 + 0.24 * edge * edge * edge * edge * edge;
  float shine = 0.5 * gloss(nh, rough) + 0.85 * wet * gloss(nh, 0.23);
  vec3 bounce = albedo * vec3(0.055, 0.030, 0.024) * mix(1.0, cavity, 0.6);
  float shade = rodShade(vPlace) * cavity;
  return fallOff(d, dot(-l, uAxis)) * (shade * (albedo * diffuse + fresnel * shine * max(nl, 0.0)) + bounce);
}

// A light line so far from its middle, mm: dark beside it, so that it is seen on fat and on liver.
vec4 drawnLine(float d) {
  float soft = 0.7 * fwidth(d);
  vec4 both = mix(vec4(0.75, 1.0, 1.0, 0.9), vec4(0.0, 0.05, 0.1, 0.45), smoothstep(0.22 - soft, 0.22 + soft, d));
  return vec4(both.rgb, both.a * (1.0 - smoothstep(0.45 - soft, 0.45 + soft, d)));
}
