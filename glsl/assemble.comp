#version 460
// Computes stored samples from captured samples: each is the weighted sum of the captured samples that the host lists
// for it. One invocation computes four coefficients.
layout(local_size_x = WORKGROUP) in;

layout(std430, binding = 0) readonly buffer Captured { vec4 captured[]; };
layout(std430, binding = 1) readonly buffer Offsets { uint offsets[]; };
layout(std430, binding = 2) readonly buffer Sources { uvec2 sources[]; }; // sample, bits of its weight
#if HALF
layout(std430, binding = 3) writeonly buffer Stored { uvec2 stored[]; };
#else
layout(std430, binding = 3) writeonly buffer Stored { vec4 stored[]; };
#endif

const float LEAST_HALF = 6.103515625e-5; // 2^-14

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
        uvec2 source = sources[k];
        sum += uintBitsToFloat(source.y) * captured[source.x * push.sample_quads + quad];
    }
    sum *= push.factor;
#if HALF
    // Subnormal halves are stored as 0: shaders that unpack them are slow on some devices and flush them to 0 on
    // others.
    sum = mix(sum, vec4(0.0), lessThan(abs(sum), vec4(LEAST_HALF)));
    stored[i] = uvec2(packHalf2x16(sum.xy), packHalf2x16(sum.zw));
#else
    stored[i] = sum;
#endif
}
