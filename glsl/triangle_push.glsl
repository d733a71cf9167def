// Push constants of an entity whose triangles are drawn again, because their pixels evaluate sharp lights.
layout(push_constant) uniform Push {
    mat4 clip_from_object;
    vec4 emission_white; // radiance factor; w = radiance that is shown as white
    float tag;           // number of the entity, for outlines
    uint first;          // its first vertex in the radiosity buffer
    vec2 half_size;      // of the viewport, pixels
    uint receiver;       // the entity
    uint cluster_first;  // its first cluster among those whose chains are known
    uint vertex_first;   // of its mesh, in the vertex buffer
    uint self_first;     // first cell of its mesh's self-visibility, or NONE
    vec4 paint;          // factor on the picture that varies its reflectance; least alpha
} push;
