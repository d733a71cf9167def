#version 460
#extension GL_EXT_samplerless_texture_functions : require
// Projects cube faces to SH coefficients, one workgroup per sample. Every invocation sums its share of the texels; then
// one invocation per coefficient adds the shares in order, so the result does not depend on scheduling.
#include "generated/basis.glsl"
#if COSINE
#include "generated/cosine.glsl"
#endif

layout(local_size_x = WORKGROUP) in;

#include "captured.glsl"

// For each texel of a face: unit direction as components along (right, down, forward), and solid angle in steradians.
layout(binding = 2) uniform textureBuffer texels;
layout(std430, binding = 3) writeonly buffer Coefficients { float coefficients[]; };

shared float shares[COEFFICIENTS * CHANNELS][WORKGROUP];

void main() {
    uint index = gl_WorkGroupID.x;
    uint lane = gl_LocalInvocationID.x;
    float sums[COEFFICIENTS * CHANNELS];
    for (uint k = 0; k < COEFFICIENTS * CHANNELS; k++) {
        sums[k] = 0.0;
    }
    uint texel_count = push.face_px * push.face_px;
    for (uint face = 0; face < 6; face++) {
        uint slot = samples[index].slots[face];
        if (slot == NONE) {
            continue;
        }
        ivec2 origin = slot_origin(slot);
        for (uint i = lane; i < texel_count; i += WORKGROUP) {
            vec4 captured = texelFetch(atlas, origin + ivec2(i % push.face_px, i / push.face_px), 0);
#if CHANNELS == 3
            vec3 value = captured.rgb;
            if (value == vec3(0.0)) {
                continue;
            }
#else
            float value = float(captured.r < 1.0); // the object is black, or the darker the nearer it is
            if (value == 0.0) {
                continue;
            }
#endif
            vec4 texel = texelFetch(texels, int(i));
            vec3 direction = to_object(face, texel.xyz);
            float weight = texel.w;
#if COSINE
            weight *= max(0.0, dot(samples[index].normal.xyz, direction));
#endif
            float y[COEFFICIENTS];
            sh_basis(direction, y);
            for (uint k = 0; k < COEFFICIENTS; k++) {
#if CHANNELS == 3
                sums[k] += weight * value.r * y[k];
                sums[COEFFICIENTS + k] += weight * value.g * y[k];
                sums[2 * COEFFICIENTS + k] += weight * value.b * y[k];
#else
                sums[k] += weight * value * y[k];
#endif
            }
        }
    }
    for (uint k = 0; k < COEFFICIENTS * CHANNELS; k++) {
        shares[k][lane] = sums[k];
    }
    barrier();
    for (uint i = lane; i < STRIDE * CHANNELS; i += WORKGROUP) {
        uint channel = i / STRIDE;
        uint k = i % STRIDE;
        float total = 0.0; // value of the padding coefficients of a channel
        if (k < COEFFICIENTS) {
            for (uint other = 0; other < WORKGROUP; other++) {
                total += shares[channel * COEFFICIENTS + k][other];
            }
            total *= samples[index].scale;
#if COSINE
            // The unoccluded part is the whole cosine lobe minus the part that the object's own geometry blocks.
            float lobe[COEFFICIENTS];
            sh_cosine(samples[index].normal.xyz, lobe);
            total = lobe[k] - total;
#endif
        }
        coefficients[index * (STRIDE * CHANNELS) + i] = total;
    }
}
