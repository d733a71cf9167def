// Converts a surface's radiance to a colour of the picture: sRGB for 8 bits with white at 1 if DISPLAY, else linear.
#include "srgb.glsl"

vec3 finish(vec3 radiance, float white) {
    // Ringing of SH may make radiance negative; it is clamped to 0.
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
