// Light that a surface receives from sharp lights, past what is listed before each of them. The twin is
// src/sharp/twin.rs.
#include "sub_light.glsl"
#if OUTLINES
#include "area.glsl"
#endif

// SwiftShader takes minutes and gigabytes to compile what others need unrolled.
#if ROLLED
#define EACH [[dont_unroll]]
#else
#define EACH [[unroll]]
#endif

const uint BLOCKS = 5; // of a light: the whole, and its quarters

// What is of one block. SwiftShader takes wrong elements of an array where lanes ask for different ones; on lavapipe lanes
// that leave a loop before others lose what no array holds.
#if ROLLED
vec4 of_block(vec4 all[BLOCKS], uint b) {
    vec4 found = all[0];
    [[unroll]] for (uint k = 1; k < BLOCKS; k++) {
        found = k == b ? all[k] : found;
    }
    return found;
}

void set_block(inout vec4 all[BLOCKS], uint b, vec4 value) {
    [[unroll]] for (uint k = 0; k < BLOCKS; k++) {
        all[k] = k == b ? value : all[k];
    }
}
#else
#define of_block(all, b) all[b]
#define set_block(all, b, value) all[b] = value
#endif

#if SHOWN || PANELS || HIDES
float open_share; // irradiance by the current light's parts with nothing between, of radiance 1
#endif

#if SHOWN
// Shares of the lights that the receiver's highlights are of: how much of each arrives of what an open place would have.
uvec4 shown_lights[SHOWN_QUADS]; // entities, or NONE
vec4 shown_shares[SHOWN_QUADS];

void note_share(uint light, float irradiance) {
    vec4 share = vec4(irradiance / max(open_share, 1e-30));
    EACH for (uint q = 0; q < SHOWN_QUADS; q++) {
        shown_shares[q] = mix(shown_shares[q], share, equal(shown_lights[q], uvec4(light)));
    }
}
#endif

#if LAMPS
float lamps = 0.0; // share of the cosine-weighted view that moving lamps take, which light that leaves cannot pass
#endif

#if EDGES
// Vertices, and pixels that are evaluated for their neighbours too, carry a shadow's edge badly where its penumbra is
// narrow against the distance to the next. The error grows with the square of that distance over the penumbra's width,
// and with the light that the shadow takes away. They carry the light around a lamp badly that is as near as the next.
float finest;       // distance over width, for the narrowest penumbra of the current light that comes as near as the next vertex, or 0
float missed = 0.0; // most, over all lights, of what vertices miss of one: `add_open`
float open_light = 0.0; // of all lights: nothing between, or what arrives of those that are blended
float curved;       // irradiance by the current light, each part's by the square of the step over its distance, of radiance 1

// What vertices may miss of a light on a surface that sends out `soft` light besides that of all lights.
float tolerable_miss(vec3 albedo, vec3 soft) {
    float white = dot(albedo, vec3(1.0));
    float all = white > 0.0 ? open_light + dot(soft, vec3(1.0)) / white : EVERYTHING;
    return all / (EDGE_STEPS * EDGE_STEPS);
}

// A bit for occluders that take any of the current light or whose edges are near, shared by those whose numbers leave the
// same rest: with BLENDS as the vertices of a pixel's triangle tell them, else as this vertex finds them.
uint near_occluders;

uint occluder_bit(uint packed) {
    return 1u << (packed & 31u);
}
#endif

// Which way a vertex faces, and what its own mesh leaves of its view.
struct Facing {
    vec3 normal;  // world
    float weight; // of this vertex in the surface's point
#if SELF
    uint self_first;  // first cell of its self-visibility, or NONE
    bool counts;      // whether its self-visibility goes with the list of occluders
    mat3 self_frame;  // about the normal, world
#if FACINGS > 1
    vec3 aside;       // of the vertex from the surface's point, world axes, metres
#endif
#endif
};

#define MAPS (SUN_MAPS || LAMP_MAPS)
#if LAMP_MAPS || MAPS && BLENDS
#define LOOKS_UP_MAPS 1
const mat2 NEXT_TAP = mat2(-0.7373688, 0.6754903, -0.6754903, -0.7373688); // the golden angle
#if SUN_MAPS && BLENDS
#include "sun_map.glsl"
#endif
#if LAMP_MAPS
#include "lamp_map.glsl"
#endif
uint current_map; // bit of the current light's map, or 0
#endif

struct Surface {
    vec3 position; // world axes, metres from `origin`
    vec3 origin;   // world
    float inverse_radius; // 1 over the bounding radius of its object, 1/m
    Facing facings[FACINGS];
#if EDGES
    float step;    // farthest that a neighbouring vertex or pixel is, metres
#endif
#if LOOKS_UP_MAPS
    vec3 ground;   // normal of the triangle, world
    vec3 lifted;   // to the round surface that the triangle stands for (Hanika, Ray Tracing Gems II, chapter 4), metres
    bool is_round; // whether it stands for one
    uint light_maps; // that its object stands in
#endif
};

