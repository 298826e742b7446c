// A tube's wall from its nodes: a Catmull-Rom curve, the wall about it, folds, pulse, tear and dents.
attribute vec2 place;  // along it, in elements, and round it, rad
attribute vec3 wall;   // distance from the curve, mm, and its slopes along and round it
uniform sampler2D uNodes;  // row 0: place and radius; row 1: up in the cross-section
uniform float uFirst, uCount, uLump, uFold, uPulse;
uniform vec2 uTorn;  // numbers of its torn elements, -1 for none
uniform vec4 uDent[2];  // closed jaws that press on it: place, mm, and depth
varying vec3 vPlace, vNormal, vAlong;
varying vec2 vOn;
uniform vec4 uNick[2];  // walls torn part of the way: place, angle, depth (0: none), half-width
varying float vRim;  // elements to a torn end
varying vec2 vSide;  // of each torn element: -1 before it, 1 beyond it
uniform vec4 uOnto;  // colour of the tube that it goes on as, and its element there
varying float vOnto;
varying vec4 vGap;  // of both nicks: across and along them, 1 at the edge of what is open
vec4 node(float i, float row) { return texelFetch(uNodes, ivec2(int(uFirst + i), int(row)), 0); }
void main() {
  float s = place.x, low = 0.0, high = uCount - 1.0;
  vRim = 99.0;
  vSide = vec2(1.0);
  for (int k = 0; k < 2; k++) {
    float e = k == 0 ? uTorn.x : uTorn.y;
    if (e < 0.0) continue;
    float middle = e + 0.5;
    if (s < middle) { high = min(high, e + 0.38); vRim = min(vRim, e + 0.38 - s); vSide[k] = -1.0; }
    else { low = max(low, e + 0.62); vRim = min(vRim, s - e - 0.62); }
  }
  // Of a torn element each end goes on as its own piece does.
  float from = floor(low + 0.5), to = ceil(high - 0.5);
  s = clamp(s, low, high);
  float i = clamp(floor(s), from, max(from, to - 1.0)), t = s - i;
  vec4 b = node(i, 0.0), c = node(min(i + 1.0, to), 0.0);
  if (i + 1.0 > to) c = 2.0 * b - node(i - 1.0, 0.0);
  vec4 a = i - 1.0 < from ? 2.0 * b - c : node(i - 1.0, 0.0);
  vec4 d = i + 2.0 > to ? 2.0 * c - b : node(i + 2.0, 0.0);
  vec4 m = 0.5 * (2.0 * b + (c - a) * t + (2.0 * a - 5.0 * b + 4.0 * c - d) * t * t + (3.0 * b - a - 3.0 * c + d) * t * t * t);
  vec4 dm = 0.5 * ((c - a) + 2.0 * (2.0 * a - 5.0 * b + 4.0 * c - d) * t + 3.0 * (3.0 * b - a - 3.0 * c + d) * t * t);
  vec3 along = normalize(dm.xyz), up = mix(node(i, 1.0).xyz, node(min(i + 1.0, to), 1.0).xyz, clamp(t, 0.0, 1.0));
  up = normalize(up - along * dot(up, along));
  vec3 side = cross(along, up), outward = cos(place.y) * up + sin(place.y) * side;
  float mm = s * length(dm.xyz);
  float r = wall.x * (1.0 + uPulse + uLump * (0.05 * sin(s * 2.3 + 1.7 * sin(place.y)) + 0.04 * sin(place.y * 2.0 + s * 1.1)));
  // The spiral valves of a cystic duct.
  r *= 1.0 + uFold * 0.05 * sin(2.9 * mm + place.y + 0.8 * sin(0.7 * mm));
  // A torn end shrinks together and is uneven.
  r *= 1.0 - 0.30 * smoothstep(0.7, 0.0, vRim);
  vPlace = m.xyz + r * outward;
  // A whole end is a dome: between two tubes that meet at an angle no gap is left.
  if (wall.x == 0.0 && vRim > 1.0) vPlace -= 0.8 * m.w * sign(wall.y) * along;
  vGap = vec4(9.0);
  for (int k = 0; k < 2; k++) if (uNick[k].z > 0.0) {
    // What is beyond the tear's front goes down to it.
    float front = 1.0 - 2.0 * uNick[k].z, beyond = cos(place.y - uNick[k].y) - front;
    float across = (s - uNick[k].x) / uNick[k].w, along = 1.0 - beyond / (1.0 - front);
    if (k == 0) vGap.xy = vec2(across, along); else vGap.zw = vec2(across, along);
    vPlace -= r * max(beyond, 0.0) * max(1.0 - across * across, 0.0) * (cos(uNick[k].y) * up + sin(uNick[k].y) * side);
  }
  if (vRim < 0.2) vPlace += along * 0.35 * r * sin(3.0 * place.y + 1.3) * (s > 0.5 * (low + high) ? 1.0 : -1.0);
  vec3 about = cos(place.y) * side - sin(place.y) * up;
  vNormal = normalize(outward - along * (wall.y / max(length(dm.xyz), 1e-3)) - about * (wall.z / max(wall.x, 0.05)));
  for (int k = 0; k < 2; k++) if (uDent[k].w > 0.0) {
    vec3 w = vPlace - uDent[k].xyz;
    float near = exp(-dot(w, w) / 14.0) * min(uDent[k].w, 0.45 * m.w);
    vPlace -= near * outward;
    vNormal = normalize(vNormal + 0.30 * near * normalize(w + 1e-3));
  }
  vAlong = along;
  vOnto = exp(-1.5 * abs(s - uOnto.w));
  vOn = vec2(mm, place.y * max(m.w, 0.8));
  gl_Position = projectionMatrix * (modelViewMatrix * vec4(vPlace, 1.0));
}
