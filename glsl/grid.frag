#version 460
#include "finish.glsl"
#include "blend.glsl"
#include "centroid.glsl"
// Shades a point of a grid with the interpolated radiance of its cell's triangle. One fetch finds the triangle and
// three read its corners, which on a software rasteriser is much cheaper than drawing small triangles.
layout(binding = 0) uniform utextureBuffer corners;  // vertices of each cell; see asset::grid
layout(binding = 1) uniform textureBuffer radiosity; // of every vertex of the scene
layout(location = 0) centroid in vec3 place; // z: 1
layout(location = 0) out vec4 color; // alpha: the entity's tag

layout(push_constant) uniform Push {
    mat4 clip_from_object;
    vec4 emission_white; // radiance factor; w = radiance that is shown as white
    float tag;
    uint first;  // its first vertex in the radiosity buffer
    uvec2 cells; // in a row, and rows
    uint receiver;      // the entity
    uint cluster_first; // its first cluster among those whose chains are known
    vec4 normal;        // object's frame
} push;

#if PIXEL
// Blocks of cells that a shadow's edge comes near are drawn by this: their pixels evaluate sharp lights themselves,
// since vertices carry no edge that is finer than their cells.
#extension GL_EXT_control_flow_attributes : require
layout(location = 1) centroid in vec3 at; // object's frame, metres
#define FACINGS 1
#include "pixel_light.glsl"
#endif

void main() {
    float within = within_triangle(place.z);
    vec2 in_grid = within * place.xy;
    uvec2 cell = uvec2(clamp(ivec2(floor(in_grid)), ivec2(0), ivec2(push.cells) - 1));
    vec2 in_cell = in_grid - vec2(cell);
    uvec4 corner = texelFetch(corners, int(cell.y * push.cells.x + cell.x));
    bool upwards = corner.x >= UPWARDS;
    corner.x &= ~UPWARDS;
    // Two corners lie on the cell's diagonal; the third is the one on this point's side of it.
    bool far = upwards ? in_cell.y > in_cell.x : in_cell.x + in_cell.y > 1.0;
    uvec3 triangle = upwards ? uvec3(corner.x, corner.w, far ? corner.z : corner.y)
                             : uvec3(corner.y, corner.z, far ? corner.w : corner.x);
    vec3 weight;
    if (upwards) {
        weight = far ? vec3(1.0 - in_cell.y, in_cell.x, in_cell.y - in_cell.x) : vec3(1.0 - in_cell.x, in_cell.y, in_cell.x - in_cell.y);
    } else {
        weight = far ? vec3(1.0 - in_cell.y, 1.0 - in_cell.x, in_cell.x + in_cell.y - 1.0) : vec3(in_cell.x, in_cell.y, 1.0 - in_cell.x - in_cell.y);
    }
    uint first = min(triangle.x, min(triangle.y, triangle.z));
    triangle += push.first;
    vec3 light = blend(radiosity, triangle, weight);
#if PIXEL
    uvec2 chain = chain_of(push.cluster_first, first) & uvec2(~0u, ~OWN_MAPS);
    if (chain.y > 0 && has_edge(triangle)) {
        Entity receiver = ENTITY(push.receiver);
        Facing facings[FACINGS];
        facings[0] = facing_of(receiver, push.normal.xyz, 1.0, NONE, 0);
        light = blend(soft, triangle, weight) + pixel_light(receiver, within * at, facings, chain);
    }
#endif
    color = vec4(finish(push.emission_white.rgb + light, push.emission_white.w), push.tag);
}
