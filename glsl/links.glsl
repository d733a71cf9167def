// Numbers packed below shares of 0 to 1: src/bake/links.rs.
uint link_number(uint packed) {
    return packed & ((1u << RUN_BITS) - 1);
}

float link_share(uint packed) {
    return uintBitsToFloat((packed >> RUN_BITS) + LEAST_SHARE_BITS << 16);
}

uint packed_link(float share, uint number) {
    uint bits = floatBitsToUint(share) + (1u << 15) >> 16;
    return max(bits, LEAST_SHARE_BITS) - LEAST_SHARE_BITS << RUN_BITS | number;
}

// Not quite of unit length.
vec3 unpacked_direction(uint packed) {
    return vec3(packed & 1023u, packed >> 10 & 1023u, packed >> 20) / 511.5 - 1.0;
}
