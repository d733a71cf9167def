#version 460
// Makes the list of every cluster. A workgroup has a group of neighbouring clusters of one receiver. First all invocations look for the
// occluders that may matter to any of the clusters, in blocks and then one by one, and sort them from near to far. Then each invocation
// goes through these for its own cluster, light by light and at last for the sky, and writes those that it keeps.
// A group that finds more than there is room for is left to a second round (ROOMY), which keeps what it finds in a buffer.
// The rule has a slack that is larger than rounding (gather_scope.glsl); only the order has to be the host's to the bit.
#extension GL_KHR_memory_scope_semantics : enable
#include "merge_layout.glsl"

layout(local_size_x = LANES) in;

struct Bounds {
    vec4 sphere; // of the vertices, mesh's frame, metres
    vec4 cone;   // of the normals: axis, cosine of the half-angle
};
struct Group {
    uint first;
    uint count;
    uint bounds;
    uint left; // of the group at this place among those that are left to the second round: its number
};

// Spheres of all entities (centre in the world, radius), then blocks of occluders, their members, and lights.
#include "readable.glsl"
READ_VEC4(0, SceneQuads, scene_quads, scene_quad)
layout(std430, binding = 1) readonly buffer Entities { Entity entities[]; };
layout(std430, binding = 2) readonly buffer AllBounds { Bounds bounds[]; };
layout(std430, binding = 3) buffer Groups { Group groups[]; };
layout(std430, binding = 4) buffer Clusters { Cluster clusters[]; };
layout(std430, binding = 5) writeonly buffer Entries { uint entries[]; };
layout(std430, binding = 6) buffer Report {
    uint longest;
    uint most_found;
    uint entry_total;
    uint left_count; // groups left to the second round
};
layout(push_constant) uniform Push {
    uint occluder_count;
    uint block_first;  // quads: centre and reach; largest radius
    uint member_first; // four to a quad
    uint light_first;   // quads: axis and cosine; radiance, entity, whether coloured
    uint light_count;
    uint capacity;     // entries of a cluster
    uint switches;
    float sky;         // radiance; negative without one
    float brightest;
    float eps;
};
#include "gather_scope.glsl"

// The occluders that were found: their distances, their indices, and both in order.
#if ROOMY
layout(std430, binding = 7) coherent buffer Room { uint room[]; };
#define FOUND occluder_count
#define KEY(i) room[2 * (i) * gl_NumWorkGroups.x + 2 * gl_WorkGroupID.x]
#define OCCLUDER(i) room[2 * (i) * gl_NumWorkGroups.x + 2 * gl_WorkGroupID.x + 1]
#define ORDERED(i) OCCLUDER(i)
#else
shared uint keys[ROOM];
shared uint occluders[ROOM];
shared uint ordered[ROOM];
#define FOUND ROOM
#define KEY(i) keys[i]
#define OCCLUDER(i) occluders[i]
#define ORDERED(i) ordered[i]
#endif

shared uint block_count;
shared uint found;
shared uint blocks[BLOCKS];
shared uint nearest, farthest;
shared uint buckets[BUCKETS + 1]; // where each begins

// All invocations wait here, and then see what the others have written.
void meet() {
#if ROOMY
    controlBarrier(gl_ScopeWorkgroup, gl_ScopeWorkgroup, gl_StorageSemanticsShared | gl_StorageSemanticsBuffer,
        gl_SemanticsAcquireRelease);
#else
    barrier();
#endif
}

// Near to far. The host has the same bits: each product and sum is rounded by itself.
uint distance_key(vec3 a, vec3 b) {
    precise vec3 to = a - b;
    precise float square = to.x * to.x + to.y * to.y + to.z * to.z;
    return floatBitsToUint(square); // floats that are not negative have the same order as their bits
}