// The facing of vertex `v` of a mesh. `normal` is in the object's frame; `self_first` is the first cell of the mesh's
// first vertex, or NONE.
Facing facing_of(Entity receiver, vec3 normal, float weight, uint self_first, uint v) {
    Facing facing;
    facing.normal = to_world(receiver, normal);
    facing.weight = weight;
#if SELF
    facing.counts = true;
    facing.self_first = self_first == NONE ? NONE : self_first + v * ((SELF_SIDE - 1) * (SELF_SIDE - 1));
    mat3 frame = surface_axes(normal);
    facing.self_frame = mat3(to_world(receiver, frame[0]), to_world(receiver, frame[1]), facing.normal);
#endif
    return facing;
}

// Rays from a point to the parts of a block, by the light's axes and in an object's r.
struct Rays {
    mat3 axes;  // of the light, in the object's frame
    vec3 place; // of the point, from the object's centre
    vec3 middle;
    vec3 along[4];
    vec3 foot[4]; // places on them that are nearest to the centre
    vec4 offset;  // of the point along each
};

// The outline of an object's side near each ray: signed distance, and how far away it lies, in r.
void outlines(Rays rays, NodeCell cell, vec4 weights[4], uint side, out vec4 distance, out vec4 away) {
    distance = vec4(0.0);
    away = -rays.offset;
    EACH for (uint m = 0; m < 4; m++) {
        NearMap near = near_map(cell, m, side, rays.axes, rays.place - dot(rays.place, rays.middle) * rays.middle);
        EACH for (uint k = 0; k < 4; k++) {
            vec2 found = weights[k][m] * outline(near, side, rays.along[k], rays.foot[k]);
            distance[k] += found.x;
            away[k] += found.y;
        }
    }
}

#if EDGES
// `penumbra`: half its width from a part; `parts`: how many times as wide the light is.
void find_edge(float distance, float away, float limit, float penumbra, float parts, float step) {
    bool stands = away > -NEAREST - step && away < limit + NEAREST + step;
    // From one vertex to the next the ray turns about the light: what is near that moves little.
    step *= clamp(1.0 - away / max(limit, 1e-30), 0.0, 1.0);
    bool near = stands && abs(distance) < penumbra + EDGE_REACH * step;
    finest = max(finest, near ? min(step / (parts * penumbra), MOST_STEPS) : 0.0);
}

// The rim of a spot's cone is an edge as that of a penumbra is. `step`: angle between two vertices as the light sees
// them.
void find_rim(float ramp, Entity shining, float step) {
    float cosine = (ramp - shining.light_ramp.y) / max(shining.light_ramp.x, 1e-30);
    float change = shining.light_ramp.x * sqrt(max(1.0 - cosine * cosine, 0.0)) * step;
    bool near = ramp > -EDGE_REACH * change && ramp < 1.0 + EDGE_REACH * change;
    finest = max(finest, near ? min(2.0 * change, MOST_STEPS) : 0.0);
}

// Notes an occluder that leaves so much of a block's parts and has its nearest edge at `finest`.
void note_occluder(uint packed, vec4 free, uint b, inout uint covered, inout float nearest) {
#if KEEPS
    bool matters = finest > 0.0 || free != vec4(1.0);
    near_occluders |= matters ? occluder_bit(packed) : 0;
#endif
    covered |= finest == 0.0 && free == vec4(0.0) ? 1u << b : 0;
    nearest = max(nearest, finest);
}

// Adds a light to all, of `white` radiance in three channels together; returns what vertices miss of it.
float add_open(float irradiance, float white) {
    float miss = white * max(min(finest * finest, MOST_MISS) * irradiance, NEAR_LIGHT * curved);
    open_light += white * irradiance;
    missed = max(missed, miss);
    return miss;
}
#endif

#if KEEPS || BLENDS
const float LEAST_KEPT = 1e-30; // of what is not dark
#endif

#if KEEPS
// What vertices miss of a light, in sixteenths of an octave; 0 for nothing.
const uint MISS_BITS = 12;
const uint ALL_MISS = (1u << MISS_BITS) - 1u;
const float LEAST_OCTAVE = -110.0;

uint pack_miss(float miss) {
    float sixteenths = clamp(16.0 * (log2(max(miss, 1e-30)) - LEAST_OCTAVE), 1.0, float(ALL_MISS));
    return miss > 0.0 ? uint(sixteenths) : 0;
}

bool is_missed(uint packed, float tolerable) {
    return packed > 0 && exp2(float(packed) / 16.0 + LEAST_OCTAVE) > BLENDED_MISS * tolerable;
}

// Keeps the irradiance by a light of radiance 1 for pixels around the vertex, and the bits of occluders. Until all lights
// are known, the last bits hold what vertices miss of it, and those before what they might of a light that is dark.
void keep(Entity shining, bool dark, float irradiance, float miss, float might_miss) {
    if (shining.irradiance_first != NONE) {
        uint known = dark ? pack_miss(might_miss) << MISS_BITS : floatBitsToUint(max(irradiance, LEAST_KEPT)) & ~ALL_MISS;
        irradiances[shining.irradiance_first + kept_vertex] = uvec2(known | pack_miss(miss), near_occluders);
    }
}

