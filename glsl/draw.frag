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
    color = vec4(shown, 1.0);
}
