#version 460
// The mean light that leaves the vertices of every run, by their areas, and passes lamps, which stand before them. A
// workgroup has a run of the largest size, a thread two of the smallest of a cluster at most: src/bounce/mod.rs.
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
READ_VEC4(2, Light, light, light_at)
layout(std430, binding = 3) writeonly buffer RunLight { vec4 run_light[]; };
#if LAMPS
READ_UINT(4, LampShares, lamp_shares, lamp_share_at) // of what a vertex sees, as bits
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

void main() {
    uint vertex_first = blocks[gl_WorkGroupID.x].vertex_first;
    uint vertex_count = blocks[gl_WorkGroupID.x].vertex_count;
    uint i = gl_LocalInvocationID.x;
    uint cluster = i / 8;
    vec4 sum = vec4(0.0);
    for (uint run = i % 8; run < 16; run += 8) {
        uint from = run == 0 ? 0 : end(16 * cluster + run - 1);
        uint to = end(16 * cluster + run);
        vec4 of_run = vec4(0.0);
        for (uint k = 64 * cluster + from; k < 64 * cluster + to; k++) {
            uint v = vertex_first + k;
            vec3 light = light_at(v).rgb;
#if LAMPS
            light *= 1.0 - uintBitsToFloat(lamp_share_at(v));
#endif
            of_run += uintBitsToFloat(area_at(v)) * vec4(light, 1.0);
        }
        if (from < to) {
            run_light[blocks[gl_WorkGroupID.x].smallest[cluster] + run] = mean(of_run);
        }
        sum += of_run;
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
