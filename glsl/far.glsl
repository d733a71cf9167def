// What rests, as what moves sees it, and what else the passes of src/bounce/movers.rs share.
#define ENTITY_BINDING 0
#include "entities.glsl"
#include "readable.glsl"
#include "links.glsl"
READ_UINT(1, Entries, entries, entry_at)
READ_VEC4(2, Far, far, far_at) // two a run, world: its middle; its mean normal, and the area that faces that way
READ_VEC4(3, RunLight, run_light, run_light_at)

// Light of what rests, as flat discs: `count` entries of runs and their weights, with nothing else between. Returns the
// sums of shares of the cosine-weighted hemisphere times radiosity, and of the shares.
//
// A disc's share is that of its middle as if seen from afar, but for two things that keep it right nearby, where the sum
// over a plane of discs was short by up to two thirds. Places over the disc count as over its middle, and the cosine is
// smoothed by as much as it varies over the disc, so that a wall sees the floor at its foot.
vec4 near_light(vec3 place, vec3 normal, uint first, uint count) {
    vec4 sum = vec4(0.0);
    for (uint i = first; i < first + count; i++) {
        uint packed = entry_at(i), run = link_number(packed);
        vec3 to = far_at(2 * run).xyz - place;
        vec4 across = far_at(2 * run + 1);
        float area = across.w;
        float height = max(-dot(to, across.xyz), 0.0), faces = -dot(normal, across.xyz);
        float aside = max(dot(to, to) - height * height, 1e-20); // squared
        float beyond = max(aside - OVER * area / PI, 0.0);
        float cosine = faces * height + (dot(normal, to) - faces * height) * sqrt(beyond / aside);
        float width = SMOOTH * sqrt(area / PI);
        float smoothed = sqrt(max(1.0 - faces * faces, 0.0)) * height * width / (height + width);
        cosine = 0.5 * (cosine + sqrt(cosine * cosine + smoothed * smoothed));
        float square = max(height * height + beyond, 1e-20);
        float share = cosine * height * area / (square * (PI * square + area));
        share *= link_share(packed);
        sum += share * vec4(run_light_at(run).rgb, 1.0);
    }
    return sum;
}

// Where discs stand before each other they take no more than the hemisphere.
vec3 within_hemisphere(vec4 sum) {
    return sum.rgb / max(sum.w, 1.0);
}
