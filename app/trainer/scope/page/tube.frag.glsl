// A tube's serosa: fine vessels, flecks of fat, loose fibres left on it, and what has bled over it.
varying vec3 vAlong;
varying vec2 vOn;
varying float vRim, vOnto;
varying vec2 vSide;
varying vec4 vGap;
uniform vec3 uColor, uDeep;
uniform vec4 uOnto;
uniform vec4 uLook;     // vessels, bumps, roughness, wetness
uniform vec2 uCoat;     // loose fibres, and fat
uniform vec4 uWell[4];  // where blood flows out: place, and mm^3/s; below zero: bile
void main() {
  if (outside()) { gl_FragColor = vec4(0.0, 0.0, 0.0, 1.0); return; }
  // Nothing spans the gap between torn ends.
  if (min(abs(vSide.x), abs(vSide.y)) < 0.999) discard;
  vec4 f = field(vPlace);
  vec3 n = normalize(vNormal);
  if (!gl_FrontFacing) n = -n;
  vec3 smoothN = n, round = normalize(cross(n, vAlong));
  vec2 uv = vOn / 34.0;
  vec4 t = texture2D(uNoise, uv), t2 = texture2D(uNoise, uv * 3.3 + 0.4), t3 = NOISE(uv.yx * vec2(2.0, 0.8), t2.gbra);
  vec3 base = mix(mix(uColor, uDeep, 0.75 * smoothstep(0.35, 0.75, t.r)), uOnto.rgb, vOnto) * (0.84 + 0.34 * t2.r);
  // Where it goes on as another under fat, peritoneum and lobules lie on it.
  float veil = f.r * smoothstep(0.42, 0.78, pow(vOnto, 0.25) + 0.5 * (t.g - 0.5) + 0.3 * (t2.r - 0.5));
  base = mix(base, mix(vec3(0.56, 0.28, 0.15), vec3(0.84, 0.56, 0.24), t.g), 0.9 * veil);
  base = mix(base, vec3(0.45, 0.03, 0.025), uLook.x * (0.75 * t.a + 0.65 * t2.a));
  base = mix(base, vec3(0.80, 0.66, 0.56), uCoat.x * smoothstep(0.45, 0.85, t3.b) * smoothstep(0.40, 0.6, t.r));
  float fleck = uCoat.y * smoothstep(0.52, 0.66, t2.r * 0.6 + t.g * 0.4) * smoothstep(0.45, 0.60, t3.r);
  base = mix(base, vec3(0.80, 0.50, 0.17), 0.85 * fleck);
  n = bumped(n, uv * 1.6, vAlong, round, vec2(0.8, 0.35), uLook.y * 1.3 + fleck);
#ifndef PLAIN
  n = bumped(n, uv * 6.0, vAlong, round, vec2(1.0, 0.15), uLook.y * 0.65);
#endif
  float rough = uLook.z, wet = uLook.w, blood = 0.0, bile = 0.0;
  for (int k = 0; k < 4; k++) if (uWell[k].w != 0.0) {
    vec3 d = vPlace - uWell[k].xyz;
    float r = 1.0 + 0.8 * pow(abs(uWell[k].w), 0.25);
    float stain = 0.5 * (1.0 - smoothstep(0.45 * r, r, length(d * vec3(1, 1, d.z < 0.0 ? 0.45 : 1.2)) + 1.5 * (t2.r - 0.5)));
    if (uWell[k].w > 0.0) blood = max(blood, stain); else bile = max(bile, stain);
  }
  base = mix(base, vec3(0.42, 0.035, 0.03), smoothstep(0.55, 0.0, vRim + 0.25 * (t2.r - 0.5)));
  // A nick: raw at its edge, dark within.
  for (int k = 0; k < 2; k++) {
    vec2 gap = k == 0 ? vGap.xy : vGap.zw;
    float open = abs(gap.x) + 0.15 * (t2.r - 0.5) - sqrt(max(1.0 - gap.y, 0.0));
    base = mix(base, mix(vec3(0.05, 0.004, 0.003), vec3(0.50, 0.05, 0.04), smoothstep(-0.75, -0.1, open)), smoothstep(0.12, -0.05, open));
  }
  if (!gl_FrontFacing) base *= 0.35;
  soak(base, rough, wet, n, smoothN, blood, bile, t2.r, vec2(0.0));
  float below = mix(0.50, 1.0, smoothstep(-0.9, 0.15, smoothN.z));
  gl_FragColor = vec4(camera(lit(n, base, vec3(0.30, 0.17, 0.11), rough, wet, below)), 1.0);
}
