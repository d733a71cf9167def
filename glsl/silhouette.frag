#version 460
layout(location = 0) in float depth;
layout(location = 0) out vec2 texel;

void main() {
    texel = vec2(depth, -depth); // blending keeps the largest: farthest depth, and nearest with its sign turned
}
