#version 460
// Transforms a corner of a grid, which is drawn as one parallelogram, or of a block of its cells, whose pixels need more
// than its vertices.
layout(location = 0) in vec3 position;
layout(location = 1) in vec2 cell;   // in cells from the first
layout(location = 0) out vec3 place; // z: 1

#if BLOCK_CELLS == 0
layout(push_constant) uniform Push {
    mat4 clip_from_object;
} push;
#else
layout(location = 1) out vec3 at; // object's frame, metres
#include "grid_push.glsl"
// A block is thrown away unless a shadow's edge comes near one of its vertices.
layout(binding = 0) uniform utextureBuffer corners;  // vertices of each cell; see asset::grid
layout(binding = 1) uniform textureBuffer radiosity; // w: marks

bool has_edge(uint block) {
    uint row = (push.cells.x + BLOCK_CELLS - 1) / BLOCK_CELLS;
    uvec2 low = BLOCK_CELLS * uvec2(block % row, block / row);
    float marks = 0.0;
    for (uint i = 0; i < (BLOCK_CELLS + 1) * (BLOCK_CELLS + 1); i++) {
        uvec2 vertex = min(low + uvec2(i % (BLOCK_CELLS + 1), i / (BLOCK_CELLS + 1)), push.cells);
        uvec2 cell = min(vertex, push.cells - 1);
        uvec4 corner = texelFetch(corners, int(cell.y * push.cells.x + cell.x));
        uvec2 near = vertex.y > cell.y ? corner.zw : corner.xy;
        uint index = (vertex.x > cell.x ? near.y : near.x) & ~UPWARDS;
        marks += texelFetch(radiosity, int(push.first + index)).w;
    }
    return marks > 0.0;
}
#endif

void main() {
    place = vec3(cell, 1.0);
    gl_Position = push.clip_from_object * vec4(position, 1.0);
#if BLOCK_CELLS > 0
    at = position;
    if (!has_edge(uint(gl_VertexIndex) / 4)) {
        gl_Position = vec4(0.0, 0.0, 0.0, 1.0);
    }
#endif
}
