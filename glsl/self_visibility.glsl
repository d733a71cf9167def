// Visibility of a light past the receiver's own mesh. The twin is src/field/self_visibility.rs. A shader that includes
// this, after blocked_share.glsl and bytes.glsl, defines
//   uvec2 self_cell(uint i): cell i of all, as `cells` in that file makes them,
// and the macros SELF_SIDE, SELF_RIM, SELF_LIMIT, SELF_STEPS, SELF_FIRST and SELF_RAMP
// (`ShaderPermutation::self_visibility`).

#include "surface_axes.glsl"

// Distance on the octahedron |x| + |y| + z = 1, along the normal and across it.
float self_reach(vec3 local) {
    return abs(local.x) + abs(local.y) + max(local.z, 0.0);
}

// Place of a direction (z along the normal) on the map, nodes at whole numbers from 0 to SELF_SIDE - 1.
vec2 self_place(vec3 local) {
    vec2 flattened = local.xy / max(self_reach(local), 1e-20);
    vec2 square = vec2(flattened.x + flattened.y, flattened.x - flattened.y) * (1.0 / SELF_RIM);
    const float MIDDLE = 0.5 * float(SELF_SIDE - 1);
    return clamp(square, -1.0, 1.0) * MIDDLE + MIDDLE;
}

// At a direction (z along the normal): signed angle in radians to the edge of what the vertex sees, and the base-2
// logarithm of the octahedral distance of what hides, in r: its reciprocal is linear over a plane.
vec2 self_lookup(uint first_cell, vec3 local) {
    vec2 place = self_place(local);
    vec2 cell = min(floor(place), float(SELF_SIDE - 2));
    vec2 within = place - cell;
    uvec2 words = self_cell(first_cell + uint(cell.y) * uint(SELF_SIDE - 1) + uint(cell.x));
    vec4 angles = signed_bytes(words.x), near = exp2(unsigned_bytes(words.y) * (-1.0 / SELF_STEPS));
    vec4 row = mix(vec4(angles.xz, near.xz), vec4(angles.yw, near.yw), within.x);
    vec2 found = mix(row.xz, row.yw, within.y);
    return vec2(found.x * (SELF_LIMIT / 127.0), SELF_FIRST - log2(found.y));
}

// Share of a round light that the mesh leaves free: in a unit direction, of angular radius `radius` (radians),
// `distance` away (in r). `first_cell` is the vertex's first.
float self_visible(uint first_cell, mat3 frame, vec3 direction, float radius, float distance) {
    vec3 local = direction * frame;
    vec2 found = self_lookup(first_cell, local);
    float blocks = clamp((log2(distance * self_reach(local)) - found.y) * (1.0 / SELF_RAMP), 0.0, 1.0);
    return 1.0 - blocked_share(-found.x / max(radius, 1e-6)) * blocks;
}

// The same for one direction in the object's frame.
float self_visible(uint first_cell, vec3 normal, vec3 direction, float radius, float distance) {
    return self_visible(first_cell, surface_axes(normal), direction, radius, distance);
}
