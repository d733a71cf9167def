#version 460
// Draws a lit vertex: emission plus radiosity, both as radiance in linear Rec.709.
layout(location = 0) in vec3 position;
layout(location = 1) in vec3 emission;
layout(location = 2) in vec4 radiosity;
#if PAINTED
layout(location = 3) in vec3 paint; // texture coordinates and tint
layout(location = 1) out vec3 light;
layout(location = 2) out vec2 uv;
#include "paint.glsl"
#endif
#if GLOSS
layout(location = 3) out vec3 tint;
layout(binding = 1) uniform textureBuffer vertices;
#include "gloss_vertex.glsl"
#endif
layout(location = 0) out vec4 radiance; // w: 1

layout(push_constant) uniform Push {
    mat4 clip_from_object;
    vec4 emission_white; // radiance factor; w = radiance that is shown as white
    float tag;           // number of the entity, for outlines
#if GLOSS
    uint entity;         // the entity
#endif
} push;

void main() {
    radiance = vec4(push.emission_white.rgb * emission, 1.0);
#if PAINTED
    light = radiosity.rgb * tint_of(paint);
    uv = paint.xy;
#if GLOSS
    tint = tint_of(paint);
    pass_gloss(push.entity, uint(gl_VertexIndex));
#endif
#else
    radiance.rgb += radiosity.rgb;
#endif
    // Precise, so that what another pipeline draws again lies at the same depth.
    precise vec4 place = push.clip_from_object * vec4(position, 1.0);
    gl_Position = place;
}
