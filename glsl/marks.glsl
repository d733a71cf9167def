// What a vertex says of shadows around it, for pixels of its triangles: whether an edge is near that its light shows
// badly, and a bit for occluders that take any of a light or whose edges are near, shared by those whose numbers leave the
// same rest. It is kept as a float that is neither denormal nor NaN, which no addition of 0 changes.
uint occluder_bit(uint occluder) {
    return 1u << occluder % MARKED_OCCLUDERS;
}

float pack_marks(bool edge, uint occluders) {
    uint bits = (edge ? 1u : 0u) | occluders << 1;
    // Six of thirty bits lie in the middle of the exponent, whose first is set and whose last is not.
    return uintBitsToFloat((bits & 0x7fffff) | (bits >> 23 & 63) << 24 | (bits >> 29) << 31 | 1u << 30);
}

uint unpack_marks(float packed) {
    uint bits = floatBitsToUint(packed);
    return packed == 0.0 ? 0 : (bits & 0x7fffff) | (bits >> 24 & 63) << 23 | (bits >> 31) << 29;
}

// Marks of the vertices of a triangle together, from the light of all vertices.
uint marks_of(textureBuffer radiosity, uvec3 corners) {
    return unpack_marks(texelFetch(radiosity, int(corners.x)).w) | unpack_marks(texelFetch(radiosity, int(corners.y)).w)
         | unpack_marks(texelFetch(radiosity, int(corners.z)).w);
}

bool marks_edge(uint marks) {
    return (marks & 1) != 0;
}

uint marked_occluders(uint marks) {
    return marks >> 1;
}
