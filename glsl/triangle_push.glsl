// Push constants of an entity whose triangles are drawn in pass "pixel light".
layout(push_constant) uniform Push {
    mat4 clip_from_object;
    uint first;         // its first vertex in the radiosity buffer
    uint receiver;      // the entity
    uint vertex_first;  // of its mesh, in the vertex buffer
    float alpha_cutoff; // least alpha that is drawn
} push;
