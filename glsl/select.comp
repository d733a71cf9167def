#version 460
#extension GL_EXT_samplerless_texture_functions : require
// Lists the places whose light is evaluated. With COARSE these are every fourth pixel along both axes that shows a
// surface. Else they are pixels near a shadow's edge whose light the four coarse places around do not tell; the others
// take it from these, where they lie on the pixel's surface and no edge runs between them, neither of a shadow nor of a
// facet. An edge is near to all four that it runs between, or they differ.
layout(local_size_x = 64) in;
layout(binding = 0) uniform utexture2D seen_triangles;
layout(binding = 1) uniform utexture2D seen_places;
layout(binding = 2) uniform texture2D depths;
#define WORK_BLOCK layout(std430, binding = 3) buffer
#include "pixel_work.glsl"
layout(binding = 4, rgba32ui) uniform writeonly uimage2D light;
#if !COARSE
layout(binding = 5) uniform utexture2D coarse;
#endif
#include "screen_light.glsl"
#include "seen_surface.glsl"

layout(push_constant) uniform Push {
    uvec4 part; // pixels that are drawn: left, top, width and height
} push;

const uvec2 BLOCK = uvec2(BLOCK_X, BLOCK_Y); // places that one invocation selects
shared uint listed; // places of this workgroup
shared uint first;  // of them in the list

bool is_in_part(ivec2 pixel) {
    return all(greaterThanEqual(pixel, ivec2(push.part.xy))) && all(lessThan(pixel, ivec2(push.part.xy + push.part.zw)));
}

#if COARSE
const uint STEP = 0;
const uint TEXEL_PX = COARSE_PX;
#else
const uint STEP = 1;
const uint TEXEL_PX = 1;
#endif

uvec2 place_of(uvec2 corner, uint i) {
    return corner + uvec2(i % BLOCK.x, i / BLOCK.x);
}

ivec2 pixel_of(uvec2 at) {
    return ivec2(TEXEL_PX * at + TEXEL_PX / 2);
}

#if !COARSE
// What four coarse places tell of a pixel, or 0.
uvec4 interpolated(uvec2 pixel, SeenSurface seen, float depth) {
    uint key = light_key(seen.receiver, seen.front);
    vec2 place = (vec2(pixel) - float(COARSE_PX / 2)) / float(COARSE_PX);
    ivec2 low = ivec2(floor(place));
    vec2 within = place - vec2(low);
    vec3 light = vec3(0.0);
    vec4 shares = vec4(0.0);
    vec3 least = vec3(65504.0), most = vec3(0.0);
    float whole = 0.0;
    uint found = 0, near = 0;
    for (uint i = 0; i < 4; i++) {
        ivec2 at = low + ivec2(i & 1, i >> 1);
        bool known = is_in_part(int(COARSE_PX) * at + int(COARSE_PX) / 2);
        uvec4 texel = known ? texelFetch(coarse, at, 0) : uvec4(0);
        float there = depth + float(COARSE_PX) * dot(seen.slope, vec2(at) - place);
        bool fits = known && is_of(texel, key, there, SAME_DEPTH * depth);
        vec3 own = light_of(texel);
        float weight = ((i & 1) == 0 ? 1.0 - within.x : within.x) * ((i >> 1) == 0 ? 1.0 - within.y : within.y);
        weight = fits ? weight : 0.0;
        light += weight * own;
        shares += weight * shares_of(texel);
        whole += weight;
        least = fits ? min(least, own) : least;
        most = fits ? max(most, own) : most;
        found += fits ? 1 : 0;
        near += fits && is_edge_near(texel) ? 1 : 0;
    }
    bool differ = dot(most - least, vec3(1.0)) > MOST_CHANGE * dot(most, vec3(1.0));
    bool tells = whole >= LEAST_WHOLE && near < 4 && (near == 0 || found == 4) && !differ;
    return tells ? pack_light(key, depth, light / whole, shares / whole, false) : uvec4(0);
}
#endif

void main() {
    // Blocks of four by two places follow each other, whose light is evaluated at the same time. An invocation selects
    // one block, whose places with nothing to tell go first: a software device runs a branch that no lane takes.
    uint lane = gl_LocalInvocationIndex;
    uvec2 corner = push.part.xy / TEXEL_PX + BLOCK * (8 * gl_WorkGroupID.xy + uvec2(lane & 7, lane >> 3));
    uint wanted = 0;
    for (uint i = 0; i < BLOCK.x * BLOCK.y; i++) {
        uvec2 at = place_of(corner, i);
        ivec2 pixel = pixel_of(at);
        if (is_in_part(pixel)) {
            uint seen = texelFetch(seen_triangles, pixel, 0).w;
            bool lit = COARSE == 1 ? is_seen(seen) : has_edge(seen);
            wanted |= lit ? 1u << i : 0;
            if (!lit) {
                imageStore(light, ivec2(at), uvec4(0));
            }
        }
    }
#if !COARSE
    uint near = wanted;
    while (near != 0) {
        uint i = findLSB(near);
        near &= near - 1;
        uvec2 at = place_of(corner, i);
        ivec2 pixel = pixel_of(at);
        SeenSurface seen = unpack_surface(texelFetch(seen_triangles, pixel, 0), texelFetch(seen_places, pixel, 0));
        uvec4 found = interpolated(at, seen, texelFetch(depths, pixel, 0).r);
        if (found != uvec4(0)) {
            imageStore(light, ivec2(at), found);
            wanted &= ~(1u << i);
        }
    }
#endif
    if (lane == 0) {
        listed = 0;
    }
    barrier();
    uint place = atomicAdd(listed, bitCount(wanted));
    barrier();
    if (lane == 0 && listed > 0) {
        first = atomicAdd(work.steps[STEP].count, listed);
        uint groups = (first + listed + 63) / 64;
        atomicMax(work.steps[STEP].groups[0], min(groups, MOST_GROUPS));
        atomicMax(work.steps[STEP].groups[1], (groups + MOST_GROUPS - 1) / MOST_GROUPS);
#if !COARSE
        atomicAdd(work.total, listed);
#endif
    }
    barrier();
    place += first;
    for (uint i = 0; i < BLOCK.x * BLOCK.y; i++) {
        if ((wanted >> i & 1) != 0) {
            uvec2 at = place_of(corner, i);
            work.places[place] = at.x | at.y << 16;
            place++;
        }
    }
}
