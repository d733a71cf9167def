#version 460
// A corner of the overlay's triangles. Colours are blended as light where the target encodes sRGB by itself.
layout(location = 0) in vec2 position; // points from the upper left
layout(location = 1) in vec2 place;    // in the texture, 0 to 1
layout(location = 2) in vec4 srgb;     // premultiplied by alpha
layout(location = 0) out vec4 color;
layout(location = 1) out vec2 texture_place;

layout(push_constant) uniform Push {
    vec2 size;   // of the target, points
    uint encode; // 1: the target does not encode sRGB by itself
} push;

void main() {
    color = vec4(pow(srgb.rgb, vec3(2.2)), srgb.a);
    texture_place = place;
    gl_Position = vec4(2.0 * position / push.size - 1.0, 0.0, 1.0);
}
