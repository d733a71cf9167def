#version 460
#extension GL_EXT_control_flow_attributes : require
// Light on receivers, a cluster of neighbouring vertices a workgroup. Every chain begins with the vertex's transfer, is
// multiplied by the visibility past the occluders that lie before its light, and meets the light; the sky's chain comes
// last. src/lists/gather.rs lists these entries for each cluster, so that all its vertices walk one list and only what
// concerns one of them is on it; what an entry does to a single vertex (order, overlap, horizon) is decided here.
#include "merge_layout.glsl"
#include "generated/basis.glsl"
#include "generated/cosine.glsl"
#include "merge_product.glsl"

layout(local_size_x = WORKGROUP) in;

#include "lists.glsl"
const uint NONE = 0xffffffffu;

#define ENTITY_BINDING 0
#include "entities.glsl"
#define FIELD_BINDING 3
#include "field.glsl"
#include "readable.glsl"
READ_VEC4(4, Transfers, transfers, transfer_quad)
READ_VEC4(5, Vertices, vertices, vertex_quad)
#if TEXEL
READ_VEC4(6, Sky, sky, sky_quad)
#else
layout(std140, binding = 6) uniform Sky { vec4 sky[3 * CHANNEL_QUADS + 2 * VOLUME]; };
vec4 sky_quad(uint i) {
    return sky[i];
}
#endif
layout(std430, binding = 7) writeonly buffer Radiosity { vec4 radiosity[]; };
#if KEEPS
// The sky's chain at its end, for what is seen reflected: sixteen halves a vertex.
layout(std430, binding = 8) writeonly buffer Through { uvec4 through_all[]; };

float through_at(float through[COEFFICIENTS], uint i) {
    return i < COEFFICIENTS ? through[min(i, COEFFICIENTS - 1)] : 0.0;
}

void keep(float through[COEFFICIENTS], uint v) {
    [[unroll]] for (uint part = 0; part < 2; part++) {
        uvec4 packed;
        [[unroll]] for (uint k = 0; k < 4; k++) {
            uint i = 8 * part + 2 * k;
            packed[k] = packHalf2x16(vec2(through_at(through, i), through_at(through, i + 1)));
        }
        through_all[2 * v + part] = packed;
    }
}
#endif

#include "generated/rotate.glsl"

#include "merge_cone.glsl"
#include "merge_cap.glsl"
#if SHEETS
#include "merge_sheet.glsl"
#endif

// Transfer in the world frame: the receiver's own shadow times cosine. `at` is its first quad.
void transfer(uint at, Entity receiver, out float t[COEFFICIENTS]) {
    [[unroll]] for (uint i = 0; i < COEFFICIENTS; i++) {
        t[i] = transfer_quad(at + i / 4)[i % 4];
    }
    sh_rotate(t, receiver.alpha_beta, receiver.gamma);
}

// What a vertex brings to every entry: its place and its normal.
struct Vertex {
    vec3 receiver; // centre, world
    vec3 position; // world axes, from there
    vec3 normal;
    float contact; // how near to a sheet it touches it, metres
};

// How much occluder e counts in the chain of light l: 1 before the light, 0 behind it, and less where it stands beside
// the light's cone. In the sky's chain every occluder counts.
float share(Vertex vertex, uint e, Cone cone, uint l) {
    if (LIGHTS == 0) {
        return 1.0;
    }
    // The sky's chain has no light; any entity will do to keep the read in bounds.
    vec4 light_centre = ENTITY(l == SKY_CHAIN ? e : l).centre;
    light_centre.xyz -= vertex.receiver;
    Cone light = cone_of(light_centre, vertex.position);
    return l == SKY_CHAIN ? 1.0 : before(e, cone, l, light);
}

