#version 460
#extension GL_EXT_samplerless_texture_functions : require
#include "finish.glsl"
#include "blend.glsl"
#include "centroid.glsl"
// Shades a point of a grid with the interpolated radiance of its cell's triangle. One fetch finds the triangle and
// three read its corners, which on a software rasteriser is much cheaper than drawing small triangles.
layout(binding = 0) uniform utextureBuffer corners;  // vertices of each cell; see asset::grid
layout(binding = 1) uniform textureBuffer radiosity; // of every vertex of the scene; w: marks
layout(location = 0) centroid in vec3 place; // z: 1
layout(location = 0) out vec4 color; // alpha: the entity's tag

layout(push_constant) uniform Push {
    mat4 clip_from_object;
    vec4 emission_white; // radiance factor; w = radiance that is shown as white
    float tag;
    uint entity;
    uvec2 cells; // in a row, and rows
    uint first;  // its first vertex in the radiosity buffer
} push;
#include "cell.glsl"
#if PIXEL
#include "marks.glsl"
#include "shown_light.glsl"
#endif

void main() {
    CellTriangle found = cell_triangle(corners, push.cells, within_triangle(place.z) * place.xy);
    uvec3 lit = push.first + found.vertices;
    vec3 light = blend(radiosity, lit, found.weights);
#if PIXEL
    vec4 shares = vec4(0.0);
    find_light(push.entity, is_marked(radiosity, lit), light, shares);
#endif
    color = vec4(finish(push.emission_white.rgb + light, push.emission_white.w), push.tag);
}
