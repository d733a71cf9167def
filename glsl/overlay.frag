#version 460
#extension GL_EXT_samplerless_texture_functions : require
// A pixel of the overlay: its colour times that of a texture, between four texels.
layout(binding = 0) uniform texture2D image;
layout(location = 0) in vec4 color;
layout(location = 1) in vec2 texture_place;
layout(location = 0) out vec4 shown;

layout(push_constant) uniform Push {
    vec2 size;   // of the target, points
    uint encode; // 1: the target does not encode sRGB by itself
} push;

vec4 texel(ivec2 at) {
    return texelFetch(image, clamp(at, ivec2(0), textureSize(image, 0) - 1), 0);
}

void main() {
    vec2 at = texture_place * vec2(textureSize(image, 0)) - 0.5;
    ivec2 first = ivec2(floor(at));
    vec2 share = at - vec2(first);
    vec4 above = mix(texel(first), texel(first + ivec2(1, 0)), share.x);
    vec4 below = mix(texel(first + ivec2(0, 1)), texel(first + ivec2(1, 1)), share.x);
    shown = color * mix(above, below, share.y);
    if (push.encode != 0) {
        shown.rgb = pow(shown.rgb, vec3(1.0 / 2.2));
    }
}
