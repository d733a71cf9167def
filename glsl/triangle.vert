#version 460
// A corner of a mesh's triangle whose pixels need more than its vertices, because a shadow's edge comes near one of them.
layout(location = 0) out vec3 at;      // object's frame, metres
layout(location = 1) out vec3 weights; // of the triangle's three vertices
layout(location = 2) flat out uvec3 triangle;
#if HOLES
layout(location = 3) out vec2 uv;
layout(binding = 3) uniform utextureBuffer paints; // the bits of three numbers a vertex
#endif

layout(binding = 0) uniform utextureBuffer corners;  // vertices of triangles, three each
#include "marks.glsl"
layout(binding = 1) uniform textureBuffer radiosity; // w: marks
layout(binding = 2) uniform textureBuffer vertices;  // position and normal of each
#include "triangle_push.glsl"

void main() {
    int first = gl_VertexIndex / 3 * 3;
    triangle = uvec3(texelFetch(corners, first).x, texelFetch(corners, first + 1).x, texelFetch(corners, first + 2).x);
    int corner = gl_VertexIndex - first;
    uint own = triangle[corner];
    vec3 position = texelFetch(vertices, int(2 * (push.vertex_first + own))).xyz;
    weights = vec3(corner == 0, corner == 1, corner == 2);
    at = position;
#if HOLES
    uv = uintBitsToFloat(uvec2(texelFetch(paints, int(3 * own)).x, texelFetch(paints, int(3 * own + 1)).x));
#endif
    vec4 place = push.clip_from_object * vec4(position, 1.0);
    gl_Position = is_marked(radiosity, push.first + triangle) ? place : vec4(0.0, 0.0, 0.0, 1.0);
}
