// A surface's radiance as the picture shows it, linear.
vec3 finish(vec3 radiance, float white) {
    // Ringing of SH may make radiance negative; it is clamped to 0.
    vec3 shown = max(radiance, vec3(0.0));
    float brightest = max(shown.r, max(shown.g, shown.b));
    if (brightest > white) {
        shown *= white / brightest;
    }
    return shown;
}
