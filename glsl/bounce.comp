#version 460
// Adds to the direct light of every vertex what reaches it from the surfaces of its rigid group, and from others:
// src/bounce/mod.rs.
#include "generated/structs.glsl"
layout(local_size_x = 64) in;

#define ENTITY_BINDING 0
#include "entities.glsl"
#include "readable.glsl"
#include "links.glsl"
READ_UVEC2(1, Ranges, ranges, range_at) // first link; how many, and above them the entity
READ_UINT(2, Links, links, link_at)
READ_VEC4(3, RunLight, run_light, run_light_at)
READ_VEC4(4, Direct, direct, direct_at)
layout(std430, binding = 5) writeonly buffer Radiosity { vec4 radiosity[]; };
#if SOFT
// The same without the light of sharp lights, for pixels that evaluate them.
READ_VEC4(6, SoftDirect, soft_direct, soft_direct_at)
layout(std430, binding = 7) writeonly buffer Soft { vec4 soft[]; };
#endif
#if MOVERS
// Of other groups: share of the view times radiosity, and the share that they take.
READ_VEC4(8, Incoming, incoming, incoming_at)
#endif
layout(push_constant) uniform Push { uint count; } push;

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= push.count) {
        return;
    }
    uvec2 range = range_at(i);
    vec3 sum = vec3(0.0);
    for (uint k = range.x; k < range.x + link_count(range); k++) {
        uint packed = link_at(k);
        sum += link_share(packed) * run_light_at(link_number(packed)).rgb;
    }
#if MOVERS
    vec4 incoming = incoming_at(i);
    sum = sum * (1.0 - incoming.w) + incoming.rgb;
#endif
    // Albedo is over pi. Steps may leave less than no light of a run.
    vec4 bounced = vec4(max(PI * ENTITY(linked_entity(range)).albedo * sum, vec3(0.0)), 0.0);
    radiosity[i] = direct_at(i) + bounced;
#if SOFT
    soft[i] = soft_direct_at(i) + bounced;
#endif
}
