#version 460
layout(location = 0) in vec3 radiance;
layout(location = 0) out vec4 color;

void main() {
    // The SH of a light may ring below zero; a picture may not.
    color = vec4(max(radiance, vec3(0.0)), 1.0);
}
