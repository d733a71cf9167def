#version 460
// Keeps how near to the light a surface is.
layout(location = 0) out float height;
#if HOLES
layout(location = 0) in vec2 uv;
layout(binding = 0) uniform sampler2D picture;
#include "holes.glsl"
#include "sun_map_push.glsl"
#endif

void main() {
#if HOLES
    cut_holes(texture(picture, uv).a, push.alpha_cutoff);
#endif
    height = gl_FragCoord.z;
}
