#version 460
// The mean light that leaves the vertices of every run, by their areas.
layout(local_size_x = 64) in;

layout(std430, binding = 0) readonly buffer Runs { uvec2 runs[]; };  // first vertex, and how many
layout(std430, binding = 1) readonly buffer Areas { float areas[]; }; // of every vertex
#include "readable.glsl"
READ_VEC4(2, Light, light, light_at)
layout(std430, binding = 3) writeonly buffer RunLight { vec4 run_light[]; };
layout(push_constant) uniform Push { uint count; } push;

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= push.count) {
        return;
    }
    uvec2 run = runs[i];
    vec4 sum = vec4(0.0);
    for (uint v = run.x; v < run.x + run.y; v++) {
        sum += areas[v] * vec4(light_at(v).rgb, 1.0);
    }
    run_light[i] = vec4(sum.rgb / max(sum.w, 1e-30), 0.0);
}
