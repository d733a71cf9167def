#version 460
#extension GL_EXT_control_flow_attributes : require
#extension GL_EXT_samplerless_texture_functions : require
// Evaluates sharp lights at the places of a list. Cosines and self-visibility are blended between the vertices, so that
// where nothing blocks a light a triangle looks as its neighbours do.
layout(local_size_x = 64) in;
#include "blend.glsl"
#include "merge_layout.glsl"
const uint NONE = 0xffffffffu;
layout(binding = 0) uniform utextureBuffer receivers;  // ByPixel of src/draw/pixel_light.rs
layout(binding = 1) uniform textureBuffer radiosity;   // of every vertex of the scene
#define ENTITY_BINDING 2
#include "entities.glsl"
#define NODE_BINDING 3
#include "silhouette_field.glsl"
layout(binding = 5) uniform utextureBuffer entries;
uint entry_at(uint i) {
    return texelFetch(entries, int(i)).x;
}
layout(binding = 6) uniform utextureBuffer chains; // of every cluster: first entry, and how many
layout(binding = 7) uniform textureBuffer soft;    // light on vertices without that of sharp lights
layout(binding = 8) uniform textureBuffer vertices;
#if SELF
layout(binding = 10) uniform utextureBuffer self_cells;
uvec2 self_cell(uint i) {
    return texelFetch(self_cells, int(i)).xy;
}
#include "self_visibility.glsl"
#endif
layout(push_constant) uniform Push {
    uint list;     // which of the steps' lists
    uint texel_px; // width of a place in pixels
} push;

#define FACINGS 3
#define BLENDS 1
#define SHOWN_QUADS 1 // of further lights vertices have the shares
layout(binding = 14) uniform utextureBuffer irradiances; // KeptIrradiance of all vertices by one light after another
uvec3 lit_vertices; // of the place's triangle, among all
vec3 vertex_weights;
#include "sharp_light.glsl"
#if SHOWN
layout(binding = 9) uniform utextureBuffer shown_lights_of; // of every entity
layout(binding = 15) uniform utextureBuffer shown_shares_of; // of every vertex
vec4 shares_at(uint vertex) {
    return unpackUnorm4x8(texelFetch(shown_shares_of, int(vertex)).x);
}
#endif
#include "screen_light.glsl"
#include "seen_surface.glsl"
layout(binding = 11) uniform utexture2D seen_triangles;
layout(binding = 12) uniform utexture2D seen_places;
layout(binding = 13) uniform texture2D depths;
#define WORK_BLOCK layout(std430, binding = 16) readonly buffer
#include "pixel_work.glsl"
layout(binding = 17, rgba32ui) uniform writeonly uimage2D light;

// The light of a surface: of its chain and of the rest, or where there is no chain or no edge as vertices have it.
uvec4 light_of_surface(SeenSurface seen, float depth) {
    Entity receiver = ENTITY(seen.receiver);
    uvec4 by_pixel = texelFetch(receivers, int(seen.receiver));
    uvec3 own = seen.lit - by_pixel.x; // vertices among those of the entity
    lit_vertices = seen.lit;
    vertex_weights = seen.weights;
    uint nearest = own[seen.weights.x >= max(seen.weights.y, seen.weights.z) ? 0 : seen.weights.y >= seen.weights.z ? 1 : 2];
    uvec2 chain = texelFetch(chains, int(by_pixel.y + nearest / WORKGROUP)).xy;
    bool own_maps = (chain.y & OWN_MAPS) != 0;
    chain.y = seen.edge ? chain.y & ~OWN_MAPS : 0;
    vec3 corners[FACINGS];
    vec3 at = vec3(0.0); // object's frame, metres
    [[unroll]] for (uint i = 0; i < FACINGS; i++) {
        corners[i] = texelFetch(vertices, int(2 * (by_pixel.z + own[i]))).xyz;
        at += seen.weights[i] * corners[i];
    }
    Surface surface;
    surface.position = receiver.scale * to_world(receiver, at);
    surface.origin = receiver.centre.xyz;
    surface.inverse_radius = receiver.centre.w;
    surface.step = receiver.scale * float(push.texel_px) * seen.step;
#if MAPS
    surface.ground = normalize(to_world(receiver, cross(corners[1] - corners[0], corners[2] - corners[0])));
    surface.light_maps = receiver.light_maps;
    surface.lifted = vec3(0.0);
    surface.is_round = false;
#endif
    [[unroll]] for (uint i = 0; i < FACINGS; i++) {
        vec3 normal = texelFetch(vertices, int(2 * (by_pixel.z + own[i]) + 1)).xyz;
        surface.facings[i] = facing_of(receiver, normal, seen.weights[i], by_pixel.w, own[i]);
#if MAPS
        float below = max(dot(corners[i] - at, normal), 0.0);
        surface.lifted += receiver.scale * seen.weights[i] * below * surface.facings[i].normal;
        surface.is_round = surface.is_round || dot(surface.facings[i].normal, surface.ground) < FLAT;
#endif
#if SELF
        surface.facings[i].aside = receiver.scale * to_world(receiver, corners[i] - at);
        surface.facings[i].counts = !own_maps || own[i] / WORKGROUP == nearest / WORKGROUP;
#endif
    }
#if SHOWN
    shown_lights[0] = texelFetch(shown_lights_of, int(ALL_SHOWN_QUADS * seen.receiver));
    shown_shares[0] = vertex_weights.x * shares_at(lit_vertices.x) + vertex_weights.y * shares_at(lit_vertices.y)
                 + vertex_weights.z * shares_at(lit_vertices.z);
#else
    const vec4 shown_shares[] = vec4[](vec4(0.0));
#endif
    vec3 light, rest;
    if (chain.y > 0) {
        rest = blend(soft, lit_vertices, vertex_weights);
        light = rest + sharp_sum(surface, chain.x, chain.y) * receiver.albedo;
    } else {
        light = rest = blend(radiosity, lit_vertices, vertex_weights);
    }
    bool edge = missed > tolerable_miss(receiver.albedo, rest);
    return pack_light(light_key(seen.receiver, seen.front), depth, light, shown_shares[0], edge);
}

void main() {
    uint i = 64 * (MOST_GROUPS * gl_WorkGroupID.y + gl_WorkGroupID.x) + gl_LocalInvocationIndex;
    if (i >= work.steps[push.list].count) {
        return;
    }
    uint packed = work.places[i];
    uvec2 at = uvec2(packed & 0xffff, packed >> 16);
    ivec2 pixel = ivec2(push.texel_px * at + push.texel_px / 2);
    SeenSurface seen = unpack_surface(texelFetch(seen_triangles, pixel, 0), texelFetch(seen_places, pixel, 0));
    imageStore(light, ivec2(at), light_of_surface(seen, texelFetch(depths, pixel, 0).r));
}
