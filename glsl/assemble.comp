#version 460
// Captured samples to stored samples: each is the mean of the captured ones that the host lists for it (one for a cell, its
// neighbours' for a border cell, valid ones around it for a sample inside the solid). One invocation a quad of coefficients.
layout(local_size_x = WORKGROUP) in;

layout(std430, binding = 0) readonly buffer Captured { vec4 captured[]; };
layout(std430, binding = 1) readonly buffer Offsets { uint offsets[]; };
layout(std430, binding = 2) readonly buffer Sources { uint sources[]; };
#if HALF
layout(std430, binding = 3) writeonly buffer Stored { uvec2 stored[]; };
#else
layout(std430, binding = 3) writeonly buffer Stored { vec4 stored[]; };
#endif

layout(push_constant) uniform Push {
    uint quad_count;
    uint sample_quads;
    float factor;
} push;

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= push.quad_count) {
        return;
    }
    uint target = i / push.sample_quads;
    uint quad = i % push.sample_quads;
    vec4 sum = vec4(0.0);
    for (uint k = offsets[target]; k < offsets[target + 1]; k++) {
        sum += captured[sources[k] * push.sample_quads + quad];
    }
    vec4 mean = sum * (push.factor / float(offsets[target + 1] - offsets[target]));
#if HALF
    stored[i] = uvec2(packHalf2x16(mean.xy), packHalf2x16(mean.zw));
#else
    stored[i] = mean;
#endif
}
