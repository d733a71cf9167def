#version 460
// The mean light that leaves the vertices of every run, by their areas, and passes lamps, which stand before them.
layout(local_size_x = 64) in;

layout(std430, binding = 0) readonly buffer Runs { uvec2 runs[]; };  // first vertex, and how many
layout(std430, binding = 1) readonly buffer Areas { float areas[]; }; // of every vertex
#include "readable.glsl"
READ_VEC4(2, Light, light, light_at)
layout(std430, binding = 3) writeonly buffer RunLight { vec4 run_light[]; };
#if LAMPS
layout(std430, binding = 4) readonly buffer LampShares { float lamp_shares[]; }; // of what a vertex sees
#endif
layout(push_constant) uniform Push { uint count; } push;

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= push.count) {
        return;
    }
    uvec2 run = runs[i];
    vec4 sum = vec4(0.0);
    for (uint v = run.x; v < run.x + run.y; v++) {
        vec3 light = light_at(v).rgb;
#if LAMPS
        light *= 1.0 - lamp_shares[v];
#endif
        sum += areas[v] * vec4(light, 1.0);
    }
    run_light[i] = vec4(sum.rgb / max(sum.w, 1e-30), 0.0);
}
