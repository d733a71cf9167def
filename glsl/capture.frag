#version 460
#if RADIANCE
layout(location = 0) in vec3 radiance;
#endif
layout(location = 0) out vec4 texel;

void main() {
#if RADIANCE
    texel = vec4(radiance, 1.0);
#else
    texel = vec4(0.0); // black object on a white background
#endif
}
