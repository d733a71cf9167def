// Push constants of an entity whose triangles are drawn in pass "pixel light".
layout(push_constant) uniform Push {
    mat4 clip_from_object;
    uint first;          // its first vertex in the radiosity buffer
    uint receiver;       // the entity
    uint cluster_first;  // its first cluster among those whose chains are known
    uint vertex_first;   // of its mesh, in the vertex buffer
    uint self_first;     // first cell of its mesh's self-visibility, or NONE
    float alpha_cutoff;  // least alpha that is drawn
} push;
