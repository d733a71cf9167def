// Four bytes of a word, lowest first. Unlike unpackSnorm4x8 and unpackUnorm4x8 these neither clamp nor scale, which a reader does once for
// what it makes of all four: with those two a lookup of an outline takes 1.2 times as long on llvmpipe.
vec4 signed_bytes(uint word) {
    return vec4(ivec4(word << 24, word << 16, word << 8, word) >> 24);
}

vec4 unsigned_bytes(uint word) {
    return vec4(ivec4(word, word >> 8, word >> 16, word >> 24) & 0xff);
}
