#version 460
#extension GL_EXT_samplerless_texture_functions : require
// Cube faces around a vertex to its map of signed angles, one workgroup per vertex and one invocation per node. The
// nearest texel of the other state has a neighbour that is not of it. So a face becomes a bit a texel, the bits beside
// an edge are found a word at a time, and the nodes measure to those alone. Texels below the horizon are no part of
// what the vertex sees, so that nothing is measured to the edge between the sky and the vertex's own surface.

layout(local_size_x = NODES) in;

#include "captured.glsl"
#include "self_frame.glsl"

layout(std430, binding = 2) writeonly buffer Maps { uint maps[]; }; // four nodes a word: angles, and then distances

shared uint words[WORDS]; // rows of texels, 32 a word, a bit for each that is free
shared uint risen[WORDS]; // a bit for each texel above the horizon
shared uint edges[WORDS]; // a bit for each texel beside an edge
shared uint busy[WORDS / 32]; // a bit for each word with an edge
shared uint bytes[2 * NODES]; // of the map

// Value of a texel that shows no part of the mesh. All others are distances.
const uint FREE = 255;
uint captured_at(uint slot, ivec2 at) {
    return slot == NONE ? FREE : uint(texelFetch(atlas, slot_origin(slot) + at, 0).r * 255.0 + 0.5);
}

bool free_at(uint slot, ivec2 at) {
    return captured_at(slot, at) == FREE;
}

// Captured texel in a direction of any length.
uint captured_toward(uint index, vec3 d) {
    vec3 a = abs(d);
    uint face = a.z >= a.x && a.z >= a.y ? (d.z < 0.0 ? 5 : 4) : a.y >= a.x ? (d.y < 0.0 ? 3 : 2) : (d.x < 0.0 ? 1 : 0);
    vec3 right = to_object(face, vec3(1.0, 0.0, 0.0));
    vec3 down = to_object(face, vec3(0.0, 1.0, 0.0));
    vec2 st = vec2(dot(d, right), dot(d, down)) / max(a.x, max(a.y, a.z));
    int px = int(push.face_px);
    ivec2 at = clamp(ivec2((st + 1.0) * 0.5 * float(px)), ivec2(0), ivec2(px - 1));
    return captured_at(samples[index].slots[face], at);
}

bool free_toward(uint index, vec3 d) {
    return captured_toward(index, d) == FREE;
}

// Point of a texel's centre on its face: s and t.
vec2 face_point(ivec2 at) {
    return vec2(2 * at + 1) / float(push.face_px) - 1.0;
}

// Fills word i with the texels from `first` on; `up` is the normal along the face's axes.
void load_word(uint i, uint slot, ivec2 first, vec3 up) {
    uint count = min(32, push.face_px - uint(first.x));
    vec2 point = face_point(first);
    float height = dot(vec3(point, 1.0), up);
    float rise = 2.0 / float(push.face_px) * up.x;
    uint above = 0;
    for (uint bit = 0; bit < count; bit++) {
        above |= uint(height + float(bit) * rise > 0.0) << bit;
    }
    uint word = slot == NONE ? 0xffffffffu : 0;
    for (uint bit = 0; bit < (slot == NONE || above == 0 ? 0 : count); bit++) {
        word |= uint(free_at(slot, first + ivec2(bit, 0))) << bit;
    }
    words[i] = word;
    risen[i] = above;
}

// Texels of word i that have a neighbour of the other state above the horizon, among rows of `across` words of which
// `count` are there.
uint edge_word(uint i, uint across, uint count) {
    uint column = i % across;
    uint word = words[i];
    uvec2 left = column > 0 ? uvec2(words[i - 1], risen[i - 1]) >> 31 : uvec2(0);
    uvec2 right = column < across - 1 ? uvec2(words[i + 1], risen[i + 1]) << 31 : uvec2(0);
    uvec2 above = i >= across ? uvec2(words[i - across], risen[i - across]) : uvec2(0);
    uvec2 below = i + across < count ? uvec2(words[i + across], risen[i + across]) : uvec2(0);
    left |= uvec2(word, risen[i]) << 1;
    right |= uvec2(word, risen[i]) >> 1;
    return risen[i] & ((word ^ left.x) & left.y | (word ^ right.x) & right.y | (word ^ above.x) & above.y
        | (word ^ below.x) & below.y);
}

// Adds texels on the rim of a face whose neighbour on another face is of the other state: number k of all four sides.
void add_rim(uint index, uint face, uint k, int row_first, int row_end, vec3 up) {
    int px = int(push.face_px);
    uint side = k / push.face_px;
    int along = int(k % push.face_px);
    int end = side % 2 == 0 ? 0 : px - 1;
    ivec2 at = side < 2 ? ivec2(end, along) : ivec2(along, end);
    int outward = side % 2 == 0 ? -1 : 1;
    ivec2 beyond = at + (side < 2 ? ivec2(outward, 0) : ivec2(0, outward));
    vec3 toward = vec3(face_point(beyond), 1.0);
    if (at.y < row_first || at.y >= row_end || dot(toward, up) <= 0.0) {
        return;
    }
    uint across = (push.face_px + 31) / 32;
    uint i = uint(at.y - row_first) * across + uint(at.x) / 32;
    uint bit = 1u << (at.x & 31);
    if ((risen[i] & bit) != 0 && free_toward(index, to_object(face, toward)) != ((words[i] & bit) != 0)) {
        atomicOr(edges[i], bit);
    }
}

