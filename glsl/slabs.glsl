// Where a ray has entered all three slabs of a box, and where it leaves the first: before that if it misses the box.
// `low` and `high` are the box's corners from the ray's point, along its axes. The twin is in src/field/silhouette.rs.
#ifndef SLABS
#define SLABS
#if BOXES || CUBOIDS || HALVES
vec2 slabs(vec3 low, vec3 high, vec3 direction) {
    vec3 per_step = 1.0 / mix(direction, vec3(LEAST_STEP), lessThan(abs(direction), vec3(LEAST_STEP)));
    vec3 one = low * per_step, other = high * per_step;
    vec3 first = min(one, other), last = max(one, other);
    return vec2(max(max(first.x, first.y), first.z), min(min(last.x, last.y), last.z));
}
#endif
#endif
