#version 460
#extension GL_EXT_control_flow_attributes : require
// Draws a lit vertex: emission plus radiosity, both as radiance in linear Rec.709.
layout(location = 0) in vec3 position;
layout(location = 1) in vec3 emission;
layout(location = 2) in vec4 radiosity;
#if PAINTED || PIXEL
layout(location = 1) out vec3 light;
#endif
#if PAINTED
layout(location = 3) in vec3 paint; // texture coordinates and tint
layout(location = 2) out vec2 uv;
layout(location = 3) out vec3 tint;
#include "paint.glsl"
#endif
#if PIXEL
layout(location = 4) out float edge; // whether a shadow's edge comes near
#endif
#if GLOSS
layout(binding = 1) uniform textureBuffer vertices;
#include "gloss_vertex.glsl"
#endif
layout(location = 0) out vec4 radiance; // w: 1

layout(push_constant) uniform Push {
    mat4 clip_from_object;
    vec4 emission_white; // radiance factor; w = radiance that is shown as white
    float tag;           // number of the entity, for outlines
    uint entity;         // the entity
} push;

void main() {
    radiance = vec4(push.emission_white.rgb * emission, 1.0);
#if PAINTED || PIXEL
    light = radiosity.rgb;
#else
    radiance.rgb += radiosity.rgb;
#endif
#if PAINTED
    uv = paint.xy;
    tint = tint_of(paint);
#endif
#if PIXEL
    edge = radiosity.w;
#endif
#if GLOSS
    pass_gloss(push.entity, uint(gl_VertexIndex));
#endif
    gl_Position = push.clip_from_object * vec4(position, 1.0);
}
