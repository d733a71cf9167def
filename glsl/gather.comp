#version 460
// The steps of every cluster, a group of neighbouring clusters of one receiver a workgroup. First all invocations look for the
// occluders that may matter to any of the clusters, by the block and then one by one, and put them into the receiver's order;
// then each walks its own cluster through what was found, light by light and at last the sky, and writes what it keeps.
// Decisions come from sums and products alone (repeatable.glsl), so that the host can make the same lists.
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
    uint spare;
};

// Spheres of all entities (centre in the world, radius), then blocks of occluders, their members, and lights.
#if TEXEL
layout(binding = 0) uniform textureBuffer bodies;
vec4 body(uint i) {
    return texelFetch(bodies, int(i));
}
#else
layout(std430, binding = 0) readonly buffer Bodies { vec4 bodies[]; };
vec4 body(uint i) {
    return bodies[i];
}
#endif
layout(std430, binding = 1) readonly buffer Entities { Entity entities[]; };
layout(std430, binding = 2) readonly buffer AllBounds { Bounds bounds[]; };
layout(std430, binding = 3) readonly buffer Groups { Group groups[]; };
layout(std430, binding = 4) buffer Clusters { Cluster clusters[]; };
layout(std430, binding = 5) writeonly buffer Steps { uint steps[]; };
layout(std430, binding = 6) buffer Report {
    uint longest;
    uint most_found;
    uint step_total;
    uint spare;
};
layout(push_constant) uniform Push {
    uint occluder_count;
    uint block_first;  // quads: centre and reach; largest radius
    uint member_first; // four to a quad
    uint lamp_first;   // quads: axis and cosine; radiance, entity, whether coloured
    uint lamp_count;
    uint capacity;     // steps of a cluster
    uint switches;
    float sky;         // radiance; negative without one
    float brightest;
    float eps;
};
#include "gather_scope.glsl"

shared uint block_count;
shared uint found;
shared uint blocks[BLOCKS];
shared uint keys[FOUND];
shared uint occluders[FOUND];
shared uint ordered[FOUND];
shared uint nearest, farthest;
shared uint buckets[BUCKETS + 1]; // where each begins

// Occluders that may matter to any cluster of the group, in no order.
void find(Scope scope, uint receiver, uint lane) {
    for (uint b = lane; b * BLOCK < occluder_count; b += LANES) {
        float radius = body(block_first + 2 * b + 1).x;
        precise float most = crowd_weight(scope, body(block_first + 2 * b), radius) * brightest;
        if (!negligible(scope, most)) {
            blocks[atomicAdd(block_count, 1)] = b;
        }
    }
    barrier();
    for (uint i = lane; i < block_count * BLOCK; i += LANES) {
        uint m = blocks[i / BLOCK] * BLOCK + i % BLOCK;
        if (m >= occluder_count) {
            continue;
        }
        uint e = floatBitsToUint(body(member_first + m / 4)[m % 4]);
        vec4 sphere = body(e);
        precise float most = crowd_weight(scope, vec4(sphere.xyz, 0.0), sphere.w) * brightest;
        if (e != receiver && !negligible(scope, most)) {
            uint at = atomicAdd(found, 1);
            if (at < FOUND) {
                precise vec3 to = sphere.xyz - scope.origin;
                keys[at] = floatBitsToUint(sum_of_products(to, to)); // not negative: more in bits is more
                occluders[at] = e;
            }
        }
    }
}

// Near to far from the receiver's centre, ties by index: first into stretches of equal length in bits, then within each.
void order(uint count, uint lane) {
    for (uint i = lane; i < count; i += LANES) {
        atomicMin(nearest, keys[i]);
        atomicMax(farthest, keys[i]);
    }
    barrier();
    uint width = count > 0 ? (farthest - nearest) / BUCKETS + 1 : 1;
    for (uint i = lane; i < count; i += LANES) {
        atomicAdd(buckets[(keys[i] - nearest) / width + 1], 1);
    }
    barrier();
    if (lane == 0) {
        for (uint b = 1; b <= BUCKETS; b++) {
            buckets[b] += buckets[b - 1];
        }
    }
    barrier();
    // Each takes a place of its bucket, from the end: afterwards buckets[b + 1] is where bucket b begins.
    for (uint i = lane; i < count; i += LANES) {
        ordered[atomicAdd(buckets[(keys[i] - nearest) / width + 1], uint(-1)) - 1] = i;
    }
    barrier();
    for (uint i = lane; i < count; i += LANES) {
        uint key = keys[i], e = occluders[i], b = (key - nearest) / width + 1;
        uint end = b < BUCKETS ? buckets[b + 1] : count, rank = buckets[b];
        for (uint j = buckets[b]; j < end; j++) {
            uint other = ordered[j];
            rank += uint(keys[other] < key || (keys[other] == key && (occluders[other] & SKY_CHAIN) < e));
        }
        atomicOr(occluders[i], rank << STEP_BITS);
    }
    barrier();
    for (uint i = lane; i < count; i += LANES) {
        ordered[occluders[i] >> STEP_BITS] = occluders[i] & SKY_CHAIN;
    }
}

void main() {
    Group group = groups[gl_WorkGroupID.x];
    uint lane = gl_LocalInvocationIndex;
    uint at = group.first + min(lane, group.count - 1);
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
    barrier();
    find(scope_of(receiver, bounds[group.bounds]), receiver_index, lane);
    barrier();
    uint count = min(found, FOUND);
    order(count, lane);
    barrier();
    if (lane >= group.count) {
        return;
    }
    Scope scope = scope_of(receiver, bounds[clusters[at].bounds]);
    uint first = at * capacity, made = 0;
    uint chains = lamp_count + uint(sky >= 0.0);
    for (uint l = 0; l < chains; l++) {
        bool of_sky = l == lamp_count;
        vec4 facing = body(of_sky ? 0 : lamp_first + 2 * l);
        vec4 lamp = body(of_sky ? 0 : lamp_first + 2 * l + 1);
        uint lamp_index = floatBitsToUint(lamp.y);
        // The sky has no place; any will do to keep the read in bounds.
        View light = view_of(scope, body(of_sky ? 0 : lamp_index));
        if (!of_sky && (lamp_index == receiver_index || !light_listed(scope, facing, lamp.x, light))) {
            continue;
        }
        uint chain = (of_sky ? SKY_CHAIN : lamp_index) << STEP_BITS;
        for (uint k = 0; k < count; k++) {
            uint e = ordered[k];
            View view = view_of(scope, body(e));
            bool needed = of_sky ? occluder_listed(scope, view, sky)
                                 : e != lamp_index && occluder_listed(scope, view, light, lamp.x);
            if (needed) {
                if (made < capacity) {
                    steps[first + made] = e | chain;
                }
                made++;
            }
        }
        if (!of_sky) {
            bool coloured = floatBitsToUint(lamp.z) != 0;
            for (uint channel = coloured ? 0 : 2; channel < 3; channel++) {
                uint flags = STEP_LIGHT | (coloured ? channel : 3) << STEP_CHANNEL | (channel == 2 ? STEP_LAST : 0);
                if (made < capacity) {
                    steps[first + made] = lamp_index | chain | flags;
                }
                made++;
            }
        }
    }
    clusters[at].step_first = first;
    clusters[at].step_count = min(made, capacity);
    if (made > capacity || found > FOUND) {
        clusters[at].vertex_count = 0;
    }
    atomicMax(longest, made);
    atomicMax(most_found, found);
    atomicAdd(step_total, made);
}
