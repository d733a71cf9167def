#version 460
#extension GL_EXT_samplerless_texture_functions : require
#include "srgb.glsl"
// Converts a linear picture to display colours.
layout(binding = 0) uniform texture2D picture;
layout(location = 0) out vec4 color;

layout(push_constant) uniform Push {
    float gain;  // factor on radiance: 1 / white
    uint encode; // 1: the target does not encode sRGB by itself
} push;

void main() {
    vec3 linear = clamp(push.gain * texelFetch(picture, ivec2(gl_FragCoord.xy), 0).rgb, 0.0, 1.0);
    color = vec4(push.encode != 0 ? srgb_from_linear(linear) : linear, 1.0);
}
