// The path along which the wheel leads a tip into a ring: back from the ring along the shaft.
uniform vec3 uPlace, uBack, uTips[2];
uniform float uHand;
attribute vec2 place;
varying vec3 vPlace, vNormal;
varying vec2 vOn;
// How far along it the plane is in which the pointer leads the tip, mm: through the tip, half-way
// between the picture's plane and that across the shaft.
float begins(vec4 ring, vec3 back) {
  vec4 tip = modelViewMatrix * vec4(uHand < 0.5 ? uTips[0] : uTips[1], 1.0);
  vec3 normal = normalize(vec3(0.0, 0.0, 1.0) + back);
  return dot(tip.xyz - ring.xyz, normal) / dot(back, normal);
}
