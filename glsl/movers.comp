#version 460
#extension GL_EXT_control_flow_attributes : require
// What moves and every vertex: the share of the vertex's cosine-weighted view that moving things take, and the light
// that comes from there; onto what moves, also the light of what rests. A cluster a workgroup: src/bounce/movers.rs.
#include "merge_layout.glsl"
#include "generated/basis.glsl"
#include "generated/cosine.glsl"

layout(local_size_x = WORKGROUP) in;

const uint NONE = 0xffffffffu;
#include "far.glsl"
#define CLUSTER_BINDING 4
#include "clusters.glsl"
#define FIELD_BINDING 5
#include "field.glsl"
READ_VEC4(6, Transfers, transfers, transfer_quad)
READ_VEC4(7, Vertices, vertices, vertex_quad)
#define LEAVING_BINDING 8
#include "leaving.glsl"
layout(std430, binding = 10) writeonly buffer Incoming { vec4 incoming[]; }; // share times radiosity; share taken of links
#if SELF
READ_UVEC2(11, SelfCells, self_cells, self_cell)
#include "blocked_share.glsl"
#include "bytes.glsl"
#include "self_visibility.glsl"
#endif
READ_VEC4(12, Spheres, spheres, sphere_at) // two a distant mover: from the receiver's centre, square of its radius; light, weight
#include "merge_cone.glsl"

// The receiver's side of a vertex, in its own frame.
struct Own {
    vec3 normal;
    uint self_first; // cells of its self-visibility, or NONE
    bool blocks;     // whether its transfer says more than its normal
    float transfer[COEFFICIENTS];
    float cosine[COEFFICIENTS];
};

// How much of a thing the receiver's own group leaves visible: by the map of self-visibility, which knows how far away
// that is which hides, or by the quotient of transfer and plain cosine in that direction.
float own_visible(Own own, vec3 direction, float sine, float distance) {
#if SELF
    if (own.self_first != NONE) {
        return self_visible(own.self_first, own.normal, direction, sine, distance);
    }
#endif
    float y[COEFFICIENTS];
    sh_basis(direction, y);
    float seen = 0.0, open = 0.0;
    [[unroll]] for (uint i = 0; i < COEFFICIENTS; i++) {
        seen += own.transfer[i] * y[i];
        open += own.cosine[i] * y[i];
    }
    return own.blocks ? clamp(seen / max(open, 0.05), 0.0, 1.0) : 1.0;
}

// Light of the far runs, as the middle of the cluster sees it in the receiver's frame: nine coefficients of their share
// of the view times radiosity, and of the share, of one vertex's part of them and then of all.
shared vec4 far_sums[9 * WORKGROUP];
shared vec4 far_sum[9];

void sum_far(Entity receiver, vec3 middle, uint v, uint first, uint count) {
    vec4 sums[9];
    [[unroll]] for (uint k = 0; k < 9; k++) {
        sums[k] = vec4(0.0);
    }
    for (uint i = first + v; i < first + count; i += WORKGROUP) {
        uint packed = entry_at(i), run = link_number(packed);
        vec3 to = far_at(2 * run).xyz - middle;
        vec4 across = far_at(2 * run + 1);
        float square = max(dot(to, to), 1e-20), distance = sqrt(square);
        float share = max(-dot(to, across.xyz), 0.0) * across.w / (distance * (PI * square + across.w));
        share *= link_share(packed);
        float y[COEFFICIENTS];
        sh_basis(to_object(receiver, to / distance), y);
        [[unroll]] for (uint k = 0; k < min(COEFFICIENTS, 9); k++) {
            sums[k] += share * y[k] * vec4(run_light_at(run).rgb, 1.0);
        }
    }
    [[unroll]] for (uint k = 0; k < 9; k++) {
        far_sums[9 * v + k] = sums[k];
    }
    barrier();
    if (v < 9) {
        vec4 sum = vec4(0.0);
        for (uint i = 0; i < min(count, WORKGROUP); i++) {
            sum += far_sums[9 * i + v];
        }
        far_sum[v] = sum;
    }
    barrier();
}

// Share of the cosine-weighted hemisphere that a sphere takes: exact above the horizon, and within 0.04 of its sine where
// the horizon cuts it.
float sphere_share(float sine, float cosine) {
    float above = clamp(cosine + sine, 0.0, 2.0 * sine);
    return sine * sine * max(cosine, above * above / max(4.0 * sine, 1e-20));
}