// Occluders that may matter to any cluster of the group, in no order.
void find(Scope scope, uint receiver, uint lane) {
    for (uint b = lane; b * BLOCK < occluder_count; b += LANES) {
        float radius = scene_quad(block_first + 2 * b + 1).x;
        if (!leaves_out(scope, scene_quad(block_first + 2 * b), radius)) {
            blocks[atomicAdd(block_count, 1)] = b;
        }
    }
    meet();
    for (uint i = lane; i < block_count * BLOCK; i += LANES) {
        uint m = blocks[i / BLOCK] * BLOCK + i % BLOCK;
        if (m >= occluder_count) {
            continue;
        }
        uint e = floatBitsToUint(scene_quad(member_first + m / 4)[m % 4]);
        vec4 sphere = scene_quad(e);
        if (e != receiver && !leaves_out(scope, vec4(sphere.xyz, 0.0), sphere.w)) {
            uint at = atomicAdd(found, 1);
            if (at < FOUND) {
                KEY(at) = distance_key(sphere.xyz, scope.origin);
                OCCLUDER(at) = e;
            }
        }
    }
}

// Near to far from the receiver's centre, ties by index.
#if ROOMY
bool follows(uint a, uint b) {
    return KEY(a) > KEY(b) || (KEY(a) == KEY(b) && OCCLUDER(a) > OCCLUDER(b));
}

// Batcher's bitonic sort: what it takes does not depend on how distances are spread.
void order(uint count, uint lane) {
    uint padded = 1u << (count > 1 ? findMSB(count - 1) + 1 : 0);
    for (uint i = count + lane; i < padded; i += LANES) {
        KEY(i) = ~0u;
        OCCLUDER(i) = ~0u;
    }
    meet();
    for (uint run = 2; run <= padded; run *= 2) {
        for (uint apart = run / 2; apart > 0; apart /= 2) {
            for (uint i = lane; i < padded / 2; i += LANES) {
                uint a = 2 * i - i % apart, b = a + apart;
                if (follows(a, b) == ((a & run) == 0)) {
                    uint key = KEY(a), e = OCCLUDER(a);
                    KEY(a) = KEY(b);
                    OCCLUDER(a) = OCCLUDER(b);
                    KEY(b) = key;
                    OCCLUDER(b) = e;
                }
            }
            meet();
        }
    }
}
#else
// Sorts into buckets by the bits of the distance first, then within each bucket.
void order(uint count, uint lane) {
    for (uint i = lane; i < count; i += LANES) {
        atomicMin(nearest, KEY(i));
        atomicMax(farthest, KEY(i));
    }
    meet();
    uint width = count > 0 ? (farthest - nearest) / BUCKETS + 1 : 1;
    for (uint i = lane; i < count; i += LANES) {
        atomicAdd(buckets[(KEY(i) - nearest) / width + 1], 1);
    }
    meet();
    if (lane == 0) {
        for (uint b = 1; b <= BUCKETS; b++) {
            buckets[b] += buckets[b - 1];
        }
    }
    meet();
    // Each takes a place of its bucket, from the end: afterwards buckets[b + 1] is where bucket b begins.
    for (uint i = lane; i < count; i += LANES) {
        uint end = atomicAdd(buckets[(KEY(i) - nearest) / width + 1], uint(-1));
        ORDERED(end - 1) = i;
    }
    meet();
    for (uint i = lane; i < count; i += LANES) {
        uint key = KEY(i), e = OCCLUDER(i), b = (key - nearest) / width + 1;
        uint end = b < BUCKETS ? buckets[b + 1] : count, rank = buckets[b];
        for (uint j = buckets[b]; j < end; j++) {
            uint other = ORDERED(j);
            rank += uint(KEY(other) < key || (KEY(other) == key && (OCCLUDER(other) & SKY_CHAIN) < e));
        }
        atomicOr(OCCLUDER(i), rank << ENTRY_BITS);
    }
    meet();
    for (uint i = lane; i < count; i += LANES) {
        ORDERED(OCCLUDER(i) >> ENTRY_BITS) = OCCLUDER(i) & SKY_CHAIN;
    }
}
#endif

