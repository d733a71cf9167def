#version 460
// Adds to the light of what moves the light that the surfaces at rest reflect onto it: src/bounce.rs.
#include "merge_layout.glsl"
layout(local_size_x = WORKGROUP) in;

layout(std430, binding = 0) readonly buffer Entities { Entity entities[]; };
layout(std430, binding = 1) readonly buffer Groups { uvec4 groups[]; }; // entity; first vertex, in both buffers; how many
#include "readable.glsl"
READ_VEC4(2, Vertices, vertices, vertex_quad)
READ_VEC4(3, Far, far, far_at) // two a run: its middle and number; the sum of its normals times their areas
READ_VEC4(4, RunLight, run_light, run_light_at)
layout(std430, binding = 5) buffer Radiosity { vec4 radiosity[]; };
#if SOFT
layout(std430, binding = 6) buffer Soft { vec4 soft[]; };
#endif
layout(push_constant) uniform Push { uint count; } push;

void main() {
    uvec4 group = groups[gl_WorkGroupID.x];
    uint v = gl_LocalInvocationID.x;
    if (v >= group.w) {
        return;
    }
    Entity entity = entities[group.x];
    uint at = 2 * (group.y + v);
    vec3 place = entity.centre.xyz + entity.scale * to_world(entity, vertex_quad(at).xyz);
    vec3 normal = to_world(entity, vertex_quad(at + 1).xyz);
    vec3 sum = vec3(0.0);
    float whole = 0.0;
    for (uint i = 0; i < push.count; i++) {
        vec4 middle = far_at(2 * i);
        vec3 area = far_at(2 * i + 1).xyz;
        vec3 to = middle.xyz - place;
        // The share of the cosine-weighted hemisphere that a flat piece takes, seen from far; near to it at most 1.
        float square = dot(to, to), lit = max(dot(normal, to), 0.0) * max(-dot(area, to), 0.0);
        float share = lit / max(square * (PI * square + length(area)), 1e-30);
        sum += share * run_light_at(floatBitsToUint(middle.w)).rgb;
        whole += share;
    }
    vec4 bounced = vec4(PI * entity.albedo * sum / max(whole, 1.0), 0.0); // albedo is over pi
    radiosity[group.z + v] += bounced;
#if SOFT
    soft[group.z + v] += bounced;
#endif
}