// An entry that reads a field.
void look(Vertex vertex, uint packed, float t_start[CHAIN], inout float t[CHAIN], inout vec3 sum) {
    uint e = packed & SKY_CHAIN;
    uint l = (packed >> ENTRY_BITS) & SKY_CHAIN;
    bool shines = LIGHTS == 1 && (packed & ENTRY_LIGHT) != 0;
    uint channel = (packed >> ENTRY_CHANNEL) & 3;
    bool of_radiance = shines && channel != 3;

    Entity entity = ENTITY(e);
    entity.centre.xyz -= vertex.receiver;
    Cone cone = cone_of(entity.centre, vertex.position);
    float weight = above_horizon(cone, vertex.normal);
    float counts = share(vertex, e, cone, l) * field_share(cone) * entity.opacity;
    weight *= shines ? 1.0 : counts;
    vec3 p = to_lattice(entity, to_object(entity, (vertex.position - entity.centre.xyz) * entity.centre.w));
    uint base = of_radiance ? entity.radiance_base + channel * CHANNEL_QUADS : entity.blocked_base;
    float b[COEFFICIENTS];
    FieldPlace place = field_place(p, entity.radial, lattice_edges(entity));
    [[unroll]] for (uint k = 0; k < CORNERS; k++) {
        place.weight[k] *= weight;
    }
    field_gather(place, base, of_radiance ? 3 * CHANNEL_QUADS : CHANNEL_QUADS, b);
    sh_rotate(b, entity.alpha_beta, entity.gamma);

    float met = chain_meet(t, b);
    [[unroll]] for (uint k = 0; k < COEFFICIENTS; k++) {
        b[k] = shines ? 0.0 : b[k];
    }
    vec3 color = of_radiance ? vec3(channel == 0, channel == 1, channel == 2) : vec3(1.0);
    sum += (shines ? met : 0.0) * color * entity.emission;
    chain_multiply(t, b);
    bool anew = LIGHTS == 1 && (packed & ENTRY_LAST) != 0;
    [[unroll]] for (uint k = 0; k < CHAIN; k++) {
        t[k] = anew ? t_start[k] : t[k];
    }
}

#if SKIP_CAPS
// An entry that takes an occluder for a cap.
void cover(Vertex vertex, uint packed, inout float t[CHAIN]) {
    uint e = packed & SKY_CHAIN;
    Entity entity = ENTITY(e);
    entity.centre.xyz -= vertex.receiver;
    Cone cone = cone_of(entity.centre, vertex.position);
    float weight = above_horizon(cone, vertex.normal) * share(vertex, e, cone, (packed >> ENTRY_BITS) & SKY_CHAIN);
    float y[COEFFICIENTS];
    float solid_angle = cap_of(entity, cone, y);
    chain_cover(t, y, weight * (1.0 - field_share(cone)) * entity.opacity * solid_angle);
}
#endif

// Whether an entry reads a field.
bool is_look(uint packed) {
    return (packed & ENTRY_LIGHT) != 0 || (packed & 3u << ENTRY_CHANNEL) == 0;
}

#if VOLUME
// An entry that takes all that rests out of the chain as it began. Near the sides of the volume it fades into the chain
// of single fields, which comes before it.
void take_volume(Vertex vertex, float t_start[CHAIN], inout float t[CHAIN]) {
    vec4 first = sky_quad(3 * CHANNEL_QUADS);      // the first node, 1 / step
    vec4 counts = sky_quad(3 * CHANNEL_QUADS + 1); // nodes along each axis, and where they begin
    vec3 last = counts.xyz - 1.0;
    vec3 at = (vertex.receiver - first.xyz + vertex.position) * first.w;
    vec3 depth = min(at, last - at);
    float share = smoothstep(0.0, 1.0, min(min(depth.x, depth.y), depth.z));
    FieldPlace place = simplex(clamp(at, vec3(0.0), last), last - 1.0, vec3(1.0, counts.x, counts.x * counts.y), 0.0,
                               FIELD_UNIT);
    float b[COEFFICIENTS];
    field_gather(place, VOLUME_UNIT * uint(counts.w), CHANNEL_QUADS, b);
    float through[CHAIN] = t_start;
    chain_multiply(through, b);
    [[unroll]] for (uint k = 0; k < TERMS; k++) {
        t[k] = mix(t[k], through[k], share);
    }
    t[TERMS] = chain_rest(t);
}
#endif

