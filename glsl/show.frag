#version 460
#extension GL_EXT_samplerless_texture_functions : require
#include "srgb.glsl"
// A linear picture as a display shows it.
layout(binding = 0) uniform texture2D picture;
layout(location = 0) out vec4 color;

layout(push_constant) uniform Push {
    float gain;  // what radiance is multiplied by: 1 / white
    uint encode; // 1: the target does not encode sRGB by itself
} push;

void main() {
    vec3 linear = clamp(push.gain * texelFetch(picture, ivec2(gl_FragCoord.xy), 0).rgb, 0.0, 1.0);
    color = vec4(push.encode != 0 ? srgb_from_linear(linear) : linear, 1.0);
}
