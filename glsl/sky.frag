#version 460
#include "finish.glsl"
// Distant light where nothing has been drawn. A twin: src/asset/backdrop.rs.
layout(binding = 0) uniform sampler2D map; // rows start at +y, columns at +z and go on over -x
layout(location = 0) out vec4 color;

layout(push_constant) uniform Push {
    vec4 corner_scale; // direction at the picture's upper left corner, map's axes; w = radiance that 1 stands for
    vec4 across_white; // its change for a pixel to the right; w = radiance that is shown as white
    vec4 down;         // for a pixel down
} push;

void main() {
    vec3 toward = push.corner_scale.xyz + gl_FragCoord.x * push.across_white.xyz + gl_FragCoord.y * push.down.xyz;
    vec2 place = vec2(0.5 + atan(toward.x, -toward.z) / (2.0 * PI), 0.5 - atan(toward.y, length(toward.xz)) / PI);
    // The horizon divides sky from ground: rows are not mixed across it.
    float rim = 0.5 / float(textureSize(map, 0).y);
    place.y = toward.y > 0.0 ? min(place.y, 0.5 - rim) : max(place.y, 0.5 + rim);
    vec3 radiance = push.corner_scale.w * textureLod(map, place, 0.0).rgb;
    color = vec4(finish(radiance, push.across_white.w), 1.0);
}