void main() {
    Cluster cluster = cluster_at(gl_WorkGroupID.x);
    Entity receiver = ENTITY(cluster.receiver);
    uint v = gl_LocalInvocationID.x;
    uint first = cluster.entry_first, end = first + cluster.entry_count;
    vec3 middle = uintBitsToFloat(uvec3(entry_at(first), entry_at(first + 1), entry_at(first + 2)));
    uint near_count = entry_at(first + 3), far_count = entry_at(first + 4);
    uint sphere_first = entry_at(first + 5), sphere_count = entry_at(first + 6);
    uint near_boxes = entry_at(first + 7), distant_boxes = entry_at(first + 8);
    first += CUT_HEADER;
    if (far_count > 0) {
        sum_far(receiver, receiver.centre.xyz + middle, v, first + near_count, far_count);
    }
    if (v >= cluster.vertex_count) {
        return;
    }
    if (cluster.entry_count == CUT_HEADER && sphere_count == 0) {
        incoming[cluster.radiosity_first + v] = vec4(0.0);
        return;
    }
    uint at = 2 * (cluster.vertex_first + v);
    Own own;
    own.normal = vertex_quad(at + 1).xyz;
    // World axes, but from the receiver's centre, as in the merge.
    vec3 position = receiver.scale * to_world(receiver, vertex_quad(at).xyz);
    vec3 normal = to_world(receiver, own.normal);
    own.self_first = cluster.self_first == NONE ? NONE : cluster.self_first + v * SELF_CELLS;
    own.blocks = cluster.transfer_first != NONE;
    sh_cosine(own.normal, own.cosine);
    own.transfer = own.cosine;
    if (own.blocks) {
        [[unroll]] for (uint i = 0; i < COEFFICIENTS; i++) {
            own.transfer[i] = transfer_quad(cluster.transfer_first + v * CHANNEL_QUADS + i / 4)[i % 4];
        }
    }
    vec4 at_rest = near_light(receiver.centre.xyz + position, normal, first, near_count);
    if (far_count > 0) {
        vec4 far = vec4(0.0);
        [[unroll]] for (uint k = 0; k < min(COEFFICIENTS, 9); k++) {
            far += own.cosine[k] * far_sum[k];
        }
        at_rest += max(far, 0.0);
    }
    vec3 sum = vec3(0.0);
    float taken = 0.0, hidden = 0.0; // of the latter links know already
    for (uint s = 0; s < sphere_count; s++) {
        uint i = sphere_first + s;
        vec4 sphere = sphere_at(2 * i), light = sphere_at(2 * i + 1);
        vec3 to = sphere.xyz - position;
        float distance = length(to);
        vec3 toward = to / max(distance, 1e-20);
        float sine = min(sqrt(sphere.w) / max(distance, 1e-20), 1.0);
        float share = light.w * sphere_share(sine, dot(normal, toward));
        share *= own_visible(own, to_object(receiver, toward), sine, distance * receiver.centre.w);
        sum += share * light.rgb;
        taken += share;
        hidden += s < distant_boxes ? share : 0.0;
    }
    first += near_count + far_count;
    for (uint i = first; i < end; i++) {
        uint packed = entry_at(i), e = link_number(packed);
        Entity mover = ENTITY(e);
        mover.centre.xyz -= receiver.centre.xyz;
        Cone cone = cone_of(mover.centre, position);
        vec3 from = to_object(mover, (position - mover.centre.xyz) * mover.centre.w);
        float b[COEFFICIENTS];
        field_gather(field_place(to_lattice(mover, from), mover.radial, lattice_edges(mover)), mover.blocked_base,
                     CHANNEL_QUADS, b);
        float cosine[COEFFICIENTS];
        sh_cosine(to_object(mover, normal), cosine);
        float share = 0.0;
        [[unroll]] for (uint k = 0; k < COEFFICIENTS; k++) {
            share += b[k] * cosine[k];
        }
        share *= above_horizon(cone, normal) * mover.opacity * link_share(packed) / PI;
        share *= own_visible(own, to_object(receiver, cone.toward), cone.sine, cone.distance * receiver.centre.w);
        share = max(share, 0.0);
        sum += share * seen(e, from, seen_from(from, b));
        taken += share;
        hidden += i < first + near_boxes ? share : 0.0;
    }
    // Things that stand before each other take no more than the hemisphere.
    float scale = 1.0 / max(taken, 1.0);
    vec3 light = within_hemisphere(at_rest) * (1.0 - taken * scale) + sum * scale;
    incoming[cluster.radiosity_first + v] = vec4(light, (taken - hidden) * scale);
}
