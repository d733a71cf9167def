// What a bounding sphere covers of a vertex's view, and the skips that follow from it: they are exact for true
// visibility. The band-limited product is not zero there, so each fades out over FADE radians beyond its threshold and
// nothing pops.

struct Cone {
    vec3 toward;    // unit, to the sphere's centre
    float distance; // metres
    float sine;     // of the half-angle; 1 from inside the sphere
    float cosine;
};

// `centre` as in Entity: w = 1 / radius.
Cone cone_of(vec4 centre, vec3 position) {
    vec3 to = centre.xyz - position;
    Cone cone;
    cone.distance = length(to);
    cone.toward = to / max(cone.distance, 1e-30);
    cone.sine = min(1.0, 1.0 / max(centre.w * cone.distance, 1e-30));
    cone.cosine = sqrt((1.0 - cone.sine) * (1.0 + cone.sine));
    return cone;
}

const float FADE_SINE = sin(FADE);
const float FADE_COSINE = cos(FADE);
const float MEET_SINE = sin(MEET);

// 1 while any of the cone stands above the horizon of the surface, 0 when it lies FADE below. From within FADE of the
// sphere it never reaches 0.
float above_horizon(Cone cone, vec3 normal) {
#if SKIP_HORIZON
    return smoothstep(-cone.sine - FADE_SINE, -cone.sine, dot(normal, cone.toward));
#else
    return 1.0;
#endif
}

// 0 when two cones are FADE apart, 1 when they reach MEET into one another, or one into the middle of the other; from
// near a sphere they need reach less. Cones that fill the view together always overlap.
float overlap(Cone a, Cone b) {
#if SKIP_CONES
    float cosine = a.cosine * b.cosine - a.sine * b.sine;
    float sine = a.sine * b.cosine + a.cosine * b.sine;
    float apart = cosine * FADE_COSINE - sine * FADE_SINE;
    if (max(a.sine, b.sine) == 1.0 || apart >= cosine) {
        return 1.0;
    }
    float deep_sine = MEET_SINE * min(a.cosine, b.cosine);
    float deep_cosine = sqrt(1.0 - deep_sine * deep_sine);
    float met = cosine >= deep_cosine ? 1.0 : cosine * deep_cosine + sine * deep_sine;
    return smoothstep(apart, met, dot(a.toward, b.toward));
#else
    return 1.0;
#endif
}

// How much of occluder e lies before light l: by distance of the centres, ties by index; less where their cones part.
float before(uint e, Cone occluder, uint l, Cone light) {
    bool nearer = occluder.distance < light.distance || (occluder.distance == light.distance && e < l);
    return nearer ? overlap(occluder, light) : 0.0;
}
