#version 460
#include "finish.glsl"
#include "centroid.glsl"
layout(location = 0) centroid in vec4 radiance; // w: 1
layout(location = 0) out vec4 color; // alpha: the entity's tag
#if PAINTED
layout(location = 1) centroid in vec3 light; // of a surface of the mean reflectance
layout(location = 2) in vec2 uv;
layout(binding = 0) uniform sampler2D picture;
#include "holes.glsl"
#endif
#if GLOSS
layout(location = 3) centroid in vec3 tint;
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
#if GLOSS
    uint entity;
#endif
#if PAINTED
    vec4 paint; // factor on the picture; least alpha
#endif
} push;

void main() {
    float within = within_triangle(radiance.w);
    vec3 shown = radiance.rgb;
#if PAINTED
    vec4 texel = texture(picture, uv);
    cut_holes(texel.a, push.paint.w);
    vec3 over_mean = push.paint.rgb * texel.rgb;
#if OVER
    if (texel.a < 0.004) {
        discard;
    }
    over_mean *= texel.a;
    float opacity = push.tag * texel.a;
#endif
#if GLOSS
    vec3 base = over_mean * within * tint * gloss_entity_at(push.entity).albedo;
    shown = glow(push.entity, within * shown, push.emission_white.rgb, uv);
    shown += glossy(push.entity, base, over_mean * within * light, vertex_shares(within), uv, within);
#if OVER
    color = vec4(finish(shown, push.emission_white.w), opacity);
#else
    color = vec4(finish(shown, push.emission_white.w), push.tag);
#endif
    return;
#else
    shown += over_mean * light;
#endif
#endif
#if !OVER
    color = vec4(finish(within * shown, push.emission_white.w), push.tag);
#elif PAINTED
    color = vec4(finish(within * shown, push.emission_white.w), opacity);
#else
    color = vec4(finish(within * shown, push.emission_white.w), push.tag);
#endif
}
