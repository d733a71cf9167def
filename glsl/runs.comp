#version 460
// The mean light that leaves the vertices of every run, by their areas, and passes lamps, which stand before them. A
// workgroup has a run of the largest size, a thread one of the smallest: src/bounce/mod.rs.
layout(local_size_x = 64) in;

struct Block {
    uint vertex_first, vertex_count;
    uint small, middle, large; // number of its first run of each size
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

void main() {
    Block block = blocks[gl_WorkGroupID.x];
    uint i = gl_LocalInvocationID.x;
    vec4 sum = vec4(0.0);
    for (uint k = 8 * i; k < min(8 * i + 8, block.vertex_count); k++) {
        uint v = block.vertex_first + k;
        vec3 light = light_at(v).rgb;
#if LAMPS
        light *= 1.0 - uintBitsToFloat(lamp_share_at(v));
#endif
        sum += uintBitsToFloat(area_at(v)) * vec4(light, 1.0);
    }
    if (8 * i < block.vertex_count) {
        run_light[block.small + i] = mean(sum);
    }
    small_sums[i] = sum;
    barrier();
    if (64 * i < block.vertex_count) {
        sum = vec4(0.0);
        for (uint k = 8 * i; k < 8 * i + 8; k++) {
            sum += small_sums[k];
        }
        run_light[block.middle + i] = mean(sum);
        middle_sums[i] = sum;
    }
    barrier();
    if (i == 0) {
        sum = vec4(0.0);
        for (uint k = 0; 64 * k < block.vertex_count; k++) {
            sum += middle_sums[k];
        }
        run_light[block.large] = mean(sum);
    }
}
