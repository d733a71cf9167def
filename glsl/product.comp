#version 460
#extension GL_EXT_control_flow_attributes : require
// Chains of products alone, one an invocation: what a product costs without the reads around it. Every chain is multiplied by
// 1 - b again and again, b fading from step to step, so that nothing that depends on it can be computed once for all steps.
#if POINT_CHAIN
#include "product_points.glsl"
#else
#include "merge_product.glsl"
#endif

layout(local_size_x = WORKGROUP) in;

layout(std430, binding = 0) readonly buffer Transfers { float transfers[]; };
layout(std430, binding = 1) readonly buffer Factors { float factors[]; };
layout(std430, binding = 2) writeonly buffer Products { float products[]; };

layout(push_constant) uniform Push {
    uint count;
    uint steps; // at least 1
    float fade; // what each step multiplies b by
} push;

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= push.count) {
        return;
    }
    float transfer[COEFFICIENTS];
    [[unroll]] for (uint k = 0; k < COEFFICIENTS; k++) {
        transfer[k] = transfers[i * COEFFICIENTS + k];
    }
    float b[FETCHED];
    [[unroll]] for (uint k = 0; k < FETCHED; k++) {
        b[k] = k < FIELD_COEFFICIENTS ? factors[i * FIELD_COEFFICIENTS + k] : 0.0;
    }
    float c[CHAIN];
    chain_begin(transfer, c);
    uint step = 0;
    do {
#if MULTIPLY
        chain_multiply(c, b);
#else
        // The loop without its product, to take off.
        [[unroll]] for (uint k = 0; k < TERMS; k++) {
            c[k] += b[k % FETCHED];
        }
#endif
        [[unroll]] for (uint k = 0; k < FETCHED; k++) {
            b[k] *= push.fade;
        }
        step++;
    } while (step < push.steps);
    chain_end(c, transfer);
    [[unroll]] for (uint k = 0; k < COEFFICIENTS; k++) {
        products[i * COEFFICIENTS + k] = transfer[k];
    }
}
