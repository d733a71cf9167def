#version 460
#if RADIANCE
layout(location = 0) in vec3 radiance;
#elif DISTANCE
layout(location = 0) in vec3 toward;
#endif
layout(location = 0) out vec4 texel;

void main() {
#if RADIANCE
    texel = vec4(radiance, 1.0);
#elif DISTANCE
    // The object reaches no farther than 2 r; 255 stands for the background.
    texel = vec4(min(length(toward), 2.0) * DISTANCE_STEPS / 255.0);
#else
    texel = vec4(0.0); // black object on a white background
#endif
}
