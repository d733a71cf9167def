// Axes of a surface from its unit normal, which is the last: Duff et al., Building an Orthonormal Basis, Revisited,
// JCGT 6(1), 2017. To find a place in a vertex's map the normal must be the mesh's own, in the object's frame; the axes
// may then be turned to any other.
mat3 surface_axes(vec3 normal) {
    float s = normal.z >= 0.0 ? 1.0 : -1.0;
    float a = -1.0 / (s + normal.z);
    float b = normal.x * normal.y * a;
    vec3 tangent = vec3(1.0 + s * normal.x * normal.x * a, s * b, -s * normal.x);
    return mat3(tangent, vec3(b, s + normal.y * normal.y * a, -normal.y), normal);
}
