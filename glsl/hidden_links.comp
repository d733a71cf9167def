#version 460
#extension GL_EXT_control_flow_attributes : require
// The links between what rests, less what boxes that move hide of them: src/bounce/boxes.rs. A vertex a thread and a
// cluster a workgroup, or with OF_RUNS a run a thread, whose links start at its middle.
#include "merge_layout.glsl"
layout(local_size_x = WORKGROUP) in;

#define EACH [[unroll]]
#define ENTITY_BINDING 0
#include "entities.glsl"
#include "readable.glsl"
#include "links.glsl"
#define CLUSTER_BINDING 1
#include "clusters.glsl"
READ_VEC4(2, Vertices, vertices, vertex_quad)
READ_UVEC2(3, Ranges, ranges, range_at) // first link; how many, and above them the entity
READ_UINT(4, Links, links, link_at)
READ_VEC4(5, Places, places, place_at) // two a run: its middle, world, and whether it rests; its mean normal
READ_VEC4(6, Edges, edges, edge_at) // three an entity: halves of a box's edges, its frame, in r
READ_UINT(7, Directions, directions, direction_at) // of their rays
layout(std430, binding = 8) buffer Hidden { uint hidden[]; };
layout(push_constant) uniform Push { uint count, boxes[MOST_BOXES], run_count; } push; // boxes are entities
#include "outline.glsl"
#include "cuboid.glsl"

void main() {
#if OF_RUNS
    uint receiver = gl_GlobalInvocationID.x;
    if (receiver >= push.run_count) {
        return;
    }
    vec3 place = place_at(2 * receiver).xyz, normal = place_at(2 * receiver + 1).xyz;
    uvec2 range = range_at(receiver);
#else
    Cluster cluster = cluster_at(gl_WorkGroupID.x);
    uint v = gl_LocalInvocationID.x;
    if (v >= cluster.vertex_count) {
        return;
    }
    Entity receiver = ENTITY(cluster.receiver);
    uint at = 2 * (cluster.vertex_first + v);
    vec3 place = receiver.centre.xyz + receiver.scale * to_world(receiver, vertex_quad(at).xyz);
    vec3 normal = to_world(receiver, vertex_quad(at + 1).xyz);
    uvec2 range = range_at(cluster.radiosity_first + v);
#endif
    uint first = range.x, end = first + link_count(range);
    for (uint k = first; k < end; k++) {
        hidden[k] = link_at(k);
    }
    for (uint i = 0; i < push.count; i++) {
        uint e = push.boxes[i];
        Entity mover = ENTITY(e);
        vec3 to = (mover.centre.xyz - place) * mover.centre.w;
        if (dot(to, normal) < -1.0) {
            continue;
        }
        mat3 edges;
        EACH for (uint k = 0; k < 3; k++) {
            edges[k] = to_world(mover, edge_at(3 * e + k).xyz);
        }
        Box box = box_of(edges, to);
        for (uint k = first; k < end; k++) {
            uint link = hidden[k], run = link_number(link);
            float share = link_share(link);
            vec3 toward = normalize(unpacked_direction(direction_at(k)));
            float tangent = NARROWED * sqrt(share / max(dot(normal, toward), LEAST_COSINE));
            float depth = max(dot(to, toward), 0.0);
            vec4 middle = place_at(2 * run);
            if (middle.w > 0.0 && length(to - depth * toward) < 1.0 + tangent * depth) {
                float limit = distance(place, middle.xyz) * mover.centre.w;
                float nearest, away;
                float blocked = mover.opacity * box_blocks(box, toward, tangent, limit, nearest, away);
                hidden[k] = packed_link(share * (1.0 - blocked), run);
            }
        }
    }
}