// Once all lights are known: what is kept becomes the irradiance, below zero where pixels need to evaluate the light. In
// the dark it is 0, unless the light is so faint that it does not matter beside a vertex that is lit.
void settle_kept(float tolerable) {
    for (uint l = 0; l < push.kept_lights; l++) {
        uint at = l * push.all_vertices + kept_vertex, kept = irradiances[at].x;
        bool dark = kept < 1u << 2 * MISS_BITS;
        bool might = kept == 0 || is_missed(kept >> MISS_BITS & ALL_MISS, tolerable);
        float lit = dark ? LEAST_KEPT : uintBitsToFloat(kept & ~ALL_MISS);
        bool needed = is_missed(kept & ALL_MISS, tolerable);
        irradiances[at].x = needed ? floatBitsToUint(-lit) : dark && might ? 0 : floatBitsToUint(lit);
    }
}
#endif

#if BLENDS
// Irradiance by a light of radiance 1 between the vertices of a pixel's triangle. Returns whether they carry it well:
// it has one colour, none of them needs pixels to evaluate it, and it is dark for all of them or for none.
bool blended_irradiance(Entity shining, out float irradiance) {
    bool is_kept = shining.irradiance_first != NONE;
    uvec3 at = is_kept ? lit_vertices + shining.irradiance_first : uvec3(0);
    uvec2 a = texelFetch(irradiances, int(at.x)).xy, b = texelFetch(irradiances, int(at.y)).xy;
    uvec2 c = texelFetch(irradiances, int(at.z)).xy;
    near_occluders = is_kept ? a.y | b.y | c.y : ~0u;
    vec3 kept = uintBitsToFloat(uvec3(a.x, b.x, c.x));
    irradiance = dot(vertex_weights, kept);
    float least = min(min(kept.x, kept.y), kept.z), most = max(max(kept.x, kept.y), kept.z);
    bool blends = is_kept && (least > 0.0 || least == 0.0 && most <= LEAST_KEPT);
#if COLORS
    blends = blends && shining.radiance_base == NONE;
#endif
    return blends;
}
#endif

#if HALVES
// Whether a place is outside of an object's bounding sphere, with a ramp.
float outside_ball(vec3 place) {
    return clamp((length(place) - INSIDE_FROM) / (INSIDE_TO - INSIDE_FROM), 0.0, 1.0);
}
#endif

// The share of each part of a block that an occluder lets through. With `before` only what lies before the light
// counts; without it the occluder is the light itself, and its own outline counts.
vec4 let_through(Entity occluder, Surface surface, SeenLight light, Block block, bool before) {
    Rays rays;
    rays.axes = mat3(to_object(occluder, light.toward), to_object(occluder, light.across), to_object(occluder, light.down));
    // From the light's own centre the point lies on the first axis.
    vec3 to = surface.position - (occluder.centre.xyz - surface.origin);
    rays.place = before ? to * mat3(light.toward, light.across, light.down) : vec3(-light.distance, 0.0, 0.0);
    rays.place *= occluder.centre.w;
    rays.middle = along_axes(light, block.middle);
    uint first = occluder.silhouette, field = first & ~HAS_HALVES;
    NodeCell cell = node_cell(field, rays.axes * rays.middle);
    vec3 place = rays.axes * rays.place;
    vec2 in_box[4];
    vec4 weights[4];
    vec4 limit, tangent;
    EACH for (uint k = 0; k < 4; k++) {
        vec2 part = part_place(light, block, k);
        rays.along[k] = along_axes(light, part);
        rays.offset[k] = dot(rays.place, rays.along[k]);
        rays.foot[k] = rays.place - rays.offset[k] * rays.along[k];
        vec3 direction = rays.axes * rays.along[k];
        weights[k] = node_weights(cell, direction);
        in_box[k] = vec2(-NO_BOX, NO_BOX);
#if BOXES
        if (first < HAS_HALVES) {
            in_box[k] = box_slabs(field, place, direction);
        }
#endif
        limit[k] = before ? reach_of(light, part, rays.along[k]) * occluder.centre.w : EVERYTHING;
        float sine = part_sine(light, block, part, rays.along[k]);
        tangent[k] = sine * inversesqrt(1.0 - sine * sine);
    }
#if BOXES
    uint faces = first < HAS_HALVES ? face_count(field) : 0;
    for (uint face = 0; face < faces; face++) {
        vec4 plane = face_plane(field, face);
        vec3 normal = plane.xyz * rays.axes;
        EACH for (uint k = 0; k < 4; k++) {
            in_box[k] = cut_by_face(in_box[k], dot(normal, rays.along[k]), plane.w - dot(plane.xyz, place));
        }
    }
    EACH for (uint k = 0; k < 4; k++) {
        in_box[k] = if_met(in_box[k]);
    }
#endif
    vec4 inside = vec4(0.0), all = vec4(0.0);
    bool behind = false; // whether the box lies behind the point
#if HALVES
    // Within the bounding sphere each half of the object counts as far as its outline lies between the point and the
    // light, unless all of its box does before a light outside, or its box lies behind the point.
    if (before && first >= HAS_HALVES) {
        vec2 box = if_met(box_slabs(field, place, rays.axes * rays.middle));
        behind = box[1] < TOUCHING;
        float outside = outside_ball(rays.place);
        EACH for (uint k = 0; k < 4; k++) {
            float end_outside = outside_ball(rays.place + limit[k] * rays.along[k]);
            float deep = max(rays.offset[k], -rays.offset[k] - limit[k]);
            vec2 ends = box_ends(box, limit[k]);
            all[k] = ends.x * ends.y * end_outside;
            inside[k] = (1.0 - min(outside, end_outside)) * clamp((deep - DEEP_FROM) / (DEEP_TO - DEEP_FROM), 0.0, 1.0);
            inside[k] *= behind ? 0.0 : 1.0 - all[k];
        }
    }
#endif
    // For each side, the share that it blocks and how far its outline counts. These are arrays, because on lavapipe a
    // lane that leaves a loop before others may lose what it has computed there, unless it is stored.
    vec4 share[3], counts[3];
    uint side = WHOLE;
    uint last = inside == vec4(0.0) ? WHOLE : NEAR;
    // A loop, because a software device runs a branch that no lane takes.
    do {
        vec4 distance, away, blocks, stands;
        outlines(rays, cell, weights, side, distance, away);
        EACH for (uint k = 0; k < 4; k++) {
            blocks[k] = share_blocked(distance[k], away[k], NEAREST, tangent[k]);
            float deeper = side == WHOLE ? 0.0 : side == FAR ? HALF_DEPTH : -HALF_DEPTH;
            stands[k] = counts_between(away[k], limit[k] - deeper, in_box[k]);
#if EDGES
            if (before && (side == WHOLE || inside[k] > 0.0)) {
                float penumbra = max(away[k], NEAREST) * max(tangent[k], LEAST_PENUMBRA);
                find_edge(distance[k], away[k], limit[k], penumbra, inversesqrt(block.area), surface.step * occluder.centre.w);
            }
#endif
        }
        share[side] = blocks;
        counts[side] = stands;
        side++;
    } while (side <= last);
    counts[WHOLE] = behind ? vec4(0.0) : max(counts[WHOLE], all);
    vec4 blocked_by = share[WHOLE] * counts[WHOLE];
#if HALVES
    if (last != WHOLE) {
        // Where both halves count, the whole does.
        vec4 halves = counts[FAR] * counts[NEAR] * share[WHOLE] + counts[FAR] * (1.0 - counts[NEAR]) * share[FAR]
                    + counts[NEAR] * (1.0 - counts[FAR]) * share[NEAR];
        blocked_by = mix(blocked_by, halves, inside);
    }
#endif
    return 1.0 - (before ? occluder.opacity : 1.0) * blocked_by;
}

