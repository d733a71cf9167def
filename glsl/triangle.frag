#version 460
// Keeps the triangle of a mesh that a pixel shows.
layout(location = 0) in vec3 at;      // object's frame, metres
layout(location = 1) in vec3 weights;
layout(location = 2) flat in uvec3 triangle;
layout(location = 0) out uvec4 seen_triangle;
layout(location = 1) out uvec4 seen_place;
#if HOLES
layout(location = 3) in vec2 uv;
layout(binding = 4) uniform sampler2D picture;
#include "holes.glsl"
#include "textured.glsl"
#endif
#include "triangle_push.glsl"
#include "seen_surface.glsl"

void main() {
#if HOLES
    cut_holes(textured(picture, uv).a, push.alpha_cutoff);
#endif
    seen_triangle = pack_triangle(push.receiver, gl_FrontFacing, true, push.first + triangle);
    float step = max(length(dFdx(at)), length(dFdy(at)));
    seen_place = pack_place(weights, step, vec2(dFdx(gl_FragCoord.z), dFdy(gl_FragCoord.z)));
}
