#version 460
#extension GL_EXT_control_flow_attributes : require
// Distant and bounced light that glossy surfaces reflect towards the eye, a workgroup's worth of an entity's vertices at
// a time. The merge has left the transfer past everything at each vertex; what the eye sees of it needs no merge.
//
// The share of distant light that gets through is that of the lobe over the cosine: <M T, lobe> over <M C, lobe>, where
// M is the product by the sky's radiance, T the transfer past everything and C the cosine.
#include "generated/gloss_structs.glsl"
#include "generated/basis.glsl"
#include "generated/cosine.glsl"

layout(local_size_x = WORKGROUP) in;

layout(std430, binding = 0) readonly buffer GlossEntities { GlossEntity entities[]; };
layout(std430, binding = 1) readonly buffer Clusters { uvec2 clusters[]; }; // entity, first of its vertices
#include "readable.glsl"
READ_VEC4(2, Vertices, vertices, vertex_quad)
layout(std430, binding = 3) readonly buffer Through { uvec4 through[]; }; // of every vertex: sixteen halves
layout(std140, binding = 4) uniform Products { vec4 products[3 * COEFFICIENTS * COEFFICIENTS / 4]; };
READ_VEC4(7, Direct, direct, direct_at)
READ_VEC4(8, Radiosity, radiosity, radiosity_at)
layout(std430, binding = 9) writeonly buffer Reflected { vec4 reflected[]; }; // two a vertex
#if LINKS
#include "links.glsl"
READ_UVEC2(10, Ranges, ranges, range_at) // first link, and how many
READ_UINT(11, Links, links, link_at)
READ_VEC4(12, RunLight, run_light, run_light_at)
READ_VEC4(13, RunPlaces, run_places, run_place_at) // two a run, of which the first is its middle, and whether it rests
#endif
#define MAP_BINDING 5
#define TABLE_BINDING 6
#define SKY 1
#include "gloss.glsl"

// The lobe over the cosine, as coefficients, and the sum of its taps' weights.
float lobe_over_cosine(View view, float roughness, out float lobe[COEFFICIENTS]) {
    float whole = 0.0;
    [[unroll]] for (uint i = 0; i < COEFFICIENTS; i++) {
        lobe[i] = 0.0;
    }
    for (uint k = 0; k < TAPS; k++) {
        Tap tap = tap_of(view, roughness, k);
        vec3 bands = lobe_row(TAPS + k, roughness, view.z).xyz;
        float y[COEFFICIENTS];
        sh_basis(tap.toward, y);
        float weight = tap.weight / max(dot(tap.toward, view.normal), LEAST_COSINE);
        [[unroll]] for (uint i = 0; i < COEFFICIENTS; i++) {
            lobe[i] += weight * (i == 0 ? 1.0 : i < 4 ? bands.x : i < 9 ? bands.y : bands.z) * y[i];
        }
        whole += tap.weight;
    }
    return whole;
}

// What of the light around a vertex its lobe sees.
struct Seen {
    vec3 sky;     // share of distant light of each colour that gets through
    float hidden; // share of the lobe that something stands before
    float nearby; // factor on the mean radiance over the cosine of what stands there
};

Seen seen_by(View view, float roughness, uint v) {
    float lobe[COEFFICIENTS], cosine[COEFFICIENTS], t[COEFFICIENTS];
    float whole = lobe_over_cosine(view, roughness, lobe);
    sh_cosine(view.normal, cosine);
    [[unroll]] for (uint i = 0; i < COEFFICIENTS; i++) {
        t[i] = unpackHalf2x16(through[2 * v + i / 8][i / 2 % 4])[i % 2];
    }
    float through_lobe = 0.0, open_lobe = 0.0;
    [[unroll]] for (uint i = 0; i < COEFFICIENTS; i++) {
        through_lobe += t[i] * lobe[i];
        open_lobe += cosine[i] * lobe[i];
    }
    float hidden = 1.0 - clamp(through_lobe / max(open_lobe, LEAST_SHARE * whole), 0.0, 1.0);
    float hidden_cosine = 1.0 - clamp(t[0] / cosine[0], 0.0, 1.0);
    Seen seen;
    seen.hidden = hidden;
    seen.nearby = min(hidden / max(hidden_cosine, LEAST_HIDDEN), MOST_NEARBY);
    for (uint channel = 0; channel < 3; channel++) {
        uint first = channel * COEFFICIENTS * COEFFICIENTS / 4;
        float met = 0.0, open = 0.0;
        [[unroll]] for (uint row = 0; row < COEFFICIENTS; row++) {
            float sum = 0.0;
            [[unroll]] for (uint quad = 0; quad < COEFFICIENTS / 4; quad++) {
                vec4 four = products[first + row * COEFFICIENTS / 4 + quad];
                sum += four.x * lobe[4 * quad] + four.y * lobe[4 * quad + 1]
                     + four.z * lobe[4 * quad + 2] + four.w * lobe[4 * quad + 3];
            }
            met += sum * t[row];
            open += sum * cosine[row];
        }
        // The first product is the mean radiance.
        float share = met / max(open, LEAST_SHARE * products[first].x * whole + 1e-30);
        seen.sky[channel] = clamp(share, 0.0, MOST_SHARE);
    }
    return seen;
}

