// The light that leaves what moves, by direction, as outgoing.comp wrote it. LEAVING_BINDING says where it lies.
#include "readable.glsl"
// Nine coefficients an entity, in its frame: area times light; area.
READ_VEC4(LEAVING_BINDING, Outgoing, outgoing, outgoing_at)

// Mean radiosity of those surfaces of a mover that are seen along a direction, which comes from the mover in its frame:
// the light that leaves it that way, over its area as seen from there.
vec3 seen(uint e, vec3 direction) {
    float y[COEFFICIENTS];
    sh_basis(direction, y);
    vec4 sum = vec4(0.0);
    [[unroll]] for (uint k = 0; k < min(COEFFICIENTS, 9); k++) {
        sum += y[k] * outgoing_at(9 * e + k);
    }
    return max(sum.rgb, 0.0) / max(max(sum.w, 0.1 * y[0] * outgoing_at(9 * e).w), 1e-20);
}

// Towards the middle of the directions that a mover blocks, from the viewer and turned around: band 1, of which x and y
// are negative. `from` is the viewer's place in the mover's frame.
vec3 seen_from(vec3 from, float blocked[COEFFICIENTS]) {
    vec3 middle = from;
#if COEFFICIENTS >= 4
    middle = vec3(blocked[3], blocked[1], -blocked[2]);
#endif
    return middle / max(length(middle), 1e-20);
}
