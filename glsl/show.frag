#version 460
#extension GL_EXT_samplerless_texture_functions : require
// A linear picture as a display shows it.
layout(binding = 0) uniform texture2D picture;
layout(location = 0) out vec4 color;

layout(push_constant) uniform Push {
    float gain;  // what radiance is multiplied by: 1 / white
    uint encode; // 1: the target does not encode sRGB by itself
} push;

void main() {
    vec3 linear = clamp(push.gain * texelFetch(picture, ivec2(gl_FragCoord.xy), 0).rgb, 0.0, 1.0);
    if (push.encode != 0) {
        // IEC 61966-2-1
        vec3 curve = 1.055 * pow(linear, vec3(1.0 / 2.4)) - 0.055;
        linear = mix(curve, 12.92 * linear, lessThanEqual(linear, vec3(0.0031308)));
    }
    color = vec4(linear, 1.0);
}
