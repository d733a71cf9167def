// What pass "pixel light" keeps of the surface that a pixel shows, in two texels: vertices of its triangle, and the place
// in it. 0 is nothing.
struct SeenSurface {
    uint receiver; // entity
    bool front;    // which of its sides is seen
    bool edge;     // whether a shadow's edge comes near that its vertices show badly
    uvec3 lit;     // vertices, among all that are lit
    vec3 weights;
    float step;    // to the farther of the pixels beside it, metres of the object's frame
    vec2 slope;    // of the depth, from pixel to pixel
};

uvec4 pack_triangle(uint receiver, bool front, bool edge, uvec3 lit) {
    return uvec4(lit, receiver + 1 << 2 | (edge ? 2 : 0) | (front ? 1 : 0));
}

// Weights have 24 bits, and the step the first 16 of its float.
uvec4 pack_place(vec3 weights, float step, vec2 slope) {
    uvec2 whole = uvec2(clamp(weights.xy, 0.0, 1.0) * float(0xffffff));
    uint bits = floatBitsToUint(step) >> 16;
    return uvec4(whole << 8 | uvec2(bits >> 8, bits & 0xff), floatBitsToUint(slope));
}

// What the last number of the first texel tells.
bool is_seen(uint packed) {
    return packed != 0;
}

bool has_edge(uint packed) {
    return (packed & 2) != 0;
}

SeenSurface unpack_surface(uvec4 triangle, uvec4 place) {
    SeenSurface seen;
    seen.receiver = (triangle.w >> 2) - 1;
    seen.edge = has_edge(triangle.w);
    seen.front = (triangle.w & 1) != 0;
    seen.lit = triangle.xyz;
    vec2 weights = vec2(place.xy >> 8) / float(0xffffff);
    seen.weights = vec3(weights, max(1.0 - weights.x - weights.y, 0.0));
    seen.step = uintBitsToFloat((place.x & 0xff) << 24 | (place.y & 0xff) << 16);
    seen.slope = uintBitsToFloat(place.zw);
    return seen;
}