// The nearest texel so far of each state: cosine to the node, and half the texel's width in radians.
struct Nearest {
    vec2 free;
    vec2 blocked;
    uvec3 place; // of the blocked one: face, column and row
};

// Measures to every texel beside an edge; the node's direction `toward` along the face's axes. Words without an edge
// are jumped over, and rows are counted by a product: a step of a loop and a division cost more than measuring does.
void measure(uint face, uint count, int row_first, vec3 toward, inout Nearest nearest) {
    uint across = (push.face_px + 31) / 32;
    float rows = 1.0 / float(across);
    float texel = 2.0 / float(push.face_px);
    for (uint group = 0; group < count; group += 32) {
        for (uint some = busy[group / 32]; some != 0; some &= some - 1) {
            uint i = group + uint(findLSB(some));
            uint row = uint((float(i) + 0.5) * rows);
            uint state = words[i];
            vec2 first = (vec2(32 * (i - row * across), row_first + int(row)) + 0.5) * texel - 1.0;
            for (uint bits = edges[i]; bits != 0; bits &= bits - 1) {
                int bit = findLSB(bits);
                vec3 point = vec3(first.x + float(bit) * texel, first.y, 1.0);
                float inverse = inversesqrt(dot(point, point));
                // A texel's solid angle is its area on the face times the third power of this inverse.
                vec2 found = vec2(dot(point, toward) * inverse, 0.5 * texel * inverse * sqrt(inverse));
                bool free = (state >> bit & 1) == 1;
                nearest.free = free && found.x > nearest.free.x ? found : nearest.free;
                bool nearer = !free && found.x > nearest.blocked.x;
                nearest.blocked = nearer ? found : nearest.blocked;
                nearest.place = nearer ? uvec3(face, 32 * (i - row * across) + bit, row_first + int(row)) : nearest.place;
            }
        }
    }
}

// Angle from the node to the centre of the nearest texel; without one, more than any angle.
float angle_to(vec2 nearest) {
    return nearest.x < -1.5 ? 1e9 : acos(clamp(nearest.x, -1.0, 1.0));
}

void main() {
    uint index = gl_WorkGroupID.x;
    uint node = gl_LocalInvocationID.x;
    vec3 normal = samples[index].normal.xyz;
    vec3 toward = self_frame(normal) * self_node(node);
    Nearest nearest = Nearest(vec2(-2.0, 0.0), vec2(-2.0, 0.0), uvec3(0));
    int px = int(push.face_px);
    uint across = (push.face_px + 31) / 32;
    int rows = int(WORDS / across) - 2; // and one on either side, whose other neighbours the next rows have
    for (uint face = 0; face < 6; face++) {
        mat3 axes = mat3(to_object(face, vec3(1.0, 0.0, 0.0)), to_object(face, vec3(0.0, 1.0, 0.0)),
            to_object(face, vec3(0.0, 0.0, 1.0)));
        vec3 up = normal * axes;
        bool rises = abs(up.x) + abs(up.y) + up.z > 0.0;
        uint slot = samples[index].slots[face];
        for (int first = 0; first < (rises ? px : 0); first += rows) {
            int row_first = max(first - 1, 0);
            int row_end = min(first + rows + 1, px);
            uint count = uint(row_end - row_first) * across;
            for (uint i = node; i < count; i += NODES) {
                load_word(i, slot, ivec2(32 * (i % across), row_first + int(i / across)), up);
            }
            for (uint i = node; i < WORDS / 32; i += NODES) {
                busy[i] = 0;
            }
            barrier();
            for (uint i = node; i < count; i += NODES) {
                edges[i] = edge_word(i, across, count);
            }
            barrier();
            for (uint k = node; k < 4 * push.face_px; k += NODES) {
                add_rim(index, face, k, row_first, row_end, up);
            }
            barrier();
            for (uint i = node; i < count; i += NODES) {
                atomicOr(busy[i / 32], uint(edges[i] != 0) << i % 32);
            }
            barrier();
            measure(face, count, row_first, toward * axes, nearest);
            barrier();
        }
    }
    float to_free = angle_to(nearest.free);
    float to_blocked = angle_to(nearest.blocked);
    bool free = to_free == to_blocked ? free_toward(index, normal) : to_blocked > to_free;
    float angle = free ? max(to_blocked - nearest.blocked.y, 0.0) : -max(to_free - nearest.free.y, 0.0);
    bytes[node] = uint(int(roundEven(clamp(angle / SELF_LIMIT, -1.0, 1.0) * 127.0)) & 0xff);
    uint away = captured_toward(index, toward);
    uint beside = nearest.blocked.x < -1.5 ? FREE : captured_at(samples[index].slots[nearest.place.x], ivec2(nearest.place.yz));
    bytes[NODES + node] = away == FREE ? beside : away;
    barrier();
    if (node < NODES / 2) {
        uint word = 0;
        for (uint k = 0; k < 4; k++) {
            word |= bytes[4 * node + k] << 8 * k;
        }
        maps[index * (NODES / 2) + node] = word;
    }
}
