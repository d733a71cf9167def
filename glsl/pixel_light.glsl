// Light of sharp lights on a pixel. The shader that includes this defines FACINGS, the number of vertices whose weighed
// light the pixel has. It binds corners of cells or triangles at 0, and the radiosity of every vertex at 1, and its push
// constants have the receiver.
#include "merge_layout.glsl"
const uint NONE = 0xffffffffu;
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
#if SELF
layout(binding = 10) uniform utextureBuffer self_cells;
uvec2 self_cell(uint i) {
    return texelFetch(self_cells, int(i)).xy;
}
#include "self_visibility.glsl"
#endif
#define BLENDS 1
#define SHOWN_QUADS 1 // of further lights vertices have the shares
layout(binding = 14) uniform textureBuffer irradiances; // of all vertices by one light after another
uvec3 lit_vertices; // of the pixel's triangle, among all
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

// Keeps the vertices of the pixel's triangle, and returns whether an edge is near one of them.
bool use_vertices(uvec3 lit, vec3 weights) {
    lit_vertices = lit;
    vertex_weights = weights;
    uint marks = marks_of(radiosity, lit);
    near_occluders = marked_occluders(marks);
    return marks_edge(marks);
}

// The chain of the cluster that vertex `v` of an entity belongs to.
uvec2 chain_of(uint cluster_first, uint v) {
    return texelFetch(chains, int(cluster_first + v / WORKGROUP)).xy;
}

// What is kept of a pixel: light of its chain and of the rest, or where the chain has no entries as vertices have it.
// `at`: object's frame, metres.
uvec4 pixel_light(Entity receiver, vec3 at, Facing facings[FACINGS], uvec2 chain) {
    Surface surface;
    surface.position = receiver.scale * to_world(receiver, at);
    surface.origin = receiver.centre.xyz;
    surface.inverse_radius = receiver.centre.w;
    surface.facings = facings;
    surface.step = receiver.scale * max(length(dFdx(at)), length(dFdy(at)));
#if SHOWN
    shown_lights[0] = texelFetch(shown_lights_of, int(ALL_SHOWN_QUADS * push.receiver));
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
    return pack_light(push.receiver, gl_FragCoord.z, light, shown_shares[0], missed > tolerable_miss(receiver.albedo, rest));
}
