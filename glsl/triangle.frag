#version 460
#extension GL_EXT_control_flow_attributes : require
#include "finish.glsl"
#include "blend.glsl"
#include "centroid.glsl"
// Shades a point of a triangle that a shadow's edge comes near. Its pixel evaluates sharp lights itself; cosines and
// self-visibility are blended between the vertices, so that where nothing blocks a light the triangle looks as its
// neighbours do.
layout(location = 0) centroid in vec3 at;     // object's frame, metres
layout(location = 1) centroid in vec3 weights;
layout(location = 2) flat in uvec3 triangle;
layout(location = 3) centroid in vec3 emission;
#if PAINTED
layout(location = 4) in vec2 uv;
layout(location = 5) centroid in vec3 tint;
layout(binding = 12) uniform sampler2D picture;
#include "holes.glsl"
#endif
layout(location = 0) out vec4 color; // alpha: the entity's tag

layout(binding = 1) uniform textureBuffer radiosity; // of every vertex of the scene
layout(binding = 8) uniform textureBuffer vertices;
#include "triangle_push.glsl"
#define FACINGS 3
#include "pixel_light.glsl"
#if GLOSS
#include "gloss_pixel.glsl"
#endif

void main() {
    uvec3 lit = push.first + triangle;
    float within = within_triangle(weights.x + weights.y + weights.z);
#if PAINTED
    vec4 texel = texture(picture, uv);
    cut_holes(texel.a, push.paint.w);
    vec3 reflectance = push.paint.rgb * texel.rgb * within * tint;
#else
    vec3 reflectance = vec3(1.0);
#endif
    vec3 weight = within * weights;
    vec3 light = blend(radiosity, lit, weight);
#if GLOSS
    vec4 share = vertex_shares(within);
#endif
    uint nearest = triangle[weight.x >= max(weight.y, weight.z) ? 0 : weight.y >= weight.z ? 1 : 2];
    uvec2 chain = chain_of(push.cluster_first, nearest);
    bool own_maps = (chain.y & OWN_MAPS) != 0;
    chain.y &= ~OWN_MAPS;
    if (chain.y > 0 && has_edge(lit)) {
        Entity receiver = ENTITY(push.receiver);
        Facing facings[FACINGS];
        [[unroll]] for (uint i = 0; i < FACINGS; i++) {
            int vertex = int(2 * (push.vertex_first + triangle[i]));
            vec3 normal = texelFetch(vertices, vertex + 1).xyz;
            facings[i] = facing_of(receiver, normal, weight[i], push.self_first, triangle[i]);
#if SELF
            facings[i].aside = receiver.scale * to_world(receiver, texelFetch(vertices, vertex).xyz - within * at);
            facings[i].counts = !own_maps || triangle[i] / WORKGROUP == nearest / WORKGROUP;
#endif
        }
#if GLOSS && HIGHLIGHTS
        shown_lights = gloss_entity_at(push.receiver).lights;
#endif
        light = blend(soft, lit, weight) + pixel_light(receiver, within * at, facings, chain);
#if GLOSS && HIGHLIGHTS
        share = shown_shares;
#endif
    }
#if GLOSS
    vec3 base = reflectance * gloss_entity_at(push.receiver).albedo;
    light = glossy(push.receiver, base, reflectance * light, share, uv, within);
    reflectance = vec3(1.0);
    vec3 glowing = glow(push.receiver, within * push.emission_white.rgb * emission, push.emission_white.rgb, uv);
#else
    vec3 glowing = within * push.emission_white.rgb * emission;
#endif
    color = vec4(finish(glowing + reflectance * light, push.emission_white.w), push.tag);
}
