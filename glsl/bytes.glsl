// The four bytes of a word, lowest first. They are neither clamped nor scaled, unlike those of unpackSnorm4x8 and
// unpackUnorm4x8; the caller scales once for all four.
vec4 signed_bytes(uint word) {
    return vec4(ivec4(word << 24, word << 16, word << 8, word) >> 24);
}

vec4 unsigned_bytes(uint word) {
    return vec4(ivec4(word, word >> 8, word >> 16, word >> 24) & 0xff);
}