// One cluster: its entries.
void walk(uint at, Entity receiver, uint receiver_index, uint count) {
    Scope scope = scope_of(receiver, bounds[clusters[at].bounds], SLACK);
    uint first = at * capacity, made = 0, sharp_made = 0;
    uint chains = light_count + uint(sky >= 0.0);
    for (uint l = 0; l < chains; l++) {
        bool of_sky = l == light_count;
        vec4 facing = scene_quad(of_sky ? 0 : light_first + 2 * l);
        vec4 numbers = scene_quad(of_sky ? 0 : light_first + 2 * l + 1);
        uint light_index = floatBitsToUint(numbers.y);
        bool sharp = !of_sky && floatBitsToUint(numbers.w) != 0;
        // The sky has no place; any will do to keep the read in bounds.
        View light = view_of(scope, scene_quad(of_sky ? 0 : light_index));
        if (!of_sky && (light_index == receiver_index || !light_listed(scope, facing, numbers.x, light))) {
            continue;
        }
        uint chain = (of_sky ? SKY_CHAIN : light_index) << ENTRY_BITS;
        for (uint k = 0; k < count; k++) {
            uint e = ORDERED(k);
            View view = view_of(scope, scene_quad(e));
            bool needed = of_sky ? occluder_listed(scope, view, sky)
                                 : e != light_index && occluder_listed(scope, view, light, sharp, numbers.x);
            if (needed && (view.whole || sharp)) {
                if (made < capacity) {
                    entries[first + made] = e | chain;
                }
                made++;
            }
            if (needed && view.cap && !sharp) {
                if (made < capacity) {
                    entries[first + made] = e | chain | ENTRY_CAP;
                }
                made++;
            }
        }
        if (!of_sky) {
            bool coloured = floatBitsToUint(numbers.z) != 0;
            for (uint channel = coloured ? 0 : 2; channel < 3; channel++) {
                uint flags = ENTRY_LIGHT | (coloured ? channel : 3) << ENTRY_CHANNEL | (channel == 2 ? ENTRY_LAST : 0);
                if (made < capacity) {
                    entries[first + made] = light_index | chain | flags;
                }
                made++;
            }
        }
        sharp_made = sharp ? made : sharp_made;
    }
    clusters[at].entry_first = first;
    clusters[at].sharp_count = min(sharp_made, capacity);
    clusters[at].entry_count = min(made, capacity);
    if (made > capacity) {
        clusters[at].vertex_count = 0;
    }
    atomicMax(longest, made);
    atomicAdd(entry_total, made);
}

// One group.
void gather(uint number) {
    uint lane = gl_LocalInvocationIndex;
    uint group_count = groups[number].count;
    uint at = groups[number].first + min(lane, group_count - 1);
    uint receiver_index = clusters[at].receiver;
    Entity receiver = entities[receiver_index];
    if (lane == 0) {
        block_count = 0;
        found = 0;
        nearest = ~0u;
        farthest = 0;
    }
    for (uint b = lane; b <= BUCKETS; b += LANES) {
        buckets[b] = 0;
    }
    meet();
    find(scope_of(receiver, bounds[groups[number].bounds], 2.0 * SLACK), receiver_index, lane);
    meet();
    if (lane == 0) {
        atomicMax(most_found, found);
    }
    if (found * (light_count + 1) > TURNS) {
        // llvmpipe ends all loops of an invocation after 65 535 turns together.
        clusters[at].vertex_count = 0;
        atomicMax(longest, ~0u);
    } else if (found > FOUND) {
        if (lane == 0) {
            groups[atomicAdd(left_count, 1)].left = number;
        }
    } else {
        order(found, lane);
        meet();
        if (lane < group_count) {
            walk(at, receiver, receiver_index, found);
        }
    }
}

void main() {
#if ROOMY
    for (uint i = gl_WorkGroupID.x; i < left_count; i += gl_NumWorkGroups.x) {
        gather(groups[i].left);
        meet();
    }
#else
    gather(gl_WorkGroupID.x);
#endif
}
