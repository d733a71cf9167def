#version 460
// Transforms a corner of a grid, which is drawn as one parallelogram.
layout(location = 0) in vec3 position;
layout(location = 1) in vec2 cell; // in cells from the first
layout(location = 0) out vec2 place;
layout(location = 1) out vec3 at; // object's frame, metres

layout(push_constant) uniform Push {
    mat4 clip_from_object;
    vec4 emission_white;
    float tag;
    uint first;
    uvec2 cells;
} push;

void main() {
    place = cell;
    at = position;
    gl_Position = push.clip_from_object * vec4(position, 1.0);
}
