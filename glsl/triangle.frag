#version 460
#extension GL_EXT_control_flow_attributes : require
#include "blend.glsl"
// Evaluates sharp lights on a pixel of a triangle. Cosines and self-visibility are blended between the vertices, so that
// where nothing blocks a light the triangle looks as its neighbours do.
layout(location = 0) in vec3 at;      // object's frame, metres
layout(location = 1) in vec3 weights;
layout(location = 2) flat in uvec3 triangle;
layout(location = 0) out uvec4 kept;
#if HOLES
layout(location = 3) in vec2 uv;
layout(binding = 12) uniform sampler2D picture;
#include "holes.glsl"
#endif

layout(binding = 1) uniform textureBuffer radiosity; // of every vertex of the scene
layout(binding = 8) uniform textureBuffer vertices;
#include "triangle_push.glsl"
#define FACINGS 3
#include "pixel_light.glsl"

void main() {
#if HOLES
    cut_holes(texture(picture, uv).a, push.alpha_cutoff);
#endif
    uvec3 lit = push.first + triangle;
    Entity receiver = ENTITY(push.receiver);
    uint nearest = triangle[weights.x >= max(weights.y, weights.z) ? 0 : weights.y >= weights.z ? 1 : 2];
    uvec2 chain = chain_of(push.cluster_first, nearest);
    bool own_maps = (chain.y & OWN_MAPS) != 0;
    chain.y &= ~OWN_MAPS;
    Facing facings[FACINGS];
    [[unroll]] for (uint i = 0; i < FACINGS; i++) {
        int vertex = int(2 * (push.vertex_first + triangle[i]));
        vec3 normal = texelFetch(vertices, vertex + 1).xyz;
        facings[i] = facing_of(receiver, normal, weights[i], push.self_first, triangle[i]);
#if SELF
        facings[i].aside = receiver.scale * to_world(receiver, texelFetch(vertices, vertex).xyz - at);
        facings[i].counts = !own_maps || triangle[i] / WORKGROUP == nearest / WORKGROUP;
#endif
    }
    use_vertices(lit, weights);
    kept = pixel_light(receiver, at, facings, chain);
}
