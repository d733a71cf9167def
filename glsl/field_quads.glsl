// Fields as one quad a read, from texels or from a storage block.
#if TEXEL
layout(binding = FIELD_BINDING) uniform textureBuffer field_quads;
vec4 field_quad(uint i) {
    return texelFetch(field_quads, int(i));
}
#elif HALF
layout(std430, binding = FIELD_BINDING) readonly buffer FieldQuads { uvec2 field_quads[]; };
vec4 field_quad(uint i) {
    uvec2 packed = field_quads[i];
    return vec4(unpackHalf2x16(packed.x), unpackHalf2x16(packed.y));
}
#else
layout(std430, binding = FIELD_BINDING) readonly buffer FieldQuads { vec4 field_quads[]; };
vec4 field_quad(uint i) {
    return field_quads[i];
}
#endif

void field_sums(FieldPlace place, uint base, uint sample_quads, out vec4 sums[FETCHED_QUADS]) {
    [[unroll]] for (uint q = 0; q < FETCHED_QUADS; q++) {
        // All corners are read before any is used, as in field_packed.glsl.
        vec4 quads[CORNERS];
        [[unroll]] for (uint k = 0; k < CORNERS; k++) {
            quads[k] = field_quad(base + place.corner[k] * sample_quads + q);
        }
        sums[q] = vec4(0.0);
        [[unroll]] for (uint k = 0; k < CORNERS; k++) {
            sums[q] += place.weight[k] * quads[k];
        }
    }
}
