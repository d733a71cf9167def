#version 460
// The light that leaves every run of vertices and passes lamps, which stand before them: the mean of its vertices' direct
// light by their areas, or with RELAX a step of the light that runs pass on to each other. A workgroup has a run of the
// largest size, a thread two of the smallest of a cluster at most: src/bounce/mod.rs.
layout(local_size_x = 64) in;

struct Block {
    uint vertex_first, vertex_count;
    uint middle, large; // numbers of its first cluster and its own
    uint smallest[8]; // that of each cluster's first
    uint ends[32]; // of 16 in each cluster, a byte each
};
layout(std430, binding = 0) readonly buffer Blocks { Block blocks[]; };
#include "readable.glsl"
READ_UINT(1, Areas, areas, area_at) // of every vertex, m^2, as bits
READ_VEC4(2, Light, light, light_at) // of vertices, or with RELAX of runs before
layout(std430, binding = 3) writeonly buffer RunLight { vec4 run_light[]; };
#if RELAX
#include "generated/structs.glsl"
#define ENTITY_BINDING 5
#include "entities.glsl"
#include "links.glsl"
READ_VEC4(4, RunDirect, run_direct, run_direct_at) // w: share of light that passes lamps
READ_UVEC2(6, Ranges, ranges, range_at)
READ_UINT(7, Links, links, link_at)
#if MOVERS
// Onto every vertex from other groups: share of the view times radiosity, and the share that they take.
READ_VEC4(8, Incoming, incoming, incoming_at)
#endif
layout(push_constant) uniform Push {
    vec3 gain; // so many times the change is added: src/bounce/relaxation.rs
    uint meets;
} push;
#else
layout(std430, binding = 4) writeonly buffer RunDirect { vec4 run_direct[]; };
#if LAMPS
READ_UINT(5, LampShares, lamp_shares, lamp_share_at) // of what a vertex sees, as bits
#endif
#endif

// Sums of area times light, and of area.
shared vec4 small_sums[64];
shared vec4 middle_sums[8];

vec4 mean(vec4 sum) {
    return vec4(sum.rgb / max(sum.w, 1e-30), 0.0);
}

uint end(uint run) {
    return blocks[gl_WorkGroupID.x].ends[run / 4] >> 8 * (run % 4) & 255;
}

#if RELAX
// Light of a run after the step; `met` is the mean of what its vertices receive from other groups.
vec3 relaxed(uint run, vec4 met) {
    uvec2 range = range_at(run);
    vec3 sum = vec3(0.0);
    for (uint k = range.x; k < range.x + link_count(range); k++) {
        uint packed = link_at(k);
        sum += link_share(packed) * light_at(link_number(packed)).rgb;
    }
    sum = sum * (1.0 - met.w) + met.rgb;
    vec4 direct = run_direct_at(run);
    vec3 found = direct.rgb + direct.w * PI * ENTITY(linked_entity(range)).albedo * sum; // albedo is over pi
    return found + push.gain * (found - light_at(run).rgb);
}
#endif

void main() {
    uint vertex_first = blocks[gl_WorkGroupID.x].vertex_first;
    uint vertex_count = blocks[gl_WorkGroupID.x].vertex_count;
    uint i = gl_LocalInvocationID.x;
    uint cluster = i / 8;
    vec4 sum = vec4(0.0);
    for (uint run = i % 8; run < 16; run += 8) {
        uint from = run == 0 ? 0 : end(16 * cluster + run - 1);
        uint to = end(16 * cluster + run);
        uint number = blocks[gl_WorkGroupID.x].smallest[cluster] + run;
        float area = 0.0;
        vec4 of_run = vec4(0.0); // of its vertices, times their areas
        for (uint k = 64 * cluster + from; k < 64 * cluster + to; k++) {
            uint v = vertex_first + k;
            float of_vertex = uintBitsToFloat(area_at(v));
            area += of_vertex;
#if RELAX
#if MOVERS
            of_run += of_vertex * (push.meets != 0 ? incoming_at(v) : vec4(0.0));
#endif
#elif LAMPS
            float passes = 1.0 - uintBitsToFloat(lamp_share_at(v));
            of_run += of_vertex * passes * vec4(light_at(v).rgb, 1.0);
#else
            of_run += of_vertex * vec4(light_at(v).rgb, 1.0);
#endif
        }
        of_run /= max(area, 1e-30);
        if (from < to) {
#if RELAX
            of_run.rgb = relaxed(number, of_run);
#else
            run_direct[number] = of_run;
#endif
            run_light[number] = vec4(of_run.rgb, 0.0);
        }
        sum += area * vec4(of_run.rgb, 1.0);
    }
    small_sums[i] = sum;
    barrier();
    if (64 * i < vertex_count) {
        sum = vec4(0.0);
        for (uint k = 8 * i; k < 8 * i + 8; k++) {
            sum += small_sums[k];
        }
        run_light[blocks[gl_WorkGroupID.x].middle + i] = mean(sum);
        middle_sums[i] = sum;
    }
    barrier();
    if (i == 0) {
        sum = vec4(0.0);
        for (uint k = 0; 64 * k < vertex_count; k++) {
            sum += middle_sums[k];
        }
        run_light[blocks[gl_WorkGroupID.x].large] = mean(sum);
    }
}
