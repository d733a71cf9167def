// Light that pass "pixel light" has found for places on the screen: light that a surface sends out, and the shares of the
// lights that its highlights are of. It holds for one side of an entity at one depth: of a thin wall the far side may be
// marked where the near one is not. Where there is none all is 0.
uint light_key(uint entity, bool front) {
    return entity % 0x7fff + 1 << 1 | (front ? 1 : 0);
}

// `edge`: whether an edge is near that shows badly between here and the next texel.
uvec4 pack_light(uint key, float depth, vec3 light, vec4 shares, bool edge) {
    vec3 held = min(light, vec3(65504.0));
    uint last = packHalf2x16(vec2(held.b, 0.0)) | (edge ? 0x8000u : 0u);
    return uvec4(packHalf2x16(held.rg), packUnorm4x8(shares), floatBitsToUint(depth), last | key << 16);
}

vec3 light_of(uvec4 texel) {
    return vec3(unpackHalf2x16(texel.x), unpackHalf2x16(texel.w & 0x7fffu).x);
}

vec4 shares_of(uvec4 texel) {
    return unpackUnorm4x8(texel.y);
}

bool is_edge_near(uvec4 texel) {
    return (texel.w & 0x8000u) != 0;
}

// Whether a texel is of that side, and no farther than `off` from that depth.
bool is_of(uvec4 texel, uint key, float depth, float off) {
    return texel.w >> 16 == key && abs(uintBitsToFloat(texel.z) - depth) <= off;
}
