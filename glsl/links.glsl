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

// Of a range of links: how many there are, and the entity whose they are.
uint link_count(uvec2 range) {
    return range.y & ((1u << COUNT_BITS) - 1);
}

uint linked_entity(uvec2 range) {
    return range.y >> COUNT_BITS;
}

// Not quite of unit length.
vec3 unpacked_direction(uint packed) {
    return vec3(packed & 1023u, packed >> 10 & 1023u, packed >> 20) / 511.5 - 1.0;
}
