#version 460
#extension GL_EXT_control_flow_attributes : require
#extension GL_EXT_samplerless_texture_functions : require
#include "finish.glsl"
#include "centroid.glsl"
#if PAINTED
#include "textured.glsl"
#endif
layout(location = 0) centroid in vec4 radiance; // w: 1
layout(location = 0) out vec4 color; // alpha: the entity's tag
#if PAINTED || PIXEL
layout(location = 1) centroid in vec3 light; // of a surface of the mean reflectance
#endif
#if PAINTED
layout(location = 2) in vec2 uv;
layout(location = 3) centroid in vec3 tint;
layout(binding = 0) uniform sampler2D picture;
#include "holes.glsl"
#endif
#if PIXEL
layout(location = 4) centroid in float edge;
#include "shown_light.glsl"
#endif
#if GLOSS
#if HIGHLIGHTS
#include "merge_layout.glsl"
const uint NONE = 0xffffffffu;
#define ENTITY_BINDING GLOSS_BINDING + 8
#include "entities.glsl"
#include "sub_light.glsl"
#endif
#include "gloss_pixel.glsl"
#endif

layout(push_constant) uniform Push {
    mat4 clip_from_object;
    vec4 emission_white; // w = radiance that is shown as white
    float tag; // opacity if OVER
    uint entity;
#if PAINTED
    vec4 paint; // factor on the picture; least alpha
#endif
} push;

void main() {
    float within = within_triangle(radiance.w);
    vec3 shown = within * radiance.rgb;
    float alpha = push.tag;
    vec4 light_shares = vec4(0.0);
#if GLOSS
    light_shares = vertex_shares(within);
#endif
#if PAINTED || PIXEL
    vec3 lit = within * light;
#endif
#if PIXEL
    find_light(push.entity, edge > 0.0, lit, light_shares);
#endif
#if PAINTED
    vec4 texel = textured(picture, uv);
    cut_holes(texel.a, push.paint.w);
    vec3 over_mean = push.paint.rgb * texel.rgb;
#if OVER
    if (texel.a < 0.004) {
        discard;
    }
    over_mean *= texel.a;
    alpha *= texel.a;
#endif
    over_mean *= within * tint;
#if GLOSS
    vec3 base = over_mean * gloss_entity_at(push.entity).albedo;
    shown = glow(push.entity, shown, push.emission_white.rgb, uv);
    shown += glossy(push.entity, base, over_mean * lit, light_shares, uv, within);
#else
    shown += over_mean * lit;
#endif
#elif PIXEL
    shown += lit;
#endif
    color = vec4(finish(shown, push.emission_white.w), alpha);
}
