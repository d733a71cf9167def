#version 460
// Keeps the triangle of a grid that a pixel shows.
layout(binding = 0) uniform utextureBuffer corners;  // vertices of each cell; see asset::grid
layout(binding = 1) uniform textureBuffer radiosity; // of every vertex of the scene
layout(location = 0) in vec3 place;
layout(location = 1) in vec3 at; // object's frame, metres
layout(location = 0) out uvec4 seen_triangle;
layout(location = 1) out uvec4 seen_place;
#include "grid_push.glsl"
#include "cell.glsl"
#include "marks.glsl"
#include "seen_surface.glsl"

void main() {
    CellTriangle found = cell_triangle(corners, push.cells, place.xy);
    uvec3 lit = push.first + found.vertices;
    seen_triangle = pack_triangle(push.receiver, gl_FrontFacing, is_marked(radiosity, lit), lit);
    float step = max(length(dFdx(at)), length(dFdy(at)));
    seen_place = pack_place(found.weights, step, vec2(dFdx(gl_FragCoord.z), dFdy(gl_FragCoord.z)));
}
