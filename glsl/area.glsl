// Projected area of an entity in a direction of the world, as a share of its bounding sphere's. The twin is
// src/field/area.rs.
float area_share(Entity entity, vec3 toward) {
    float u = dot(entity.area_x.xyz, toward);
    float v = dot(entity.area_y.xyz, toward);
    u *= u;
    v *= v;
    vec4 terms = entity.area_terms;
    float area = entity.area_x.w + u * (entity.area_y.w + terms.y * u + terms.w * v) + v * (terms.x + terms.z * v);
    return max(area, 0.0);
}
