// Fields as one quad a read, from texels or from a storage block.
#include "readable.glsl"
#if HALF && !TEXEL
READ_UVEC2(FIELD_BINDING, FieldQuads, field_quads, field_halves)
vec4 field_quad(uint i) {
    uvec2 packed = field_halves(i);
    return vec4(unpackHalf2x16(packed.x), unpackHalf2x16(packed.y));
}
#else
READ_VEC4(FIELD_BINDING, FieldQuads, field_quads, field_quad)
#endif

void field_sums(FieldPlace place, uint base, uint sample_quads, out vec4 sums[CHANNEL_QUADS]) {
    [[unroll]] for (uint q = 0; q < CHANNEL_QUADS; q++) {
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
