#version 460
#extension GL_EXT_control_flow_attributes : require
// Light on one receiver: for every vertex, its transfer is multiplied by the visibility of every occluder, nearest list entry
// first, and meets each light at its place in the order. There is one running product a light (of the occluders nearer than
// it) and one for the sky (of all), so the entity loop is the same for every vertex of a workgroup.
#include "merge_layout.glsl"
#include "generated/basis.glsl"
#include "generated/cosine.glsl"
#include "generated/product.glsl"

layout(local_size_x = WORKGROUP) in;

const uint NONE = 0xffffffffu;
const uint ROTATION_QUADS = ((BANDS * (4 * BANDS * BANDS - 1)) / 3 + 2) / 4;

// What is the same for a whole workgroup.
#if UNIFORM
layout(std140, binding = 0) uniform Entities { Entity entities[ENTITY_LIMIT]; };
layout(std140, binding = 1) uniform Rotations { vec4 rotations[ENTITY_LIMIT * ROTATION_QUADS]; };
layout(std140, binding = 6) uniform Sky { vec4 sky[COEFFICIENTS]; };
#else
layout(std430, binding = 0) readonly buffer Entities { Entity entities[]; };
layout(std430, binding = 1) readonly buffer Rotations { vec4 rotations[]; };
layout(std430, binding = 6) readonly buffer Sky { vec4 sky[]; };
#endif
layout(std430, binding = 2) readonly buffer List { uint list[]; };
#define FIELD_BINDING 3
#include "field.glsl"
#if TEXEL
layout(binding = 4) uniform textureBuffer transfers;
vec4 transfer_quad(uint i) {
    return texelFetch(transfers, int(i));
}
layout(binding = 5) uniform textureBuffer vertices;
vec4 vertex_quad(uint i) {
    return texelFetch(vertices, int(i));
}
#else
layout(std430, binding = 4) readonly buffer Transfers { vec4 transfers[]; };
vec4 transfer_quad(uint i) {
    return transfers[i];
}
layout(std430, binding = 5) readonly buffer Vertices { vec4 vertices[]; };
vec4 vertex_quad(uint i) {
    return vertices[i];
}
#endif
layout(std430, binding = 7) buffer Radiosity { vec4 radiosity[]; };

layout(push_constant) uniform Pushed { Push push; };

// The same number, for one that is the same in a whole workgroup. Mesa's software driver proves uniformity only of push
// constants and what is computed from them; uniform blocks read at such an index are loaded once a wave, all else lane by lane.
uint uniformly(uint x) {
#if UNIFORM
    return push.digit[x & 15] | push.digit[(x >> 4) & 15] << 4 | push.digit[(x >> 8) & 15] << 8;
#else
    return x;
#endif
}

#define SH_ROTATION(k) rotations[instance + (k) / 4][(k) % 4]
#include "generated/rotate.glsl"

vec3 to_object(uint e, vec3 v) {
    return vec3(
        dot(entities[e].to_object_x.xyz, v), dot(entities[e].to_object_y.xyz, v), dot(entities[e].to_object_z.xyz, v));
}

// Transfer of vertex v in the world frame: the receiver's own shadow and cosine.
void transfer(uint v, vec3 normal_world, out float t[COEFFICIENTS]) {
    if (push.transfer_first == NONE) {
        sh_cosine(normal_world, t);
        return;
    }
    uint at = push.transfer_first + v * FIELD_QUADS;
    [[unroll]] for (uint i = 0; i < COEFFICIENTS; i++) {
        t[i] = transfer_quad(at + i / 4)[i % 4];
    }
    sh_rotate(t, uniformly(push.receiver) * ROTATION_QUADS);
}

void occluder(uint e, vec3 from_world, out float b[COEFFICIENTS]) {
    vec3 p = to_object(e, from_world) * entities[e].centre.w;
    field_gather(field_place(p, entities[e].radial), entities[e].blocked_base, FIELD_QUADS, b);
    sh_rotate(b, e * ROTATION_QUADS);
}

#if LIGHTS > 0
float against(float s[COEFFICIENTS], float t[COEFFICIENTS]) {
    float sum = 0.0;
    [[unroll]] for (uint i = 0; i < COEFFICIENTS; i++) {
        sum += s[i] * t[i];
    }
    return sum;
}

