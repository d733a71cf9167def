// The tint of a vertex, by its texture coordinates and a whole number below 2^24: the roots of its channels, 8 bits each.
vec3 tint_of(vec3 paint) {
    uint roots = uint(paint.z);
    vec3 root = vec3(roots & 255, roots >> 8 & 255, roots >> 16) / 255.0;
    return root * root;
}
