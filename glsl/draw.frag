#version 460
#include "finish.glsl"
#include "centroid.glsl"
layout(location = 0) centroid in vec4 radiance; // w: 1
layout(location = 0) out vec4 color; // alpha: the entity's tag

layout(push_constant) uniform Push {
    mat4 clip_from_object;
    vec4 emission_white; // w = radiance that is shown as white
    float tag;
} push;

void main() {
    color = vec4(finish(within_triangle(radiance.w) * radiance.rgb, push.emission_white.w), push.tag);
}
