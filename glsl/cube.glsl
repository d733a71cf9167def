// The faces of a cube around the origin, and places on them: -1 to 1 from edge to edge, warped so that equal steps are
// almost equal angles. The twins are src/sh/cube.rs and src/field/directions.rs.

// The face that a direction meets.
uint cube_face(vec3 p) {
    vec3 a = abs(p);
    return a.x >= a.y && a.x >= a.z ? (p.x >= 0.0 ? 0 : 1) : a.y >= a.z ? (p.y >= 0.0 ? 2 : 3) : (p.z >= 0.0 ? 4 : 5);
}

vec2 cube_warp(vec2 s) {
    vec2 q = s * s;
    return s * (WARP_0 + q * (WARP_1 + q * WARP_2));
}

// Place on a face, or on its plane around it, of a direction that goes at least `least` along the face's own.
vec2 cube_warped(uint face, vec3 p, float least) {
    bool x = face < 2, y = face == 2 || face == 3, back = (face & 1) != 0;
    float ahead = x ? p.x : y ? p.y : p.z;
    float right = x ? p.z : p.x;
    float down = y ? p.z : p.y;
    // Faces +X and -Z run against their axis, and all but +Y downwards.
    vec2 st = vec2((face == 0 || face == 5) ? -right : right, face == 2 ? down : -down);
    return cube_warp(st / max(back ? -ahead : ahead, least));
}