// Irradiance by the parts of a block, unoccluded, of radiance 1.
vec4 part_shares(Surface surface, SeenLight light, Block block) {
    mat3 axes = mat3(light.toward, light.across, light.down);
    vec4 share;
    EACH for (uint k = 0; k < 4; k++) {
        vec2 part = part_place(light, block, k);
        vec3 along = along_axes(light, part);
        vec3 direction = axes * along;
        float sine = part_sine(light, block, part, along);
        float reach = reach_of(light, part, along);
        float sum = 0.0;
#if SELF && FACINGS > 1
        vec2 counted = vec2(0.0); // of the facings that count: past their self-visibility, and without
#endif
#if SHOWN || PANELS || HIDES
        float open = 0.0;
#endif
        EACH for (uint i = 0; i < FACINGS; i++) {
            Facing facing = surface.facings[i];
            float cosine = part_cosine(dot(facing.normal, direction), sine);
#if SHOWN || PANELS || HIDES
            open += facing.weight * cosine;
#endif
#if SELF
            // A part's radius is small enough for its sine to stand for it.
            bool shadows = facing.self_first != NONE;
#if LOOKS_UP_MAPS
            shadows = shadows && (surface.light_maps & current_map) == 0;
#endif
            vec3 toward = direction;
            float far = reach;
#if FACINGS > 1
            // A map holds for its vertex: there a wall beside the lamp is as far away as it says.
            toward = reach * direction - facing.aside;
            far = length(toward);
            toward /= max(far, 1e-30);
#endif
            float sees = self_visible(shadows ? facing.self_first : 0, facing.self_frame, toward, sine,
                                      far * surface.inverse_radius);
#if FACINGS > 1
            counted += facing.counts ? facing.weight * cosine * vec2(shadows ? sees : 1.0, 1.0) : vec2(0.0);
#else
            cosine *= shadows ? sees : 1.0;
#endif
#endif
            sum += facing.weight * cosine;
        }
#if SELF && FACINGS > 1
        // The others stand in the shadow of those.
        sum *= counted.y > 0.0 ? counted.x / counted.y : 1.0;
#endif
        float unit = block.weight * part_light(light, block, part, along);
        share[k] = unit * sum;
#if EDGES
        float steps = surface.step / max(reach, 1e-30);
        curved += share[k] * min(steps * steps, 1.0);
#endif
#if SHOWN || PANELS || HIDES
        open_share += unit * open;
#endif
    }
    return share;
}

