// Numbers packed below shares of 0 to 1: src/bake/links.rs.
uint link_number(uint packed) {
    return packed & ((1u << RUN_BITS) - 1);
}

float link_share(uint packed) {
    return uintBitsToFloat((packed >> RUN_BITS) + LEAST_SHARE_BITS << 16);
}
