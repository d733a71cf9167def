// An occluder that a vertex sees small blocks one direction, as a point: the chain loses its value there times the
// solid angle of the occluder's projected area (src/field/area.rs). Between CAP_SINE_LEAST and CAP_SINE_MOST, sines of
// the bounding sphere's half-angle, this and the field are blended, so that nothing pops.

// Share of the field; the rest is the point's.
float field_share(Cone cone) {
#if SKIP_CAPS
    return smoothstep(CAP_SINE_LEAST, CAP_SINE_MOST, cone.sine);
#else
    return 1.0;
#endif
}

#if SKIP_CAPS
#include "area.glsl"

// The point occluder: its solid angle and, in the world, the basis in its direction. Cut to a few bands, a disc of mean
// square radius q (radians) has 1 - l (l + 1) q / 4 of what a point has in band l.
float cap_of(Entity entity, Cone cone, out float y[COEFFICIENTS]) {
    float square = cone.sine * cone.sine;
    float covered = area_share(entity, cone.toward) * square;
    sh_basis(cone.toward, y);
    float quarter = 0.25 * CAP_SPREAD * covered;
    // One loop, not one in another, which Mesa does not unroll.
    [[unroll]] for (uint k = 1; k < COEFFICIENTS; k++) {
        uint l = uint(sqrt(float(k) + 0.5));
        y[k] *= max(1.0 - float(l * (l + 1)) * quarter, 0.0);
    }
    return 2.0 * PI * covered / (1.0 + cone.cosine);
}
#endif
