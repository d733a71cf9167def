#version 460
// The light that leaves what moves, by direction or by a box's faces: a workgroup adds up the runs of vertices of one
// entity, with the light that they receive from what rests. Of src/bounce/movers.rs.
#include "merge_layout.glsl"
layout(local_size_x = RUNS) in;

#include "far.glsl"
struct Mover {
    uint entity;
    uint run_first, run_count;
    uint far_first, far_count; // entries of its cut of what rests
};
struct Run {
    vec4 middle;    // in r, in the entity's frame; number
    vec4 normal;    // mean
    vec4 areas[3];  // its area by direction, nine coefficients, or by the six faces of a box
};
layout(std430, binding = 4) readonly buffer Movers { Mover movers[]; };
layout(std430, binding = 5) readonly buffer Runs { Run runs[]; };
layout(std430, binding = 6) writeonly buffer Outgoing { vec4 outgoing[]; }; // nine quads an entity: area times light; area
layout(push_constant) uniform Push { uint bounced; } push;

shared vec3 light[RUNS];

void main() {
    Mover mover = movers[gl_WorkGroupID.x];
    uint i = gl_LocalInvocationID.x;
    if (i < mover.run_count) {
        Run run = runs[mover.run_first + i];
        light[i] = run_light_at(floatBitsToUint(run.middle.w)).rgb;
        if (push.bounced != 0) {
            Entity entity = ENTITY(mover.entity);
            vec3 place = entity.centre.xyz + to_world(entity, run.middle.xyz) / entity.centre.w;
            vec4 met = near_light(place, to_world(entity, run.normal.xyz), mover.far_first, mover.far_count);
            light[i] += PI * entity.albedo * within_hemisphere(met); // albedo is over pi
        }
    }
    barrier();
    if (i < 9) {
        vec4 sum = vec4(0.0);
        for (uint run = 0; run < mover.run_count; run++) {
            sum += runs[mover.run_first + run].areas[i / 4][i % 4] * vec4(light[run], 1.0);
        }
        outgoing[9 * mover.entity + i] = sum;
    }
}
