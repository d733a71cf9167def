// A lookup in a silhouette field: what an object blocks of a small round light. The twin is src/field/silhouette.rs, with the same names.
// NODE_CELLS: cells along a face of the node grid; MAP: texels along a map of the whole object, half as many along those of its halves.
//
// Nodes are three quads each: two rows that take a point (object's frame, in r) to its place on the map, and half edges of the map's
// rectangle, its first cell, and -1 where the map is seen from behind. Cells are the four texels around a point between them.
#if TEXEL
layout(binding = NODE_BINDING) uniform textureBuffer nodes;
vec4 node_quad(uint i) {
    return texelFetch(nodes, int(i));
}
layout(binding = NODE_BINDING + 1) uniform utextureBuffer cells;
uvec2 cell_at(uint i) {
    return texelFetch(cells, int(i)).xy;
}
#else
layout(std430, binding = NODE_BINDING) readonly buffer Nodes { vec4 nodes[]; };
vec4 node_quad(uint i) {
    return nodes[i];
}
layout(std430, binding = NODE_BINDING + 1) readonly buffer Cells { uvec2 cells[]; };
uvec2 cell_at(uint i) {
    return cells[i];
}
#endif
#include "cube.glsl"
#include "blocked_share.glsl"

const uint WHOLE = 0, FAR = 1, NEAR = 2; // sides of an object: all of it, what lies beyond its centre along a direction, and before it

// The cell around a place on a map (-1 to 1 from edge to edge) of so many texels, and the weights of its corners.
uvec2 around(vec2 place, uint first, uint px, out vec4 weights) {
    vec2 at = clamp(0.5 * (place + 1.0) * px - 0.5, 0.0, px - 1.0);
    vec2 low = min(floor(at), px - 2.0);
    vec2 f = at - low;
    weights = vec4(1.0 - f.x, f.x, 1.0 - f.x, f.x) * vec4(1.0 - f.yy, f.yy);
    return cell_at(first + uint(low.y) * (px - 1) + uint(low.x));
}

// A cell of the node grid, for directions near one in the middle.
struct NodeCell {
    uint face;
    vec2 low;
    vec2 middle; // place of the direction in the middle, 0 to 1
    vec2 eased;  // by how much other directions count, 0 at the cell's border
    uint first; // quad of its first node
};

// Place of a direction among the cells of a face.
vec2 among_cells(uint face, vec3 toward) {
    return (cube_warped(face, toward, LEAST_AHEAD) + 1.0) * (0.5 * NODE_CELLS);
}

NodeCell node_cell(uint first_node, vec3 toward) {
    NodeCell cell;
    cell.face = cube_face(toward);
    vec2 at = among_cells(cell.face, toward);
    cell.low = clamp(floor(at), 0.0, NODE_CELLS - 1.0);
    cell.middle = at - cell.low;
    // On a cube's edge the lines of both its faces have a kink: so neither axis counts there.
    vec2 border = min(at, NODE_CELLS - at);
    cell.eased = clamp(min(min(cell.middle, 1.0 - cell.middle), border.yx) / EASED, 0.0, 1.0);
    cell.first = first_node + 3 * ((cell.face * (NODE_CELLS + 1) + uint(cell.low.y)) * (NODE_CELLS + 1) + uint(cell.low.x));
    return cell;
}

// Bilinear weights of a cell's nodes for a direction near the one in the middle. They have no step where the cell changes.
vec4 node_weights(NodeCell cell, vec3 toward) {
    vec2 off = among_cells(cell.face, toward) - cell.low - cell.middle;
    vec2 f = clamp(cell.middle + cell.eased * off, -BEYOND, 1.0 + BEYOND);
    return vec4(1.0 - f.x, f.x, 1.0 - f.x, f.x) * vec4(1.0 - f.yy, f.yy);
}

// One of the four maps of a cell, as it concerns rays through one point.
struct NearMap {
    float sign;      // -1 where the map is seen from behind
    uint first_cell;
    vec2 half_edges; // of its rectangle, in r
    vec2 centre;     // place of the sphere's centre
    mat3x2 steps;    // on the map, along each of the axes that directions are given in, for a way of r
    float depth;     // of the outline along the direction in the middle
};

uint map_px(uint side) {
    return side == WHOLE ? MAP : MAP / 2;
}

// The map of a side at corner k of a cell. `axes`: those that directions are given in, in the object's frame; `foot`: by those axes, in r, the place
// on the ray in the middle that is nearest to the sphere's centre. Places on rays are given by such feet, because they stay small where
// the object is far away, so that f32 keeps them.
NearMap near_map(NodeCell cell, uint k, uint side, mat3 axes, vec3 foot) {
    uint quad = cell.first + 3 * ((k >> 1) * (NODE_CELLS + 1) + (k & 1));
    vec4 right = node_quad(quad), down = node_quad(quad + 1), map = node_quad(quad + 2);
    NearMap near;
    near.sign = map.w;
    near.first_cell = floatBitsToUint(map.z);
    if (side != WHOLE) {
        // Seen from behind, what lies before the centre lies beyond it.
        bool far = (side == FAR) == (map.w > 0.0);
        near.first_cell += (MAP - 1) * (MAP - 1) + (far ? 0 : (MAP / 2 - 1) * (MAP / 2 - 1));
    }
    near.half_edges = map.xy;
    near.centre = vec2(right.w, down.w);
    near.steps[0] = vec2(dot(right.xyz, axes[0]), dot(down.xyz, axes[0]));
    near.steps[1] = vec2(dot(right.xyz, axes[1]), dot(down.xyz, axes[1]));
    near.steps[2] = vec2(dot(right.xyz, axes[2]), dot(down.xyz, axes[2]));
    // The outline lies off the centre's plane, at this depth: so the map sees it elsewhere.
    vec4 weights;
    uvec2 around_it = around(near.centre + near.steps * foot, near.first_cell, map_px(side), weights);
    near.depth = near.sign * dot(unpackSnorm4x8(around_it.y), weights);
    return near;
}

// What one map knows of the outline near the ray in direction `along` with that foot, both by the axes.
// x: signed distance of the ray from the outline, positive where it meets the object; y: depth along the ray of the outline's nearest
// point. Object's frame, in r.
vec2 outline(NearMap near, uint side, vec3 along, vec3 foot) {
    vec2 place = near.centre + near.steps * (foot + near.depth * along);
    vec2 beyond = (place - clamp(place, -1.0, 1.0)) * near.half_edges;
    vec4 weights;
    uvec2 cell = around(place, near.first_cell, map_px(side), weights);
    float distance = REACH * dot(unpackSnorm4x8(cell.x), weights) - length(beyond);
    return vec2(distance, near.sign * dot(unpackSnorm4x8(cell.y), weights));
}

// 1 where a length (in r) is positive and 0 where it is negative, with a ramp between.
float fade(float l) {
    return clamp(l / NEAREST + 0.5, 0.0, 1.0);
}

// Share of a small round light that an outline blocks which lies that far away, in r.
float share_blocked(float distance, float away, float tangent) {
    return blocked_share(distance / max(max(away, NEAREST) * tangent, LEAST_PENUMBRA));
}

// Whether an outline counts that lies that far away: one behind the point or beyond the limit does not.
float between(float away, float limit) {
    return fade(away) * fade(limit - away);
}
