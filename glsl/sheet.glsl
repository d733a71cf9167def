// A sheet, which is a rectangle that blocks light from both sides, as a point of a receiver sees it. The twin is
// src/field/sheet.rs.

struct Sheet {
    mat3 axes;     // world: along its sides, and from the point to its plane
    vec4 ends;     // of its sides from the point, metres: low and high along the first axis, then along the second
    float height;  // of the point over its plane, metres, positive
    vec4 to_ends;  // distances of the lines through its sides
};

// `centre` of the sheet and `position` of the point are from the receiver's centre. Within `contact` of the plane the
// point counts as that far from it, on the side of the receiver's centre, or else on the side that it faces.
Sheet sheet_of(Entity entity, vec3 centre, vec3 position, vec3 normal, float contact) {
    vec3 x = entity.area_x.xyz, y = entity.area_y.xyz, up = cross(x, y);
    vec3 to = centre - position;
    float height = -dot(up, to);
    float side = contact * (2.0 * dot(up, normal) + 0.01) - dot(up, centre);
    height = abs(height) < contact ? (side < 0.0 ? -contact : contact) : height;
    Sheet sheet;
    sheet.axes = mat3(x, y, height < 0.0 ? up : -up);
    sheet.ends = vec2(dot(x, to), dot(y, to)).xxyy + vec4(-1.0, 1.0, -1.0, 1.0) * entity.half_sides.xxyy;
    sheet.height = abs(height);
    sheet.to_ends = sqrt(sheet.ends * sheet.ends + height * height);
    return sheet;
}

// Sines of the angles of a direction (along the sheet's axes) over the planes through the point and the four sides,
// positive where the sheet lies.
vec4 inside_of(Sheet sheet, vec3 along) {
    return vec4(1.0, -1.0, 1.0, -1.0) * (sheet.height * along.xxyy - along.z * sheet.ends) / sheet.to_ends;
}
