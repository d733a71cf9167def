#version 460
// Cube faces by computation: a workgroup for each face and strip of its rows. A device that computes on many threads
// may transform and clip all triangles on one; here each invocation takes triangles of its own. It finds the texels
// whose centres' rays meet them.
layout(local_size_x = WORKGROUP) in;

struct Face {
    vec4 eye; // in r
    vec4 right;
    vec4 down;
    vec4 forward;
    uint slot;
    uint range_first;
    uint range_count;
    uint unused;
};

layout(std430, binding = 0) readonly buffer Faces { Face faces[]; };
layout(std430, binding = 1) readonly buffer Ranges { uvec2 ranges[]; }; // first index and end
layout(binding = 2) uniform textureBuffer positions;
layout(binding = 3) uniform utextureBuffer indices;
layout(std430, binding = 4) writeonly buffer Texels { uint texels[]; }; // of the atlas, a byte each

layout(push_constant) uniform Push {
    uint face_px;
    uint atlas_columns;
    uint band_rows;
    uint culls; // 1 where backs of triangles are left out
} push;

// Result so far, row by row: a bit for each texel that is covered.
shared uint words[WORDS];

uint words_across() {
    return (push.face_px + 31) / 32;
}

// The planes through the eye and each edge: a ray to (s, t, 1) meets the triangle where no product with them is
// negative. For the triangle at the other side of an edge, the edge's numbers are these with the other sign, exactly;
// so no ray passes between the two.
struct Planes {
    vec3 bc;
    vec3 ca;
    vec3 ab;
    float volume; // of the parallelepiped of the three corners; positive for a front
};

vec3 across(vec3 a, vec3 b) {
    precise vec3 plane = vec3(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x);
    return plane;
}

// Where an edge's plane cuts the row at t: at column x * t + y, the same for the triangles on both sides of the edge.
// Where the plane is parallel to the rows, that column lies so far on one side that it leaves a row all or nothing.
const float ALONG = 1e-20;
vec2 cut(vec3 plane) {
    float half_px = 0.5 * float(push.face_px);
    bool along = abs(plane.x) < ALONG;
    float scale = along ? -1e30 : -half_px / plane.x;
    return vec2(plane.y * scale, plane.z * scale + (along ? 0.0 : half_px - 0.5));
}

// Narrows a span of columns to one side of a cut: to what follows it where it opens the span, else to what precedes it.
// Comparisons take two instructions fewer than max() and min(), which also treat NaN.
void narrow(float place, bool opens, inout vec2 span) {
    span.x = opens && place > span.x ? place : span.x;
    span.y = !opens && place < span.y ? place : span.y;
}

// Marks the texels low to high of a row as met by a triangle.
void meet(int row, int low, int high) {
    uint first = uint(row) * words_across();
    for (int word = low / 32; word <= high / 32; word++) {
        uint from = uint(max(low - 32 * word, 0));
        uint to = uint(min(high - 32 * word, 31));
        uint bits = 0xffffffffu >> (31 - to) & 0xffffffffu << from;
        atomicOr(words[first + uint(word)], bits);
    }
}

// Adds a triangle, whose corners are in the face's frame, where rays are (s, t, 1).
void add(vec3 a, vec3 b, vec3 c, int row_first, int row_end) {
    float half_px = 0.5 * float(push.face_px);
    vec2 low = vec2(0.0, float(row_first));
    vec2 high = vec2(2.0 * half_px - 1.0, float(row_end - 1));
    if (min(a.z, min(b.z, c.z)) > 1e-6) {
        // The rows and columns whose centres the triangle's box holds, with a margin for rounding.
        vec2 p = a.xy / a.z;
        vec2 q = b.xy / b.z;
        vec2 r = c.xy / c.z;
        low = max(low, ceil((min(p, min(q, r)) + 1.0) * half_px - 0.501));
        high = min(high, floor((max(p, max(q, r)) + 1.0) * half_px - 0.499));
    } else if (max(a.z, max(b.z, c.z)) <= 0.0) {
        return;
    }
    if (any(greaterThan(low, high))) {
        return;
    }
    Planes planes = Planes(across(b, c), across(c, a), across(a, b), 0.0);
    planes.volume = dot(a, planes.bc);
    if (planes.volume == 0.0 || (planes.volume < 0.0 && push.culls == 1)) {
        return;
    }
    if (planes.volume < 0.0) {
        planes = Planes(-planes.bc, -planes.ca, -planes.ab, -planes.volume);
    }
    vec2 bc = cut(planes.bc);
    vec2 ca = cut(planes.ca);
    vec2 ab = cut(planes.ab);
    bvec3 opens = greaterThan(vec3(planes.bc.x, planes.ca.x, planes.ab.x), vec3(-ALONG));
    for (int y = int(low.y); y <= int(high.y); y++) {
        float t = (float(y) + 0.5) / half_px - 1.0;
        vec2 span = vec2(low.x, high.x);
        narrow(bc.x * t + bc.y, opens.x, span);
        narrow(ca.x * t + ca.y, opens.y, span);
        narrow(ab.x * t + ab.y, opens.z, span);
        span = vec2(ceil(span.x), floor(span.y));
        if (span.x <= span.y) {
            meet(y - row_first, int(span.x), int(span.y));
        }
    }
}

vec3 corner(Face face, uint vertex) {
    vec3 q = texelFetch(positions, int(vertex)).xyz - face.eye.xyz;
    return vec3(dot(face.right.xyz, q), dot(face.down.xyz, q), dot(face.forward.xyz, q));
}

// Four texels of a row of the strip, a byte each.
uint four(uint row, uint column) {
    uint bytes = 0;
    for (uint k = 0; k < 4; k++) {
        uint word = words[row * words_across() + column / 32];
        uint found = (word >> (column % 32 + k) & 1) == 1 ? 0 : 255;
        bytes |= found << 8 * k;
    }
    return bytes;
}

void main() {
    Face face = faces[gl_WorkGroupID.x];
    uint lane = gl_LocalInvocationID.x;
    uint row_first = gl_WorkGroupID.y * push.band_rows;
    uint row_end = min(row_first + push.band_rows, push.face_px);
    for (uint i = lane; i < (row_end - row_first) * words_across(); i += WORKGROUP) {
        words[i] = 0;
    }
    barrier();
    for (uint k = 0; k < face.range_count; k++) {
        uvec2 range = ranges[face.range_first + k];
        for (uint i = range.x + 3 * lane; i < range.y; i += 3 * WORKGROUP) {
            uvec3 triangle = uvec3(texelFetch(indices, int(i)).r, texelFetch(indices, int(i) + 1).r,
                texelFetch(indices, int(i) + 2).r);
            add(corner(face, triangle.x), corner(face, triangle.y), corner(face, triangle.z), int(row_first), int(row_end));
        }
    }
    barrier();
    uint quads = push.face_px / 4;
    uint edge = push.atlas_columns * quads;
    uvec2 place = uvec2(face.slot % push.atlas_columns * quads, face.slot / push.atlas_columns * push.face_px);
    for (uint i = lane; i < (row_end - row_first) * quads; i += WORKGROUP) {
        uint row = i / quads;
        uint column = i % quads;
        texels[(place.y + row_first + row) * edge + place.x + column] = four(row, 4 * column);
    }
}
