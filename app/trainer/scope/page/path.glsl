// The path along which the wheel leads a tip into a ring: back from the ring along the shaft.
uniform vec3 uPlace, uBack, uTips[2];
uniform float uHand;
attribute vec2 place;
varying vec3 vPlace, vNormal;
varying vec2 vOn;
const float LONGEST = 18.0, SEEN = 0.8;
// How far along it is as deep in the picture as the tip is, mm; no further than is seen of it.
float begins(vec4 ring, vec3 back) {
  vec4 tip = modelViewMatrix * vec4(uHand < 0.5 ? uTips[0] : uTips[1], 1.0);
  float far = min((tip.z - ring.z) / (abs(back.z) > 0.2 ? back.z : back.z < 0.0 ? -0.2 : 0.2), LONGEST);
  for (int k = 0; k < 12; k++) {
    vec4 at = projectionMatrix * (ring + vec4(far * back, 0.0));
    at.x *= projectionMatrix[1][1] / projectionMatrix[0][0];
    if (length(at.xy) > SEEN * at.w) far -= LONGEST / 12.0;
  }
  return far;
}
