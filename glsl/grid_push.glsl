// Push constants of a grid whose blocks are drawn in pass "pixel light".
layout(push_constant) uniform Push {
    mat4 clip_from_object;
    uvec2 cells;
    uint first;    // its first vertex in the radiosity buffer
    uint receiver; // the entity
} push;
