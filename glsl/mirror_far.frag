#version 460
#extension GL_EXT_samplerless_texture_functions : require
// Of a texel of a mirror's picture what reversed depth leaves of 1, and whether it shows what the mirror may: where nothing
// stands beyond the mirror's own edges, as past the foot of a wall on a floor, there is no mirror to see the sky in.
layout(binding = 0) uniform texture2D depths;
layout(location = 0) out vec2 far;

layout(push_constant) uniform Push {
    vec4 edges[4]; // of the mirror: positive within, for places from -1 to 1 of the picture
    vec4 area;     // left, top, width and height of the picture, texels
} push;

void main() {
    float depth = texelFetch(depths, ivec2(gl_FragCoord.xy), 0).x;
    vec3 place = vec3(2.0 * (gl_FragCoord.xy - push.area.xy) / push.area.zw - 1.0, 1.0);
    bool counts = true;
    for (int i = 0; i < 4; i++) {
        counts = counts && dot(push.edges[i].xyz, place) >= 0.0;
    }
    far = vec2(1.0 - depth, depth > 0.0 || counts ? 1.0 : 0.0);
}
