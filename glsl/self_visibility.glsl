// What a mesh leaves of a light on its own vertices. The twin is src/field/self_visibility.rs. The shader that includes this, after
// self_frame.glsl and blocked_share.glsl, defines
//   uint self_cell(uint i): word i of all cells, as `cells` in that file makes them,
// and the macros SELF_SIDE, SELF_RIM and SELF_LIMIT (`ShaderPermutation::self_visibility`).

// Signed angle in radians from a direction (any length, in the frame's own frame) to the edge of what the vertex sees.
float self_angle(uint first_cell, mat3 frame, vec3 direction) {
    vec2 place = self_place(direction * frame);
    vec2 cell = min(floor(place), float(SELF_SIDE - 2));
    vec2 within = place - cell;
    uint word = self_cell(first_cell + uint(cell.y) * uint(SELF_SIDE - 1) + uint(cell.x));
    vec4 corners = unpackSnorm4x8(word);
    vec2 row = mix(corners.xz, corners.yw, within.x);
    return SELF_LIMIT * mix(row.x, row.y, within.y);
}

// Share of a round light of angular radius `radius` (radians) that the mesh leaves free; `first_cell` is the vertex's first word.
float self_visible(uint first_cell, mat3 frame, vec3 direction, float radius) {
    return blocked_share(self_angle(first_cell, frame, direction) / max(radius, 1e-6));
}

// The same for one direction in the object's frame.
float self_visible(uint first_cell, vec3 normal, vec3 direction, float radius) {
    return self_visible(first_cell, self_frame(normal), direction, radius);
}
