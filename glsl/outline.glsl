// How an outline blocks a small round light, wherever the outline comes from. The twin is src/field/silhouette.rs.
#include "blocked_share.glsl"
#include "slabs.glsl"

// 1 where a length (in r) is positive and 0 where it is negative, with a ramp between.
float fade(float l) {
    return clamp(l / NEAREST + 0.5, 0.0, 1.0);
}

// Share of a small round light that an outline blocks which lies that far away and at least `nearest`, in r.
float share_blocked(float distance, float away, float nearest, float tangent) {
    return blocked_share(distance / max(max(away, nearest) * tangent, LEAST_PENUMBRA));
}

#if BOXES || CUBOIDS || HALVES
// How far the place where a ray enters a box lies beyond the point, and that where it leaves it before the limit.
vec2 box_ends(vec2 in_box, float limit) {
    return clamp(1.0 - vec2(-in_box[0], in_box[1] - limit) / NEAREST, 0.0, 1.0);
}
#endif

// How far an outline counts that lies that far away: 0 behind the point or beyond the limit, 1 between them. Its
// nearest point may lie off the ray, and the object then stands where the ray passes its box: all of it, where the ray
// enters and leaves the box between point and limit, with a ramp where the box reaches beyond either.
float counts_between(float away, float limit, vec2 in_box) {
#if BOXES || CUBOIDS
    bool apart = in_box[1] < TOUCHING || in_box[0] > limit - TOUCHING;
    away = min(max(away, in_box[0]), in_box[1]);
    vec2 between = max(vec2(fade(away), fade(limit - away)), box_ends(in_box, limit));
    return apart ? 0.0 : between.x * between.y;
#else
    return fade(away) * fade(limit - away);
#endif
}
