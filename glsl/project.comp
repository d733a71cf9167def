#version 460
#extension GL_EXT_samplerless_texture_functions : require
// Projects cube faces to SH coefficients, one workgroup per sample. Every invocation sums its share of the texels; then
// one invocation per coefficient adds the shares in order, so the result does not depend on scheduling.
#include "generated/basis.glsl"

layout(local_size_x = WORKGROUP) in;

struct SampleFaces {
    uint slots[6]; // place of each face in the atlas; NONE where the object does not reach
    float scale;   // factor on coefficients
};

layout(binding = 0) uniform texture2D atlas;
layout(std430, binding = 1) readonly buffer Samples { SampleFaces samples[]; };
// For each texel of a face: unit direction as components along (right, down, forward), and solid angle in steradians.
layout(binding = 2) uniform textureBuffer texels;
layout(std430, binding = 3) writeonly buffer Coefficients { float coefficients[]; };

layout(push_constant) uniform Push {
    uint face_px;
    uint atlas_columns;
} push;

const uint NONE = 0xffffffffu;

ivec2 slot_origin(uint slot) {
    return ivec2(slot % push.atlas_columns, slot / push.atlas_columns) * int(push.face_px);
}

vec3 to_object(uint face, vec3 d) {
    switch (face) {
        case 0: return vec3(d.z, -d.y, -d.x);
        case 1: return vec3(-d.z, -d.y, d.x);
        case 2: return vec3(d.x, d.z, d.y);
        case 3: return vec3(d.x, -d.z, -d.y);
        case 4: return vec3(d.x, -d.y, d.z);
        default: return vec3(-d.x, -d.y, -d.z);
    }
}

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
            float value = float(captured.r < 1.0); // the object is black
            if (value == 0.0) {
                continue;
            }
#endif
            vec4 texel = texelFetch(texels, int(i));
            vec3 direction = to_object(face, texel.xyz);
            float weight = texel.w;
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
        }
        coefficients[index * (STRIDE * CHANNELS) + i] = total;
    }
}
