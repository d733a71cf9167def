// A box beside rays from one point: src/field/cuboid.rs, with the same names. Lengths are in r, and each column of a matrix
// is of one edge. What includes this has included outline.glsl, and defines EACH.
struct Box {
    mat3 edges;   // halves
    vec3 to;      // its centre from the point
    mat3 faces;
    mat3 moments;
    vec3 squares;
    vec3 places;
};

Box box_of(mat3 edges, vec3 to) {
    Box box;
    box.edges = edges;
    box.to = to;
    box.faces = mat3(cross(edges[1], edges[2]), cross(edges[2], edges[0]), cross(edges[0], edges[1]));
    box.moments = mat3(cross(to, edges[0]), cross(to, edges[1]), cross(to, edges[2]));
    box.squares = vec3(dot(edges[0], edges[0]), dot(edges[1], edges[1]), dot(edges[2], edges[2]));
    box.places = to * edges;
    return box;
}

// How far along a ray the edges of strips are, given the depth of their middles: at the places nearest to the ray.
vec3 away_of(vec3 edge, vec3 cosines, vec3 places, vec3 inverse) {
    return edge + clamp((edge * cosines - places) * inverse * inverse, -1.0, 1.0) * cosines;
}

// Share of a small round light that the box blocks: the light's middle lies `limit` away, and `tangent` is that of its
// angular radius. `nearest` and `away` are of the box's outline: its signed distance from the ray, and how far away it is.
float box_blocks(Box box, vec3 along, float tangent, float limit, out float nearest, out float away) {
    float depth = dot(box.to, along);
    vec3 cosines = along * box.edges, of_faces = along * box.faces;
    vec3 square = box.squares - cosines * cosines;
    bvec3 parallel = lessThan(square, PARALLEL * box.squares);
    vec3 inverse = inversesqrt(max(square, PARALLEL * box.squares));
    vec3 half_width = (abs(of_faces.yzx) + abs(of_faces.zxy)) * inverse;
    vec3 off = (along * box.moments) * inverse;
    vec3 side = mix(vec3(1.0), vec3(-1.0), greaterThan(off, vec3(0.0)));
    vec3 signs = mix(vec3(-1.0), vec3(1.0), greaterThan(of_faces, vec3(0.0)));
    vec3 edge = side * (signs.yzx * cosines.zxy - signs.zxy * cosines.yzx);
    vec3 near_away = away_of(depth + edge, cosines, box.places, inverse);
    vec3 far_away = away_of(depth - edge, cosines, box.places, inverse);
    vec3 near = half_width - abs(off), far = half_width + abs(off);
    vec3 share;
    EACH for (uint i = 0; i < 3; i++) {
        float from_near = share_blocked(near[i], near_away[i], NEAREST_EDGE, tangent);
        float from_far = share_blocked(far[i], far_away[i], NEAREST_EDGE, tangent);
        share[i] = parallel[i] ? 1.0 : max(from_near + from_far - 1.0, 0.0);
    }
    vec3 turned = mix(side * cosines * inverse, vec3(0.0), parallel);
    vec3 two = mix(share * share.yzx, min(share, share.yzx), max(-turned * turned.yzx, 0.0));
    vec2 in_box = slabs(box.places - box.squares, box.places + box.squares, cosines);
    // A ray that enters the box before the light is blocked there, wherever it would leave it.
    float leaves = limit + NEAREST * (1.0 - clamp((limit - in_box.x) / ENTERED, 0.0, 1.0));
    in_box = in_box.x > in_box.y ? vec2(-NO_BOX, NO_BOX) : vec2(in_box.x, min(in_box.y, leaves));
    near = mix(near, vec3(EVERYTHING), parallel);
    bool second = near.y < near.x;
    nearest = second ? near.y : near.x;
    away = second ? near_away.y : near_away.x;
    away = near.z < nearest ? near_away.z : away;
    nearest = min(nearest, near.z);
    return counts_between(away, limit, in_box) * min(min(two.x, two.y), two.z);
}
