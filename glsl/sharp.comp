#version 460
#extension GL_EXT_control_flow_attributes : require
// Light of sharp lights on receivers, a cluster of neighbouring vertices a workgroup, added to what the merge has
// written. A chain is what may stand between the cluster and one light: every occluder's silhouette field takes its
// share out of every part of the light, and the maps of a lamp take that of all that stands in them.
#include "merge_layout.glsl"

layout(local_size_x = WORKGROUP) in;

const uint NONE = 0xffffffffu;
#define ENTITY_BINDING 0
#include "entities.glsl"
#include "lists.glsl"
#define NODE_BINDING 3
#include "silhouette_field.glsl"
#include "readable.glsl"
READ_VEC4(5, Vertices, vertices, vertex_quad)
READ_VEC4(8, Soft, soft, soft_at) // what the merge has written
layout(std430, binding = 6) writeonly buffer Radiosity { vec4 radiosity[]; };
#if SELF
READ_UVEC2(7, SelfCells, self_cells, self_cell)
#include "self_visibility.glsl"
#endif
#define FACINGS 1
#define HIDES 1
uint told_suns; // of the vertex: src/layout.rs
#if EDGES
#define KEEPS 1
// Of all vertices by one light after another: KeptIrradiance.
layout(std430, binding = 12) buffer Irradiances { uvec2 irradiances[]; };
layout(push_constant) uniform Push {
    uint kept_lights;
    uint all_vertices;
} push;
uint kept_vertex; // the place among a light's irradiances of the vertex that is lit
#endif
#include "sharp_light.glsl"
#if SHOWN
layout(std430, binding = 9) readonly buffer ShownLights { uvec4 shown_lights_of[]; }; // ALL_SHOWN_QUADS of every entity
layout(std430, binding = 10) writeonly buffer ShownShares { uvec4 shown_shares_of[]; }; // of every vertex: bytes
#endif
#if LAMPS
layout(std430, binding = 11) writeonly buffer LampShares { float lamp_shares[]; };
#endif

void main() {
    Cluster cluster = cluster_at(gl_WorkGroupID.x);
    uint v = gl_LocalInvocationID.x;
    if (v >= cluster.vertex_count) {
        return;
    }
    Entity receiver = ENTITY(cluster.receiver);
    uint at = 2 * (cluster.vertex_first + v);
    // World axes, but from the receiver's centre, as in the merge.
    Surface surface;
    vec4 place = receiver.scale * vertex_quad(at);
    surface.position = to_world(receiver, place.xyz);
    surface.origin = receiver.centre.xyz;
    surface.inverse_radius = receiver.centre.w;
#if EDGES
    surface.step = place.w;
#endif
    vec4 facing = vertex_quad(at + 1);
    surface.facings[0] = facing_of(receiver, facing.xyz, 1.0, cluster.self_first, v);
    told_suns = uint(facing.w);
#if LAMP_MAPS
    surface.ground = surface.facings[0].normal;
    surface.lifted = vec3(0.0);
    surface.is_round = false;
    // Maps of suns are for pixels.
    surface.light_maps = receiver.light_maps & ~uint(LAMP_BIT - 1);
#endif
    vec4 sum = soft_at(cluster.radiosity_first + v);
#if EDGES
    vec3 soft = sum.rgb;
    kept_vertex = cluster.radiosity_first + v;
    for (uint l = 0; l < push.kept_lights; l++) {
        irradiances[l * push.all_vertices + kept_vertex] = uvec2(0);
    }
#endif
#if SHOWN
    EACH for (uint q = 0; q < SHOWN_QUADS; q++) {
        shown_lights[q] = shown_lights_of[ALL_SHOWN_QUADS * cluster.receiver + q];
        shown_shares[q] = vec4(0.0);
    }
#endif
    if (cluster.sharp_count > 0) {
        sum.rgb += sharp_sum(surface, cluster.entry_first, cluster.sharp_count) * receiver.albedo;
    }
#if EDGES
    float tolerable = tolerable_miss(receiver.albedo, soft);
    sum.w = missed > tolerable ? 1.0 : 0.0;
    settle_kept(tolerable);
#endif
    radiosity[cluster.radiosity_first + v] = sum;
#if LAMPS
    lamp_shares[cluster.radiosity_first + v] = min(lamps, 1.0);
#endif
#if SHOWN
    uvec4 bytes = uvec4(0);
    EACH for (uint q = 0; q < SHOWN_QUADS; q++) {
        bytes[q] = packUnorm4x8(shown_shares[q]);
    }
    shown_shares_of[cluster.radiosity_first + v] = bytes;
#endif
}
