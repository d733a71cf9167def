// Input of the passes that reduce captured cube faces: the atlas, and the faces of each sample.

struct SampleFaces {
    vec4 normal;   // unit surface normal, of vertices
    uint slots[6]; // place of each face in the atlas; NONE where the object does not reach
    float scale;   // factor on coefficients
    uint unused;
};

layout(binding = 0) uniform texture2D atlas;
layout(std430, binding = 1) readonly buffer Samples { SampleFaces samples[]; };

layout(push_constant) uniform Push {
    uint face_px;
    uint atlas_columns;
} push;

const uint NONE = 0xffffffffu;

ivec2 slot_origin(uint slot) {
    return ivec2(slot % push.atlas_columns, slot / push.atlas_columns) * int(push.face_px);
}

vec3 to_object(uint face, vec3 d) {
    switch (face) {
        case 0: return vec3(d.z, -d.y, -d.x);
        case 1: return vec3(-d.z, -d.y, d.x);
        case 2: return vec3(d.x, d.z, d.y);
        case 3: return vec3(d.x, -d.z, -d.y);
        case 4: return vec3(d.x, -d.y, d.z);
        default: return vec3(-d.x, -d.y, -d.z);
    }
}
