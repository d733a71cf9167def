// What the merge reads besides fields; src/layout.rs holds the same structs and tests/layouts.rs compares the two.

struct Entity {
    vec4 centre;       // world, metres; w = 1 / (scale x bounding radius), 1/m
    vec4 to_object_x;  // rows of the inverse rotation; w unused
    vec4 to_object_y;
    vec4 to_object_z;
    vec4 emission;     // radiance factor of its light; w = whether the light has a radiance field of its own
    vec4 albedo;       // albedo / pi; w = uniform scale of the object
    vec4 radial;       // shell coordinate = x * spacing coordinate + y; z = inner, w = outer shell radius in r
    uint blocked_base; // first quad of the occlusion field
    uint radiance_base;// first quad of the radiance field
    uint rank;         // decides between equal distances
    uint spare;
};

struct Push {
    uint vertex_first;   // of the receiver's mesh in the vertex buffer
    uint vertex_count;
    uint transfer_first; // quad of the receiver's first transfer vector; NONE: the cosine of the normal
    uint receiver;       // entity that is lit
    uint occluder_first; // in the list
    uint occluder_count;
    uint accumulate;     // 1: add to what an earlier dispatch with other lights left
    uint spare;
    uint light[4];       // entities of the lights of this dispatch
    uint digit[16];      // 0 .. 15, see uniformly()
};
