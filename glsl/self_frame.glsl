// The hemisphere about a vertex's normal and its square of SELF_SIDE x SELF_SIDE nodes. The twin is
// src/field/self_visibility.rs.

// Axes of a vertex's hemisphere from its unit normal: columns tangent, bitangent, normal. The normal must be the mesh's
// own, in the object's frame; the axes may then be turned to any other frame in which directions are given.
mat3 self_frame(vec3 normal) {
    float s = normal.z >= 0.0 ? 1.0 : -1.0;
    float a = -1.0 / (s + normal.z);
    float b = normal.x * normal.y * a;
    vec3 tangent = vec3(1.0 + s * normal.x * normal.x * a, s * b, -s * normal.x);
    return mat3(tangent, vec3(b, s + normal.y * normal.y * a, -normal.y), normal);
}

// Place of a direction (z along the normal) on the map, nodes at whole numbers from 0 to SELF_SIDE - 1.
vec2 self_place(vec3 local) {
    vec2 flattened = local.xy / max(abs(local.x) + abs(local.y) + max(local.z, 0.0), 1e-20);
    vec2 square = vec2(flattened.x + flattened.y, flattened.x - flattened.y) * (1.0 / SELF_RIM);
    const float HALF = 0.5 * float(SELF_SIDE - 1);
    return clamp(square, -1.0, 1.0) * HALF + HALF;
}

// Unit direction of a node.
vec3 self_node(uint node) {
    vec2 place = vec2(node % SELF_SIDE, node / SELF_SIDE);
    vec2 square = (place * (2.0 / float(SELF_SIDE - 1)) - 1.0) * SELF_RIM;
    vec2 flattened = 0.5 * vec2(square.x + square.y, square.x - square.y);
    return normalize(vec3(flattened, 1.0 - abs(flattened.x) - abs(flattened.y)));
}
