#version 460
layout(location = 0) in vec3 radiance;
layout(location = 1) flat in float white;
layout(location = 0) out vec4 color;

void main() {
    // The SH of a light may ring below zero; a picture may not.
    vec3 shown = max(radiance, vec3(0.0));
    float brightest = max(shown.r, max(shown.g, shown.b));
    if (brightest > white) {
        shown *= white / brightest;
    }
#if DISPLAY
    // IEC 61966-2-1, white at 1.
    shown /= white;
    shown = mix(1.055 * pow(shown, vec3(1.0 / 2.4)) - 0.055, 12.92 * shown, lessThanEqual(shown, vec3(0.0031308)));
#endif
    color = vec4(shown, 1.0);
}
