// The light that leaves what moves, as outgoing.comp wrote it. LEAVING_BINDING says where it lies.
#include "readable.glsl"
// Nine quads an entity, area times light and area: coefficients by direction, in its frame, or six faces of a box.
READ_VEC4(LEAVING_BINDING, Outgoing, outgoing, outgoing_at)
// Three quads an entity: halves of a box's edges, in its frame and in r; zero of what is none.
READ_VEC4(LEAVING_BINDING + 1, Edges, edges, edge_at)

// Mean radiosity of the faces of a box that are seen from a place in its frame, in r, by about the views that they take.
vec3 seen_faces(uint e, vec3 from) {
    vec4 sum = vec4(0.0);
    [[unroll]] for (uint f = 0; f < 6; f++) {
        vec3 edge = (f % 2 == 0 ? 1.0 : -1.0) * edge_at(3 * e + f / 2).xyz;
        vec3 to = from - edge;
        float height = dot(to, edge) * inversesqrt(dot(edge, edge));
        sum += (max(height, 0.0) + UNFACED) * pow(dot(to, to) + UNFACED, -1.5) * outgoing_at(9 * e + f);
    }
    return sum.rgb / max(sum.w, 1e-20);
}

// Mean radiosity of those surfaces of a mover that are seen from a place in its frame, in r. By direction, which is about
// that of the place, it is the light that leaves the mover that way, over its area as seen from there.
vec3 seen(uint e, vec3 from, vec3 direction) {
    if (edge_at(3 * e).xyz != vec3(0.0)) {
        return seen_faces(e, from);
    }
    float y[COEFFICIENTS];
    sh_basis(direction, y);
    vec4 sum = vec4(0.0);
    [[unroll]] for (uint k = 0; k < min(COEFFICIENTS, 9); k++) {
        sum += y[k] * outgoing_at(9 * e + k);
    }
    return max(sum.rgb, 0.0) / max(max(sum.w, 0.1 * y[0] * outgoing_at(9 * e).w), 1e-20);
}

// Towards the middle of the directions that a mover blocks, from the viewer and turned around: band 1, of which x and y
// are negative. `from` is the viewer's place in the mover's frame.
vec3 seen_from(vec3 from, float blocked[COEFFICIENTS]) {
    vec3 middle = from;
#if COEFFICIENTS >= 4
    middle = vec3(blocked[3], blocked[1], -blocked[2]);
#endif
    return middle / max(length(middle), 1e-20);
}