#if PANELS
// What an edge from `a` to `b` adds to the irradiance of a surface at the origin by a polygon of radiance 1: half of the
// angle it fills, times the cosine of its plane's normal to the surface's (Lambert, Photometria, 1760). The angle over
// its sine is a fit (Heitz and Hill, Real-Time Area Lighting: a Journey from Research to Production, SIGGRAPH 2016
// course), which errs by 2e-6.
float edge_light(vec3 a, vec3 b, vec3 normal) {
    a /= max(length(a), 1e-30);
    b /= max(length(b), 1e-30);
    float cosine = dot(a, b), x = abs(cosine);
    float half_angle = PI * (0.8543985 + (0.4965155 + 0.0145206 * x) * x) / (3.4175940 + (4.1616724 + x) * x);
    half_angle = cosine > 0.0 ? half_angle : PI * 0.5 * inversesqrt(max(1.0 - x * x, 1e-7)) - half_angle;
    return half_angle * dot(cross(a, b), normal);
}

// Irradiance by a rectangle of which a surface sees what is above its horizon; its normal is given by the light's axes.
float rectangle_light(SeenLight light, vec3 normal) {
    float sum = 0.0;
    vec3 leaves = vec3(0.0), enters = vec3(0.0); // where the outline crosses the horizon
    EACH for (uint k = 0; k < 4; k++) {
        vec3 middle = vec3(light.distance, 0.0, 0.0);
        vec3 a = middle + light.half_edges * vec2(k == 0 || k == 3 ? -1.0 : 1.0, k < 2 ? -1.0 : 1.0);
        vec3 b = middle + light.half_edges * vec2(k < 2 ? 1.0 : -1.0, k == 0 || k == 3 ? -1.0 : 1.0);
        float height_a = dot(a, normal), height_b = dot(b, normal);
        bool above_a = height_a > 0.0, above_b = height_b > 0.0;
        vec3 crossing = mix(a, b, above_a == above_b ? 0.0 : height_a / (height_a - height_b));
        float edge = edge_light(above_a ? a : crossing, above_b ? b : crossing, normal);
        sum += above_a || above_b ? edge : 0.0;
        leaves = above_a && !above_b ? crossing : leaves;
        enters = above_b && !above_a ? crossing : enters;
    }
    return abs(sum + edge_light(leaves, enters, normal));
}

// Light that a rectangle which is not thin sends where nothing is between, over that of its parts, which are coarse near
// by. Of a far one f32 leaves little.
float over_parts(Surface surface, SeenLight light) {
    mat3 axes = mat3(light.toward, light.across, light.down);
    float sum = 0.0;
    EACH for (uint i = 0; i < FACINGS; i++) {
        sum += surface.facings[i].weight * rectangle_light(light, surface.facings[i].normal * axes);
    }
    bool exact = is_rectangle(light) && light.ratio * THIN > 1.0 && light.ratio < THIN;
    return exact && open_share > 0.0 ? mix(1.0, sum / open_share, light.fine) : 1.0;
}
#endif

#if CUBOIDS
#include "sharp_cuboid.glsl"
#endif

#if SHEETS
#include "sharp_sheet.glsl"
#endif

uint chain_light(uint packed) {
    return packed >> ENTRY_BITS & SKY_CHAIN;
}

// Whether an entry is an occluder whose outline is looked up.
bool has_outline(uint packed) {
    return is_kind(packed, 0);
}

// Whether the ball of an entry's occluder reaches into the cone around all parts of its chain's light, as far as the
// light. `radius`: of the light's bounding sphere, metres.
bool may_block(uint packed, Surface surface, SeenLight light, float radius) {
    vec4 ball = ENTITY(packed & SKY_CHAIN).centre;
    vec3 to_ball = ball.xyz - surface.origin - surface.position;
    float sine = min(CONE_WIDER * light.sine, MOST_SINE);
    float reach = BALL_WIDER / ball.w;
#if EDGES
    reach += max(1.0, EDGE_REACH) * surface.step;
#endif
    float along = dot(to_ball, light.toward);
    float off = length(to_ball - along * light.toward);
    bool meets = along > -reach && along - reach < light.distance + radius
              && off * sqrt(1.0 - sine * sine) - max(along, 0.0) * sine < reach;
#if PANELS
    // Rays to a strip stay near the plane through its length, however wide the cone is.
    vec2 side = vec2(-light.half_edges[0].z, light.half_edges[0].y);
    side /= max(length(side), 1e-30);
    float wide = abs(dot(light.half_edges[1].yz, side)) + sqrt(light.area * (0.25 / PI));
    float aside = abs(dot(vec2(dot(to_ball, light.across), dot(to_ball, light.down)), side));
    meets = meets && (!is_rectangle(light) || aside < reach + CONE_WIDER * wide);
#endif
    return meets;
}

