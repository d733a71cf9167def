#version 460
#extension GL_EXT_samplerless_texture_functions : require
// What reversed depth leaves of 1.
layout(binding = 0) uniform texture2D depth;
layout(location = 0) out float far;

void main() {
    far = 1.0 - texelFetch(depth, ivec2(gl_FragCoord.xy), 0).x;
}
