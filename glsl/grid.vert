#version 460
// Transforms a corner of a grid, which is drawn as one parallelogram, or of a block of its cells, whose pixels need more
// than its vertices.
layout(location = 0) in vec3 position;
#if EVALUATED || BLOCK_CELLS == 0
layout(location = 1) in vec2 cell;   // in cells from the first
layout(location = 0) out vec3 place; // z: 1
#endif
#if EVALUATED
layout(location = 1) out vec3 at; // object's frame, metres
#endif

#if BLOCK_CELLS == 0
layout(push_constant) uniform Push {
    mat4 clip_from_object;
} push;
#else
#include "grid_push.glsl"
// A block is thrown away unless a shadow's edge comes near one of its vertices.
layout(binding = 0) uniform utextureBuffer corners;  // vertices of each cell; see asset::grid
#include "marks.glsl"
layout(binding = 1) uniform textureBuffer radiosity; // w: marks

bool has_edge(uint block) {
    uint row = (push.cells.x + BLOCK_CELLS - 1) / BLOCK_CELLS;
    uvec2 low = BLOCK_CELLS * uvec2(block % row, block / row);
    uint marks = 0;
    for (uint i = 0; i < (BLOCK_CELLS + 1) * (BLOCK_CELLS + 1); i++) {
        uvec2 vertex = min(low + uvec2(i % (BLOCK_CELLS + 1), i / (BLOCK_CELLS + 1)), push.cells);
        uvec2 cell = min(vertex, push.cells - 1);
        uvec4 corner = texelFetch(corners, int(cell.y * push.cells.x + cell.x));
        uvec2 near = vertex.y > cell.y ? corner.zw : corner.xy;
        uint index = (vertex.x > cell.x ? near.y : near.x) & ~UPWARDS;
        marks |= unpack_marks(texelFetch(radiosity, int(push.first + index)).w);
    }
    return marks_edge(marks);
}
#endif

void main() {
#if EVALUATED || BLOCK_CELLS == 0
    place = vec3(cell, 1.0);
#endif
#if EVALUATED
    at = position;
#endif
    // The same in every pipeline, so that what one of them has drawn lies at the depth at which another draws it.
    precise vec4 corner = push.clip_from_object * vec4(position, 1.0);
    gl_Position = corner;
#if BLOCK_CELLS > 0
    if (!has_edge(uint(gl_VertexIndex) / 4)) {
        gl_Position = vec4(0.0, 0.0, 0.0, 1.0);
    }
#endif
}