#if BOXES || HALVES || CUBOIDS
// Whether the same cone comes near the box around the occluder, which for most is much narrower than their ball. All that
// is neither an outline nor a box may be met.
bool may_cross(uint packed, Surface surface, SeenLight light, float radius) {
    Entity occluder = ENTITY(packed & SKY_CHAIN);
    vec3 place = surface.position - (occluder.centre.xyz - surface.origin);
    place = to_object(occluder, place) * occluder.centre.w;
    vec3 toward = to_object(occluder, light.toward);
    float margin = NEAREST;
#if EDGES
    margin += max(1.0, EDGE_REACH) * surface.step * occluder.centre.w;
#endif
    float sine = min(CONE_WIDER * light.sine, MOST_SINE);
    float limit = (light.distance + radius) * occluder.centre.w;
    float reach = clamp(BALL_WIDER + margin - dot(place, toward), 0.0, limit);
    margin += reach * sine * inversesqrt(1.0 - sine * sine);
    uint first = occluder.silhouette & ~HAS_HALVES;
    vec3 low = node_quad(first).xyz, high = node_quad(first + 1).xyz;
    float blur = BALL_WIDER - 1.0;
    bool is_box = is_kind(packed, ENTRY_CUBOID);
#if CUBOIDS
    vec3 third = node_quad(first + 2).xyz;
    vec3 halves = vec3(length(low), length(high), length(third));
    mat3 axes = is_box ? mat3(low / halves.x, high / halves.y, third / halves.z) : mat3(1.0);
    place = place * axes;
    toward = toward * axes;
    low = is_box ? -halves : low;
    high = is_box ? halves : high;
    blur = is_box ? 0.0 : blur;
#endif
    vec2 ends = slabs(low - margin - blur - place, high + margin + blur - place, toward);
    return ends.x <= ends.y && ends.y > 0.0 && ends.x < limit || !has_outline(packed) && !is_box;
}
#endif

// The first entry of a chain from `i` on that has to be evaluated: an occluder that may block, or the light at `end`.
// Values of this loop are read again behind it: on lavapipe a lane that leaves a loop early may lose what the loop does
// not carry.
uint next_entry(Surface surface, SeenLight light, float radius, uint i, uint end) {
    bool passes = false;
    do {
        do {
#if BLENDS
            // Few are marked.
            i = near_occluders == 0 ? end : i;
            bool unmarked = false;
            do {
                unmarked = i < end && (near_occluders & occluder_bit(entry_at(i))) == 0;
                i += unmarked ? 1 : 0;
            } while (unmarked);
#endif
            passes = i < end && !may_block(entry_at(i), surface, light, radius);
            i += passes ? 1 : 0;
        } while (passes);
#if BOXES || HALVES || CUBOIDS
        passes = i < end && !may_cross(entry_at(i), surface, light, radius);
        i += passes ? 1 : 0;
#endif
    } while (passes);
    return i;
}

