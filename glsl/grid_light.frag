#version 460
#extension GL_EXT_control_flow_attributes : require
#include "blend.glsl"
// Evaluates sharp lights on a pixel of a grid's block of cells.
layout(binding = 0) uniform utextureBuffer corners;  // vertices of each cell; see asset::grid
layout(binding = 1) uniform textureBuffer radiosity; // of every vertex of the scene
layout(location = 0) in vec3 place;
layout(location = 1) in vec3 at; // object's frame, metres
layout(location = 0) out uvec4 kept;
#include "grid_push.glsl"
#include "cell.glsl"
#define FACINGS 1
#include "pixel_light.glsl"

void main() {
    CellTriangle found = cell_triangle(corners, push.cells, place.xy);
    uvec3 lit = push.first + found.vertices;
    bool edge = use_vertices(lit, found.weights);
    uvec2 chain = chain_of(push.cluster_first, found.first);
    // Other cells of the block have what their vertices say, so that pixels beside them need not be evaluated.
    chain.y = edge ? chain.y & ~OWN_MAPS : 0;
    Entity receiver = ENTITY(push.receiver);
    Facing facings[FACINGS];
    facings[0] = facing_of(receiver, push.normal.xyz, 1.0, NONE, 0);
    kept = pixel_light(receiver, at, facings, chain);
}
