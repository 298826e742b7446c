// Both ends of strands, with how taut they are (a's w) and how far they have parted (b's w).
uniform sampler2D uEnds;
vec4 end(float k) { int i = int(k + 0.5); return texelFetch(uEnds, ivec2(i & 127, i >> 7), 0); }
float hash(float x) { return fract(sin(x * 12.9898) * 43758.5453); }