#if SHEETS
// An entry that takes a sheet.
void take_sheet(Vertex vertex, uint packed, inout float t[CHAIN]) {
    Entity entity = ENTITY(packed & SKY_CHAIN);
    vec3 centre = entity.centre.xyz - vertex.receiver;
    Sheet sheet = sheet_of(entity, centre, vertex.position, vertex.normal, vertex.contact);
    float weight = sheet_above_horizon(sheet, vertex.normal) * entity.opacity;
#if LIGHTS
    uint l = packed >> ENTRY_BITS & SKY_CHAIN;
    vec4 light = ENTITY(l == SKY_CHAIN ? packed & SKY_CHAIN : l).centre;
    light.xyz -= vertex.receiver;
    float before = sheet_before(sheet, cone_of(light, vertex.position), light.w);
    weight *= l == SKY_CHAIN ? 1.0 : before;
#endif
    float b[COEFFICIENTS];
    sheet_blocked(sheet, b);
    [[unroll]] for (uint k = 0; k < SHEET_COEFFICIENTS; k++) {
        b[k] *= weight;
    }
    chain_multiply(t, b);
}
#endif

void main() {
    Cluster cluster = cluster_at(gl_WorkGroupID.x);
    uint v = gl_LocalInvocationID.x;
    if (v >= cluster.vertex_count) {
        return;
    }
    // The chains of sharp lights are another pass's.
    cluster.entry_first += cluster.sharp_count;
    cluster.entry_count -= cluster.sharp_count;
    Entity receiver = ENTITY(cluster.receiver);
    uint at = 2 * (cluster.vertex_first + v);
    vec3 position = vertex_quad(at).xyz; // object frame, metres, from the bounding sphere's centre
    vec3 normal = vertex_quad(at + 1).xyz;
    // World axes, but from the receiver's centre: far from the world's origin f32 positions would be too coarse.
    position = receiver.scale * to_world(receiver, position);
    normal = to_world(receiver, normal);

    float through[COEFFICIENTS];
    if (cluster.transfer_first == NONE) {
        sh_cosine(normal, through);
    } else {
        transfer(cluster.transfer_first + v * CHANNEL_QUADS, receiver, through);
    }
    float t_start[CHAIN];
    chain_begin(through, t_start);
    float t[CHAIN] = t_start;
    vec3 sum = vec3(0.0);
    // Nothing may be read without an entry: the scene may have no field at all.
    if (cluster.entry_count > 0) {
        Vertex vertex = Vertex(receiver.centre.xyz, position, normal, CONTACT / receiver.centre.w);
        uint i = 0;
        uint packed = entry_at(cluster.entry_first);
        // Loops are tested at the end: llvmpipe runs a body once more, masked, before a test at the start ends the
        // loop. It jumps nowhere else, so entries of either kind run as loops of their own, each in turn as long as
        // there are such entries.
        do {
#if SKIP_CAPS || SHEETS || VOLUME
            do {
                if (is_look(packed)) {
                    look(vertex, packed, t_start, t, sum);
                    i++;
                    packed = entry_at(cluster.entry_first + min(i, cluster.entry_count - 1));
                }
            } while (i < cluster.entry_count && is_look(packed));
#if SKIP_CAPS
            do {
                if (i < cluster.entry_count && is_kind(packed, ENTRY_CAP)) {
                    cover(vertex, packed, t);
                    i++;
                    packed = entry_at(cluster.entry_first + min(i, cluster.entry_count - 1));
                }
            } while (i < cluster.entry_count && is_kind(packed, ENTRY_CAP));
#endif
#if SHEETS
            do {
                if (i < cluster.entry_count && is_kind(packed, ENTRY_SHEET)) {
                    take_sheet(vertex, packed, t);
                    i++;
                    packed = entry_at(cluster.entry_first + min(i, cluster.entry_count - 1));
                }
            } while (i < cluster.entry_count && is_kind(packed, ENTRY_SHEET));
#endif
#if VOLUME
            if (i < cluster.entry_count && is_kind(packed, ENTRY_VOLUME)) {
                take_volume(vertex, t_start, t);
                i++;
                packed = entry_at(cluster.entry_first + min(i, cluster.entry_count - 1));
            }
#endif
#else
            look(vertex, entry_at(cluster.entry_first + i), t_start, t, sum);
            i++;
#endif
        } while (i < cluster.entry_count);
    }

    chain_end(t, through);
#if KEEPS
    keep(through, cluster.radiosity_first + v);
#endif
    [[unroll]] for (uint channel = 0; channel < 3; channel++) {
        [[unroll]] for (uint k = 0; k < COEFFICIENTS; k++) {
            sum[channel] += sky_quad(channel * CHANNEL_QUADS + k / 4)[k % 4] * through[k];
        }
    }
    radiosity[cluster.radiosity_first + v] = vec4(sum * receiver.albedo, 0.0);
}
