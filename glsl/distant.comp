#version 460
#extension GL_EXT_control_flow_attributes : require
// What moves, as it looks from the middle of a cluster far away: a sphere that takes as much of the view in the same
// direction, of one colour. A pair of a cluster and a mover a thread: src/bounce/movers.rs.
#include "merge_layout.glsl"
#include "generated/basis.glsl"
layout(local_size_x = WORKGROUP) in;

#define ENTITY_BINDING 0
#include "entities.glsl"
#include "readable.glsl"
#include "links.glsl"
READ_UINT(1, Entries, entries, entry_at)
#define CLUSTER_BINDING 2
#include "clusters.glsl"
#define FIELD_BINDING 3
#include "field.glsl"
#define LEAVING_BINDING 4
#include "leaving.glsl"
READ_UVEC2(6, Pairs, pairs, pair_at) // cluster; mover below its weight
layout(std430, binding = 7) writeonly buffer Spheres { vec4 spheres[]; };
layout(push_constant) uniform Push { uint count; } push;

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= push.count) {
        return;
    }
    uvec2 pair = pair_at(i);
    Cluster cluster = cluster_at(pair.x);
    uint first = cluster.entry_first;
    uint e = link_number(pair.y);
    Entity mover = ENTITY(e);
    vec3 middle = uintBitsToFloat(uvec3(entry_at(first), entry_at(first + 1), entry_at(first + 2)));
    vec3 to = mover.centre.xyz - ENTITY(cluster.receiver).centre.xyz - middle;
    vec3 from = to_object(mover, -to * mover.centre.w);
    float b[COEFFICIENTS];
    field_gather(field_place(to_lattice(mover, from), mover.radial, lattice_edges(mover)), mover.blocked_base,
                 CHANNEL_QUADS, b);
    vec3 direction = seen_from(from, b);
    // A cap of so many steradians: its area times the constant basis function is the first coefficient.
    float cosine = clamp(1.0 - b[0] / (2.0 * PI * Y00), 0.0, 1.0);
    float square = (1.0 - cosine * cosine) * dot(to, to);
    vec3 centre = middle - length(to) * to_world(mover, direction);
    float weight = mover.opacity * link_share(pair.y);
    spheres[2 * i] = vec4(centre, square);
    spheres[2 * i + 1] = vec4(seen(e, from, direction), weight);
}
