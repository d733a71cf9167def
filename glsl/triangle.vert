#version 460
// A corner of a mesh's triangle, which is drawn again where a shadow's edge comes near one of its vertices.
layout(location = 0) out vec3 at;      // object's frame, metres
layout(location = 1) out vec3 weights; // of the triangle's three vertices
layout(location = 2) flat out uvec3 triangle;
layout(location = 3) out vec3 emission;
#if PAINTED
layout(location = 4) out vec2 uv;
layout(location = 5) out vec3 tint;
layout(binding = 11) uniform utextureBuffer paints; // the bits of three numbers a vertex
#include "paint.glsl"
#endif

layout(binding = 0) uniform utextureBuffer corners;   // vertices of triangles, three each
#include "marks.glsl"
layout(binding = 1) uniform textureBuffer radiosity;  // w: marks
layout(binding = 8) uniform textureBuffer vertices;   // position and normal of each
layout(binding = 9) uniform utextureBuffer emissions; // the bits of three numbers a vertex
#include "triangle_push.glsl"
#if GLOSS
#include "gloss_vertex.glsl"
#endif

// As draw.vert computes it, so that the triangle lies at the depth at which it was drawn before.
vec4 clip_place(uint v) {
    precise vec4 place = push.clip_from_object * vec4(texelFetch(vertices, int(2 * (push.vertex_first + v))).xyz, 1.0);
    return place;
}

// Whether the triangle is so small on the screen that its vertices carry an edge as well as pixels do.
bool is_small(vec4 a, vec4 b, vec4 c) {
    vec2 at_a = a.xy / a.w, at_b = b.xy / b.w, at_c = c.xy / c.w;
    vec2 sides = max(max(abs(at_a - at_b), abs(at_b - at_c)), abs(at_c - at_a)) * push.half_size;
    return min(a.w, min(b.w, c.w)) > 0.0 && max(sides.x, sides.y) < LEAST_PX;
}

void main() {
    int first = gl_VertexIndex / 3 * 3;
    triangle = uvec3(texelFetch(corners, first).x, texelFetch(corners, first + 1).x, texelFetch(corners, first + 2).x);
    int corner = gl_VertexIndex - first;
    weights = vec3(corner == 0, corner == 1, corner == 2);
    uint own = triangle[corner];
    at = texelFetch(vertices, int(2 * (push.vertex_first + own))).xyz;
    emission.x = uintBitsToFloat(texelFetch(emissions, int(3 * own)).x);
    emission.y = uintBitsToFloat(texelFetch(emissions, int(3 * own + 1)).x);
    emission.z = uintBitsToFloat(texelFetch(emissions, int(3 * own + 2)).x);
#if PAINTED
    uvec3 bits = uvec3(texelFetch(paints, int(3 * own)).x, texelFetch(paints, int(3 * own + 1)).x,
        texelFetch(paints, int(3 * own + 2)).x);
    uv = uintBitsToFloat(bits.xy);
    tint = tint_of(uintBitsToFloat(bits));
#endif
#if GLOSS
    pass_gloss(push.receiver, own);
#endif
    uint marks = 0;
    for (int i = 0; i < 3; i++) {
        marks |= unpack_marks(texelFetch(radiosity, int(push.first + triangle[i])).w);
    }
    vec4 places[3] = vec4[3](clip_place(triangle.x), clip_place(triangle.y), clip_place(triangle.z));
    gl_Position = marks_edge(marks) && !is_small(places[0], places[1], places[2]) ? places[corner] : vec4(0.0, 0.0, 0.0, 1.0);
}