#if LINKS
// Light along a vertex's links, of what rests.
struct Linked {
    vec3 mean;   // over the hemisphere, by the cosine
    vec3 lobe;   // mean over what stands there, by the lobe
    float whole; // what the lobe reflects of unit light from there
};

Linked linked_light(View view, vec3 place, uint v) {
    uvec2 range = range_at(v);
    vec3 sum = vec3(0.0), weighed = vec3(0.0);
    float whole = 0.0;
    for (uint k = range.x; k < range.x + link_count(range); k++) {
        uint packed = link_at(k);
        uint run = link_number(packed);
        vec3 light = run_light_at(run).rgb;
        vec4 middle = run_place_at(2 * run);
        float share = middle.w * link_share(packed);
        vec3 along = middle.xyz - place;
        along *= inversesqrt(max(dot(along, along), 1e-30));
        float lit = max(dot(view.normal, along), LEAST_COSINE);
        float weight = PI * share * lobe_of_part(view, along, lit, PI * share / lit);
        sum += share * light;
        weighed += weight * light;
        whole += weight;
    }
    return Linked(sum, weighed / max(whole, 1e-30), whole);
}
#endif

void main() {
    uvec2 cluster = clusters[gl_WorkGroupID.x];
    GlossEntity entity = entities[cluster.x];
    uint v = cluster.y + gl_LocalInvocationID.x;
    if (v >= entity.vertex_count) {
        return;
    }
    vec4 place = vec4(vertex_quad(2 * (entity.vertex_first + v)).xyz, 1.0);
    vec3 normal = vertex_quad(2 * (entity.vertex_first + v) + 1).xyz;
    vec3 from_eye = vec3(dot(entity.row_x, place), dot(entity.row_y, place), dot(entity.row_z, place));
    normal = vec3(dot(entity.row_x.xyz, normal), dot(entity.row_y.xyz, normal), dot(entity.row_z.xyz, normal));
    View view = view_of(from_eye, normal, entity.roughness);
    v += entity.radiosity_first;
    Seen seen = seen_by(view, entity.roughness, v);
    vec3 share = seen.sky;
    vec2 of_unit = reflected_share(view, entity.roughness);
    float energy = of_unit.x + of_unit.y;
    // Light that has bounced: its irradiance over pi.
    vec3 bounced = max(radiosity_at(v).rgb - direct_at(v).rgb, vec3(0.0)) / max(entity.albedo, vec3(1e-4));
#if LINKS
    // What moves keeps some of that along the links back. Its own comes alike from all that stands before the sky.
    Linked linked = linked_light(view, entity.eye + from_eye, v);
    vec3 kept = clamp(bounced / max(linked.mean, vec3(1e-20)), vec3(0.0), vec3(1.0));
    if (entity.sky_scale == 0.0) {
        // Without a sky nothing knows what hides it.
        seen.hidden = min(linked.whole / energy, 1.0);
        seen.nearby = 1.0;
    }
    bounced = seen.hidden * kept * linked.lobe + seen.nearby * max(bounced - linked.mean, vec3(0.0));
#else
    bounced *= seen.nearby;
#endif
    if (entity.roughness < PIXEL_ROUGHNESS || entity.textured != 0) {
        reflected[2 * v] = vec4(share * entity.sky_scale, energy);
        reflected[2 * v + 1] = vec4(bounced, 0.0);
    } else {
        Reflection sky = reflect_sky(view, entity.roughness);
        reflected[2 * v] = vec4(share * entity.sky_scale * sky.facing + of_unit.x * bounced, energy);
        reflected[2 * v + 1] = vec4(share * entity.sky_scale * sky.grazing + of_unit.y * bounced, 0.0);
    }
}
