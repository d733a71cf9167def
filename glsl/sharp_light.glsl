// Light that a surface receives from sharp lights, past what is listed before each of them. The twin is src/sharp/twin.rs.
#include "sub_light.glsl"

#ifdef EDGES
// Whether a shadow's edge lies no farther from the surface's point than the next vertex, and is so narrow that the light on vertices around
// it does not carry it.
bool edge = false;
#endif

struct Surface {
    vec3 position; // world axes, metres from `origin`
    vec3 normal;   // world
    vec3 origin;   // world
#ifdef EDGES
    float step;    // distance between neighbouring vertices of a grid, metres; 0 on other meshes
#endif
#if SELF
    uint self_first;  // word of its self-visibility, or NONE
    mat3 self_frame;  // about the normal, world
#endif
};

// Of the parts of a block, what an occluder lets through that counts only before the light (`before`), or the light's own outline.
vec4 let_through(Entity occluder, Surface surface, SeenLight light, Block block, bool before) {
    mat3 axes = mat3(to_object(occluder, light.toward), to_object(occluder, light.across), to_object(occluder, light.down));
    // The surface's point by the light's axes, from the occluder's centre. From the light's own centre it lies on the first axis.
    vec3 to = surface.position - (occluder.centre.xyz - surface.origin);
    vec3 place = before ? to * mat3(light.toward, light.across, light.down) : vec3(-light.distance, 0.0, 0.0);
    place *= occluder.centre.w;
    vec3 middle = along_axes(light, block.middle);
    NodeCell cell = node_cell(floatBitsToUint(occluder.sharp.x), axes * middle);
    vec3 along[4], foot[4];
    vec4 offset;
    vec4 weights[4];
    vec2 found[4];
    [[unroll]] for (uint k = 0; k < 4; k++) {
        along[k] = along_axes(light, part_place(light, block, k));
        offset[k] = dot(place, along[k]);
        foot[k] = place - offset[k] * along[k];
        weights[k] = node_weights(cell, axes * along[k]);
        found[k] = vec2(0.0);
    }
    [[unroll]] for (uint m = 0; m < 4; m++) {
        NearMap near = near_map(cell, m, axes, place - dot(place, middle) * middle);
        [[unroll]] for (uint k = 0; k < 4; k++) {
            found[k] += weights[k][m] * outline(near, along[k], foot[k]);
        }
    }
    vec4 through;
    [[unroll]] for (uint k = 0; k < 4; k++) {
        // The light's surface in this direction.
        vec2 part = part_place(light, block, k);
        float limit = before ? reach_of(light, part, along[k]) * occluder.centre.w : 1e30;
        float sine = part_sine(light, block, part, along[k]);
        float tangent = sine * inversesqrt(1.0 - sine * sine);
        float away = found[k].y - offset[k];
        through[k] = 1.0 - blocked(found[k].x, away, limit, tangent);
#ifdef EDGES
        float step = surface.step * occluder.centre.w;
        float penumbra = max(away, NEAREST) * tangent;
        bool stands = before && away > -NEAREST - step && away < limit + NEAREST + step;
        edge = edge || stands && abs(found[k].x) < penumbra + EDGE_REACH * step && penumbra < EDGE_STEPS * step;
#endif
    }
    return through;
}

// Irradiance by the parts of a block, unoccluded, of radiance 1.
vec4 part_shares(Surface surface, SeenLight light, Block block) {
    mat3 axes = mat3(light.toward, light.across, light.down);
    vec4 share;
    [[unroll]] for (uint k = 0; k < 4; k++) {
        vec2 part = part_place(light, block, k);
        vec3 along = along_axes(light, part);
        vec3 direction = axes * along;
        float sine = part_sine(light, block, part, along);
        share[k] = block.weight * part_light(light, block, part, along) * part_cosine(dot(surface.normal, direction), sine);
#if SELF
        // A part's radius is small enough for its sine to stand for it.
        bool shadows = surface.self_first != NONE;
        float sees = self_visible(shadows ? surface.self_first : 0, surface.self_frame, direction, sine);
        share[k] *= shadows ? sees : 1.0;
#endif
    }
    return share;
}

uint chain_light(uint packed) {
    return packed >> ENTRY_BITS & SKY_CHAIN;
}

// Irradiance by all lights of `count` entries from `first`.
vec3 sharp_sum(Surface surface, uint first, uint count) {
    vec3 sum = vec3(0.0);
    uint i = 0;
    // Loops are tested at their ends, as in the merge.
    do {
        Entity shining = ENTITY(chain_light(entry_at(first + i)));
        SeenLight light = seen_light(shining.centre.xyz - surface.origin - surface.position, shining);
        uint b = light.fine >= 1.0 ? 1 : 0;
        uint last = light.fine <= 0.0 ? 0 : 4;
        float irradiance = 0.0;
        uint j;
        do {
            Block block = block_of(light, b);
            vec4 share = part_shares(surface, light, block);
            j = i;
            uint packed = entry_at(first + j);
            do {
                if ((packed & ENTRY_LIGHT) == 0) {
                    share *= let_through(ENTITY(packed & SKY_CHAIN), surface, light, block, true);
                    j++;
                    packed = entry_at(first + j);
                }
            } while ((packed & ENTRY_LIGHT) == 0 && j < count);
#if OUTLINES
            // Of a light with an outline of its own, as much of each part shines as the outline covers.
            vec4 dark = let_through(shining, surface, light, block, false);
            share *= shining.sharp.y > 0.0 ? vec4(shining.sharp.y) : 1.0 - dark;
#else
            share *= shining.sharp.y;
#endif
            irradiance += dot(share, vec4(1.0));
            b++;
        } while (b <= last);
        i = j + 1;
        sum += irradiance * shining.emission.rgb;
    } while (i < count);
    return sum;
}