// Irradiance by a light past the occluders of its chain, from entry `i` to the light's. Each kind of occluder has a loop of
// its own over all blocks: a software device runs the body of a loop once at least, whether any lane needs it or not.
vec3 chain_sum(Surface surface, uint i, uint end) {
    Entity shining = ENTITY(chain_light(entry_at(end)));
    SeenLight light = seen_light(shining.centre.xyz - surface.origin - surface.position, shining);
#if OUTLINES && BOXES
    if (shining.light_kind == LIGHT_OUTLINE && shining.silhouette < HAS_HALVES) {
        uint own = shining.silhouette;
        light.box[0] = node_quad(own).xyz / shining.centre.w;
        light.box[1] = node_quad(own + 1).xyz / shining.centre.w;
    }
#endif
    float radius = 1.0 / shining.centre.w;
#if KEEPS
    near_occluders = 0;
#endif
#if HIDES
    // Where the sun is hidden from all around, no edge of its shadow is looked for.
    uint told = told_suns & shining.sun_bits;
    bool is_hidden = (told & ALL_SUNS) != 0;
    bool hides_around = (told & ALL_SUNS << MOST_SUNS) != 0;
    i = hides_around ? end : i;
#endif
#if LOOKS_UP_MAPS
    current_map = shining.light_maps;
#endif
    uint first_block = light.fine >= 1.0 ? 1 : 0, last_block = light.fine <= 0.0 ? 0 : 4;
    // Irradiance by the parts of each block, all of which are added up whatever blocks a light has: on lavapipe lanes that
    // leave a loop before others lose the sum.
    vec4 shares[BLOCKS] = vec4[](vec4(0.0), vec4(0.0), vec4(0.0), vec4(0.0), vec4(0.0));
#if SHOWN || PANELS || HIDES
    open_share = 0.0;
#endif
    float unblocked = 0.0;
#if EDGES
    curved = 0.0;
    float nearest = 0.0; // `finest` of all occluders
    uint covered = 0; // a bit for every block that one occluder hides whose own edges are far
#endif
    // Loops are tested at their ends, as in the merge.
    uint b = first_block;
    do {
        vec4 share = part_shares(surface, light, block_of(light, b));
        set_block(shares, b, share);
        unblocked += dot(share, vec4(1.0));
        b++;
    } while (b <= last_block);
    float shines = shining.light_kind == LIGHT_BALL ? shining.light_size : 1.0;
    // Of a light below the horizon, or that its own mesh hides, nothing is left to block.
    i = unblocked > 0.0 ? next_entry(surface, light, radius, i, end) : end;
    uint packed = entry_at(i);
    bool own = false; // whether it is the light's own outline that is looked up, not an occluder's
#if OUTLINES
    // As much of each part shines as the outline covers, and from afar as the light's area.
    own = shining.light_kind == LIGHT_OUTLINE && last_block > 0;
    float far_share = shining.light_kind == LIGHT_OUTLINE ? area_share(shining, light.toward) : 1.0;
    set_block(shares, 0, far_share * of_block(shares, 0));
#endif
    b = own ? 1 : first_block;
    do {
        if (own || has_outline(packed)) {
#if EDGES
            finest = 0.0;
#endif
            uint occluder = own ? chain_light(entry_at(end)) : packed & SKY_CHAIN;
            vec4 free = let_through(ENTITY(occluder), surface, light, block_of(light, b), !own);
            set_block(shares, b, (own ? 1.0 - free : free) * of_block(shares, b));
#if EDGES
            if (!own) {
                note_occluder(packed, free, b, covered, nearest);
            }
#endif
            bool last = b == last_block;
            b = last ? first_block : b + 1;
            i = last && !own ? next_entry(surface, light, radius, i + 1, end) : i;
            own = own && !last;
            packed = entry_at(i);
        }
    } while (own || has_outline(packed));
#if SHEETS
    // All sheets before one block are put together first.
    uint sheets = i;
    SheetShadow shadow = no_shadow();
    b = first_block;
#if EDGES
    finest = 0.0;
#endif
    do {
        if (is_kind(packed, ENTRY_SHEET)) {
#if KEEPS
            vec4 free_before = shadow.free;
            nearest = max(nearest, finest);
            finest = 0.0;
#endif
            pass_sheet(shadow, ENTITY(packed & SKY_CHAIN), surface, light, block_of(light, b));
#if KEEPS
            near_occluders |= finest > 0.0 || shadow.free != free_before ? occluder_bit(packed) : 0;
#endif
            i = next_entry(surface, light, radius, i + 1, end);
            packed = entry_at(i);
            if (!is_kind(packed, ENTRY_SHEET)) {
                set_block(shares, b, shadow.free * of_block(shares, b));
                shadow = no_shadow();
                i = b < last_block ? sheets : i;
                packed = entry_at(i);
                b++;
            }
        }
    } while (is_kind(packed, ENTRY_SHEET));
#if EDGES
    nearest = max(nearest, finest);
#endif
#endif
#if CUBOIDS
    b = first_block;
    do {
        if (is_kind(packed, ENTRY_CUBOID)) {
#if EDGES
            finest = 0.0;
#endif
            vec4 free = past_cuboid(ENTITY(packed & SKY_CHAIN), surface, light, block_of(light, b));
            set_block(shares, b, free * of_block(shares, b));
#if EDGES
            note_occluder(packed, free, b, covered, nearest);
#endif
            bool last = b == last_block;
            b = last ? first_block : b + 1;
            i = last ? next_entry(surface, light, radius, i + 1, end) : i;
            packed = entry_at(i);
        }
    } while (is_kind(packed, ENTRY_CUBOID));
#endif
#if GLOBES
    do {
        if (is_kind(packed, ENTRY_GLOBE)) {
            shines *= 1.0 - ENTITY(packed & SKY_CHAIN).opacity;
#if KEEPS
            near_occluders |= occluder_bit(packed);
#endif
            i = next_entry(surface, light, radius, i + 1, end);
            packed = entry_at(i);
        }
    } while (is_kind(packed, ENTRY_GLOBE));
#endif
#if LAMP_MAPS
    if (current_map >= uint(LAMP_BIT)) {
        uint first = 4 * (findMSB(current_map) - findMSB(LAMP_BIT)), k = 0;
        vec3 place = surface.position + surface.lifted;
        vec3 ground = dot(surface.ground, surface.facings[0].normal) < 0.0 ? -surface.ground : surface.ground;
        mat2x3 edges = mat2x3(light.across, light.down) * (light.sine * light.distance);
        bool square = false;
#if PANELS
        mat3 axes = mat3(light.toward, light.across, light.down);
        square = is_rectangle(light);
        vec2 strip = light.ratio < 1.0 ? vec2(0.25, 1.0) : vec2(1.0, 0.25);
        vec2 scale = is_strip(light) ? strip : vec2(square ? 0.5 : 1.0);
        mat2x3 half_edges = mat2x3(axes * (scale.x * light.half_edges[0]), axes * (scale.y * light.half_edges[1]));
        edges[0] = is_panel(light) ? half_edges[0] : edges[0];
        edges[1] = is_panel(light) ? half_edges[1] : edges[1];
#endif
#if EDGES
        float step = surface.step;
#else
        const float step = 0.0;
#endif
        float seen[4] = float[](1.0, 1.0, 1.0, 1.0), most_steps[4] = float[](0.0, 0.0, 0.0, 0.0);
        uint parts;
        do {
            LampMap map = lamp_map_at(first + k);
            parts = unblocked > 0.0 ? map.parts : 0;
            float steps;
            seen[k] = lamp_share(map, k, place + (surface.origin - map.middle), ground, surface.is_round, edges, square,
                                 step, steps);
            most_steps[k] = steps;
            k++;
        } while (k < parts);
        bool whole = lamp_map_at(first).parts == 1; // read again behind the loop, as above
        vec4 open = vec4(seen[0], whole ? seen[0] : seen[1], whole ? seen[0] : seen[2], whole ? seen[0] : seen[3]);
        set_block(shares, 0, open * of_block(shares, 0));
        EACH for (uint part = 0; part < 4; part++) {
            set_block(shares, part + 1, open[part] * of_block(shares, part + 1));
        }
#if EDGES
        nearest = max(max(nearest, max(most_steps[0], most_steps[1])), max(most_steps[2], most_steps[3]));
#endif
    }
#endif
    float passed = 0.0;
#if COLORS
    bool has_colors = shining.radiance_base != NONE;
    vec3 toward = to_object(shining, light.toward), across = to_object(shining, light.across);
    vec3 down = to_object(shining, light.down), colored = vec3(0.0);
    mat3x4 colors = lamp_colors(has_colors ? shining.radiance_base : 0, toward, light.sine);
#endif
    b = 0;
    do {
        vec4 share = of_block(shares, b);
        passed += dot(share, vec4(1.0));
#if COLORS
        Block block = block_of(light, b);
        EACH for (uint k = 0; k < 4; k++) {
            vec2 place = part_place(light, block, k);
            vec3 factor = max(vec4(place.x * across + place.y * down, 1.0) * colors, 0.0);
            colored += shines * share[k] * factor;
        }
#endif
        b++;
    } while (b < BLOCKS);
#if SUN_MAPS && BLENDS
    if ((current_map & uint(LAMP_BIT - 1)) != 0) {
        SunMap map = sun_map_at(max(findLSB(current_map), 0));
        vec3 place = surface.position + surface.lifted + (surface.origin - map.middle);
        float steps;
        passed *= sun_share(map, place, surface.ground, surface.is_round, surface.step, steps);
        nearest = max(nearest, steps);
    }
#endif
#if MAPS && KEEPS
    // Pixels look up the map, but for where all around is hidden.
    bool is_mapped = shining.light_maps != 0;
    nearest = is_mapped && !hides_around ? MOST_STEPS : nearest;
    unblocked = is_mapped ? open_share : unblocked;
#endif
    float irradiance = shines * passed;
#if COLORS
    irradiance = has_colors ? dot(colored, vec3(1.0 / 3.0)) : irradiance;
#endif
    float ramp = ramp_of(light, shining), cone = clamp(ramp, 0.0, 1.0);
    cone *= cone;
#if EDGES
    bool hidden = covered == (2u << last_block) - (1u << first_block);
#if MAPS
    hidden = hidden && shining.light_maps == 0;
#endif
    finest = hidden ? 0.0 : nearest;
    find_rim(ramp, shining, surface.step / max(light.distance, 1e-30));
    float white = cone * dot(shining.emission, vec3(1.0));
    float miss = add_open(unblocked, white);
#endif
#if KEEPS
    bool dark = passed <= 0.001 * unblocked && unblocked > 0.0;
#if HIDES
    dark = dark || is_hidden;
#endif
    float kept_irradiance = irradiance;
#endif
#if HIDES
    // What rays know; what is kept is for pixels around the vertex, by outlines as they evaluate it.
    bool is_free = (told & ALL_SUNS << 2 * MOST_SUNS) != 0;
    irradiance = is_hidden ? 0.0 : is_free ? shines * open_share : irradiance;
#endif
#if SHOWN
    note_share(chain_light(entry_at(end)), irradiance * cone);
#endif
#if PANELS
    float over = over_parts(surface, light);
    irradiance *= over;
#if KEEPS
    kept_irradiance *= over;
#endif
#endif
#if KEEPS
    keep(shining, dark, kept_irradiance * cone, miss, MOST_MISS * white * unblocked);
#endif
#if LAMPS
    lamps += (shining.sun_bits & uint(LAMP_AT_REST)) == 0 ? irradiance / PI : 0.0;
#endif
#if COLORS
    vec3 arriving = has_colors ? colored : vec3(irradiance);
#else
    float arriving = irradiance;
#endif
    return cone * shining.emission * arriving;
}

// Irradiance by all lights of `count` entries from `first`: those that a pixel's vertices carry well are blended, the
// others evaluated. A light's entry tells how many occluders stand before it.
vec3 sharp_sum(Surface surface, uint first, uint count) {
    vec3 sum = vec3(0.0);
    uint left = count;
    do {
#if BLENDS
        bool blends;
        do {
            uint packed = entry_at(first + left - 1);
            Entity shining = ENTITY(chain_light(packed));
            float irradiance;
            blends = blended_irradiance(shining, irradiance);
            sum += blends ? irradiance * shining.emission : vec3(0.0);
            open_light += blends ? irradiance * dot(shining.emission, vec3(1.0)) : 0.0;
            left -= blends ? 1 + (packed & SKY_CHAIN) : 0;
        } while (blends && left > 0);
#endif
        if (left > 0) {
            uint end = first + left - 1;
            left -= 1 + (entry_at(end) & SKY_CHAIN);
            sum += chain_sum(surface, first + left, end);
        }
    } while (left > 0);
    return sum;
}