vec3 light(uint e, vec3 from_world, float t[COEFFICIENTS]) {
    vec3 p = to_object(e, from_world) * entities[e].centre.w;
    FieldPlace place = field_place(p, entities[e].radial);
    float s[COEFFICIENTS];
    if (entities[e].emission.w == 0.0) {
        // One colour: what it blocks is what shines.
        field_gather(place, entities[e].blocked_base, FIELD_QUADS, s);
        sh_rotate(s, e * ROTATION_QUADS);
        return entities[e].emission.rgb * against(s, t);
    }
    vec3 sum;
    [[unroll]] for (uint channel = 0; channel < 3; channel++) {
        field_gather(place, entities[e].radiance_base + channel * FIELD_QUADS, 3 * FIELD_QUADS, s);
        sh_rotate(s, e * ROTATION_QUADS);
        sum[channel] = against(s, t);
    }
    return entities[e].emission.rgb * sum;
}
#endif

void main() {
    uint v = gl_GlobalInvocationID.x;
    if (v >= push.vertex_count) {
        return;
    }
    uint at = 2 * (push.vertex_first + v);
    vec3 position = vertex_quad(at).xyz; // object frame, metres, from the bounding sphere's centre
    vec3 normal = vertex_quad(at + 1).xyz;
    uint receiver = uniformly(push.receiver);
    vec3 x = entities[receiver].to_object_x.xyz; // a row of the inverse rotation is a column of the rotation
    vec3 y = entities[receiver].to_object_y.xyz;
    vec3 z = entities[receiver].to_object_z.xyz;
    position = entities[receiver].centre.xyz + entities[receiver].albedo.w * (position.x * x + position.y * y + position.z * z);
    normal = normal.x * x + normal.y * y + normal.z * z;

    float t_sky[COEFFICIENTS];
    transfer(v, normal, t_sky);
#if LIGHTS > 0
    float t_0[COEFFICIENTS] = t_sky;
    uint light_0 = uniformly(push.light[0]);
    float d_0 = distance(position, entities[light_0].centre.xyz);
#endif
#if LIGHTS > 1
    float t_1[COEFFICIENTS] = t_sky;
    uint light_1 = uniformly(push.light[1]);
    float d_1 = distance(position, entities[light_1].centre.xyz);
#endif
#if LIGHTS > 2
    float t_2[COEFFICIENTS] = t_sky;
    uint light_2 = uniformly(push.light[2]);
    float d_2 = distance(position, entities[light_2].centre.xyz);
#endif
#if LIGHTS > 3
    float t_3[COEFFICIENTS] = t_sky;
    uint light_3 = uniformly(push.light[3]);
    float d_3 = distance(position, entities[light_3].centre.xyz);
#endif

#define NEARER(l) (d < d_##l || (d == d_##l && entities[e].rank < entities[light_##l].rank))
    for (uint i = 0; i < push.occluder_count; i++) {
        uint e = uniformly(list[push.occluder_first + uniformly(i)]);
        vec3 from = position - entities[e].centre.xyz;
        float d = length(from);
        float b[COEFFICIENTS];
#if SKY
        occluder(e, from, b);
        sh_subtract_product(t_sky, b);
#else
        bool needed = false;
#if LIGHTS > 0
        needed = needed || NEARER(0);
#endif
#if LIGHTS > 1
        needed = needed || NEARER(1);
#endif
#if LIGHTS > 2
        needed = needed || NEARER(2);
#endif
#if LIGHTS > 3
        needed = needed || NEARER(3);
#endif
        if (!needed) {
            continue;
        }
        occluder(e, from, b);
#endif
#if LIGHTS > 0
        if (NEARER(0)) {
            sh_subtract_product(t_0, b);
        }
#endif
#if LIGHTS > 1
        if (NEARER(1)) {
            sh_subtract_product(t_1, b);
        }
#endif
#if LIGHTS > 2
        if (NEARER(2)) {
            sh_subtract_product(t_2, b);
        }
#endif
#if LIGHTS > 3
        if (NEARER(3)) {
            sh_subtract_product(t_3, b);
        }
#endif
    }

    vec3 sum = vec3(0.0);
#if SKY
    [[unroll]] for (uint i = 0; i < COEFFICIENTS; i++) {
        sum += sky[i].rgb * t_sky[i];
    }
#endif
#if LIGHTS > 0
    if (light_0 != receiver) {
        sum += light(light_0, position - entities[light_0].centre.xyz, t_0);
    }
#endif
#if LIGHTS > 1
    if (light_1 != receiver) {
        sum += light(light_1, position - entities[light_1].centre.xyz, t_1);
    }
#endif
#if LIGHTS > 2
    if (light_2 != receiver) {
        sum += light(light_2, position - entities[light_2].centre.xyz, t_2);
    }
#endif
#if LIGHTS > 3
    if (light_3 != receiver) {
        sum += light(light_3, position - entities[light_3].centre.xyz, t_3);
    }
#endif
    vec3 earlier = push.accumulate == 1 ? radiosity[v].rgb : vec3(0.0);
    radiosity[v] = vec4(earlier + sum * entities[receiver].albedo.rgb, 0.0);
}
