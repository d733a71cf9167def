// The triangle of a grid's cell that a place lies in, and the weights of its corners.
struct CellTriangle {
    uvec3 vertices;
    vec3 weights;
};

CellTriangle cell_triangle(utextureBuffer corners, uvec2 cells, vec2 place) {
    uvec2 cell = uvec2(clamp(ivec2(floor(place)), ivec2(0), ivec2(cells) - 1));
    vec2 within = place - vec2(cell);
    uvec4 corner = texelFetch(corners, int(cell.y * cells.x + cell.x));
    bool upwards = corner.x >= UPWARDS;
    corner.x &= ~UPWARDS;
    // Two corners lie on the cell's diagonal; the third is the one on this place's side of it.
    bool far = upwards ? within.y > within.x : within.x + within.y > 1.0;
    CellTriangle found;
    if (upwards) {
        found.vertices = uvec3(corner.x, corner.w, far ? corner.z : corner.y);
        found.weights = far ? vec3(1.0 - within.y, within.x, within.y - within.x)
                            : vec3(1.0 - within.x, within.y, within.x - within.y);
    } else {
        found.vertices = uvec3(corner.y, corner.z, far ? corner.w : corner.x);
        found.weights = far ? vec3(1.0 - within.y, 1.0 - within.x, within.x + within.y - 1.0)
                            : vec3(within.x, within.y, 1.0 - within.x - within.y);
    }
    return found;
}
