// The share of the parts of a light that a box lets through: src/field/cuboid.rs, with the same names.

// How far along a ray the edges of strips are, given the depth of their middles: at the places nearest to the ray.
vec3 away_of(vec3 edge, vec3 cosines, vec3 places, vec3 inverse) {
    return edge + clamp((edge * cosines - places) * inverse * inverse, -1.0, 1.0) * cosines;
}

vec4 past_cuboid(Entity occluder, Surface surface, SeenLight light, Block block) {
    // By the light's axes and in r. Each column is of one edge, each component below of one strip.
    mat3 to_axes = transpose(mat3(light.toward, light.across, light.down));
    mat3 edges;
    EACH for (uint i = 0; i < 3; i++) {
        edges[i] = to_axes * to_world(occluder, node_quad(occluder.silhouette + i).xyz);
    }
    vec3 to = to_axes * (occluder.centre.xyz - surface.origin - surface.position) * occluder.centre.w;
    mat3 faces = mat3(cross(edges[1], edges[2]), cross(edges[2], edges[0]), cross(edges[0], edges[1]));
    mat3 moments = mat3(cross(to, edges[0]), cross(to, edges[1]), cross(to, edges[2]));
    vec3 squares = vec3(dot(edges[0], edges[0]), dot(edges[1], edges[1]), dot(edges[2], edges[2]));
    vec3 places = to * edges;
    vec4 free;
    EACH for (uint k = 0; k < 4; k++) {
        vec2 part = part_place(light, block, k);
        vec3 along = along_axes(light, part);
        float sine = part_sine(light, block, part, along);
        float tangent = sine * inversesqrt(1.0 - sine * sine);
        float limit = reach_of(light, part, along) * occluder.centre.w;
        float depth = dot(to, along);
        vec3 cosines = along * edges, of_faces = along * faces;
        vec3 square = squares - cosines * cosines;
        bvec3 parallel = lessThan(square, PARALLEL * squares);
        vec3 inverse = inversesqrt(max(square, PARALLEL * squares));
        vec3 half_width = (abs(of_faces.yzx) + abs(of_faces.zxy)) * inverse;
        vec3 off = (along * moments) * inverse;
        vec3 side = mix(vec3(1.0), vec3(-1.0), greaterThan(off, vec3(0.0)));
        vec3 signs = mix(vec3(-1.0), vec3(1.0), greaterThan(of_faces, vec3(0.0)));
        vec3 edge = side * (signs.yzx * cosines.zxy - signs.zxy * cosines.yzx);
        vec3 away = away_of(depth + edge, cosines, places, inverse);
        vec3 other_away = away_of(depth - edge, cosines, places, inverse);
        vec3 near = half_width - abs(off), far = half_width + abs(off);
        vec3 share;
        EACH for (uint i = 0; i < 3; i++) {
            float inside = share_blocked(near[i], away[i], tangent) + share_blocked(far[i], other_away[i], tangent) - 1.0;
            share[i] = parallel[i] ? 1.0 : max(inside, 0.0);
        }
        vec3 turned = mix(side * cosines * inverse, vec3(0.0), parallel);
        vec3 two = mix(share * share.yzx, min(share, share.yzx), max(-turned * turned.yzx, 0.0));
        vec2 in_box = slabs(places - squares, places + squares, cosines);
        in_box = in_box.x > in_box.y ? vec2(-NO_BOX, NO_BOX) : in_box;
        near = mix(near, vec3(EVERYTHING), parallel);
        bool second = near.y < near.x;
        float nearest = second ? near.y : near.x, nearest_away = second ? away.y : away.x;
        nearest_away = near.z < nearest ? away.z : nearest_away;
        nearest = min(nearest, near.z);
        float counts = counts_between(nearest_away, limit, in_box);
        free[k] = 1.0 - occluder.opacity * counts * min(min(two.x, two.y), two.z);
#if EDGES
        float penumbra = max(nearest_away, NEAREST) * max(tangent, LEAST_PENUMBRA);
        find_edge(nearest, nearest_away, limit, penumbra, inversesqrt(block.area), surface.step * occluder.centre.w);
#endif
    }
    return free;
}
