#version 460
// A corner of a triangle as a sun or a lamp sees it.
layout(location = 0) in vec3 position;
#if HOLES
layout(location = 1) in vec3 paint; // texture coordinates and tint
layout(location = 0) out vec2 uv;
#endif
#include "sun_map_push.glsl"

void main() {
#if HOLES
    uv = paint.xy;
#endif
    gl_Position = push.clip_from_object * vec4(position, 1.0);
}
