// Fields as two quads of halves a texel: as many bytes a read as a texel can have.
layout(binding = FIELD_BINDING) uniform utextureBuffer field_quads;

// A processor without an instruction for whole vectors of halves is quicker by shifts of their bits (see FIELD_UNIT).
vec2 field_pair(uint halves) {
    if (SHIFTED == 1) {
        const uint HALF_BITS = 0x8fffe000u;
        uvec2 bits = uvec2(int(halves << 16) >> 3, int(halves) >> 3);
        return uintBitsToFloat(bits & HALF_BITS);
    }
    return unpackHalf2x16(halves);
}

void field_sums(FieldPlace place, uint base, uint sample_quads, out vec4 sums[CHANNEL_QUADS]) {
    int at[CORNERS];
    [[unroll]] for (uint k = 0; k < CORNERS; k++) {
        at[k] = int((base + place.corner[k] * sample_quads) / 2);
    }
    [[unroll]] for (uint q = 0; q < CHANNEL_QUADS; q += 2) {
        // All corners are read before any is used: a processor keeps nothing in registers while it reads a texel, a GPU
        // waits once.
        uvec4 halves[CORNERS];
        [[unroll]] for (uint k = 0; k < CORNERS; k++) {
            halves[k] = texelFetch(field_quads, at[k] + int(q / 2));
        }
        sums[q] = vec4(0.0);
        sums[q + 1] = vec4(0.0);
        [[unroll]] for (uint k = 0; k < CORNERS; k++) {
            sums[q] += place.weight[k] * vec4(field_pair(halves[k].x), field_pair(halves[k].y));
            sums[q + 1] += place.weight[k] * vec4(field_pair(halves[k].z), field_pair(halves[k].w));
        }
    }
}
