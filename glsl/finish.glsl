// What a surface's radiance becomes in the picture. DISPLAY: 8 bits of sRGB with white at 1; else linear.
#include "srgb.glsl"

vec3 finish(vec3 radiance, float white) {
    // The SH of a light may ring below zero; a picture may not.
    vec3 shown = max(radiance, vec3(0.0));
    float brightest = max(shown.r, max(shown.g, shown.b));
    if (brightest > white) {
        shown *= white / brightest;
    }
#if DISPLAY
    shown = srgb_from_linear(shown / white);
#endif
    return shown;
}
