// A lookup in a silhouette field: what an object blocks of a small round light. The twin is src/field/silhouette.rs,
// with the same names. NODE_CELLS: cells along a face of the node grid; MAP: texels along a map of the whole object,
// half as many along those of its halves.
//
// A field begins with two quads, the least and the largest corner of a box around the object (its frame, in r), whose w
// is the number of further faces; before it stand their planes, the last one first. Then come the nodes. Nodes are three
// quads each: two rows that take a point (object's frame, in r) to its place on the map, in texels from the middle of the
// first; and edges of a texel in r, the map's first cell, and -1 where the map is seen from behind. Cells are the four
// texels around a point between them: signed bytes of distance and of depth.
#include "readable.glsl"
READ_VEC4(NODE_BINDING, Nodes, nodes, node_quad)
READ_UVEC2(NODE_BINDING + 1, Cells, cells, cell_at)
#include "cube.glsl"
#include "bytes.glsl"
#include "outline.glsl"

const uint BOX_QUADS = 2;
const uint WHOLE = 0, FAR = 1, NEAR = 2; // sides of an object: all of it, what lies beyond its centre along a direction, and before it

// The cell around a place on a map whose last texel is `last`, and the weights of its corners. The place lies between
// texels.
uvec2 around(vec2 place, uint first, float last, out vec4 weights) {
    vec2 low = min(floor(place), last - 1.0);
    vec2 f = place - low;
    weights = vec4(1.0 - f.x, f.x, 1.0 - f.x, f.x) * vec4(1.0 - f.yy, f.yy);
    return cell_at(first + uint(low.y * last + low.x));
}

// Between four signed bytes: -1 to 1.
float between(uint bytes, vec4 weights) {
    return dot(signed_bytes(bytes), weights) * (1.0 / 127.0);
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

// Number of a cell's first node, by face, row and column.
uint first_node(uint face, vec2 low) {
    return (face * (NODE_CELLS + 1) + uint(low.y)) * (NODE_CELLS + 1) + uint(low.x);
}

NodeCell node_cell(uint field, vec3 toward) {
    NodeCell cell;
    cell.face = cube_face(toward);
    vec2 at = among_cells(cell.face, toward);
    cell.low = clamp(floor(at), 0.0, NODE_CELLS - 1.0);
    cell.middle = at - cell.low;
    // On a cube's edge the lines of both its faces have a kink: so neither axis counts there.
    vec2 border = min(at, NODE_CELLS - at);
    cell.eased = clamp(min(min(cell.middle, 1.0 - cell.middle), border.yx) / EASED, 0.0, 1.0);
    cell.first = field + BOX_QUADS + 3 * first_node(cell.face, cell.low);
    return cell;
}

#if COLORS
// The colours of a light in direction `toward` (object's frame) whose angular radius has that sine, over its mean: for
// each channel the slope along that frame's axes, from the disc's middle to its rim, and the value in the middle.
// `first` is their first quad. The twin is src/field/lamp_colors.rs.
mat3x4 lamp_colors(uint first, vec3 toward, float sine) {
    uint face = cube_face(toward);
    vec2 at = among_cells(face, toward), low = clamp(floor(at), 0.0, NODE_CELLS - 1.0), f = at - low;
    float shells = min(sine / SHELL_STEP, LAST_SHELL), shell = min(floor(shells), LAST_SHELL - 1.0);
    const uint shell_quads = 3 * 6 * (NODE_CELLS + 1) * (NODE_CELLS + 1);
    first += uint(shell) * shell_quads + 3 * first_node(face, low);
    mat3x4 plane = mat3x4(0.0);
    for (uint k = 0; k < 8; k++) {
        uint node = first + 3 * ((k >> 1 & 1) * (NODE_CELLS + 1) + (k & 1)) + (k >> 2) * shell_quads;
        float weight = ((k & 1) == 0 ? 1.0 - f.x : f.x) * ((k & 2) == 0 ? 1.0 - f.y : f.y)
                     * (k < 4 ? 1.0 + shell - shells : shells - shell);
        plane += weight * mat3x4(node_quad(node), node_quad(node + 1), node_quad(node + 2));
    }
    return plane;
}
#endif

// Bilinear weights of a cell's nodes for a direction near the one in the middle. They have no step where the cell
// changes.
vec4 node_weights(NodeCell cell, vec3 toward) {
    vec2 off = among_cells(cell.face, toward) - cell.low - cell.middle;
    vec2 f = clamp(cell.middle + cell.eased * off, -BEYOND, 1.0 + BEYOND);
    return vec4(1.0 - f.x, f.x, 1.0 - f.x, f.x) * vec4(1.0 - f.yy, f.yy);
}

// One of the four maps of a cell, as it concerns rays through one point.
struct NearMap {
    float sign;      // -1 where the map is seen from behind
    uint first_cell;
    float last;      // texel of a row
    vec2 texel;      // its edges, in r
    vec2 centre;     // place of the sphere's centre, in texels
    mat3x2 steps;    // texels along each of the axes that directions are given in, for a way of r
    float depth;     // of the outline along the direction in the middle
};

// The map of a side at corner k of a cell. `axes`, in the object's frame, are those that directions are given in.
// `foot` is the place on the middle ray that is nearest to the sphere's centre, by those axes and in r. Places on rays
// are given by such feet, because they stay small where the object is far away, so that f32 keeps them.
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
    float scale = side == WHOLE ? 1.0 : 0.5; // texels of a half's map are twice as large
    near.last = float(MAP) * scale - 1.0;
    near.texel = map.xy / scale;
    near.centre = (vec2(right.w, down.w) + 0.5) * scale - 0.5;
    right.xyz *= scale;
    down.xyz *= scale;
    near.steps[0] = vec2(dot(right.xyz, axes[0]), dot(down.xyz, axes[0]));
    near.steps[1] = vec2(dot(right.xyz, axes[1]), dot(down.xyz, axes[1]));
    near.steps[2] = vec2(dot(right.xyz, axes[2]), dot(down.xyz, axes[2]));
    // The outline lies off the centre's plane, at this depth: so the map sees it elsewhere.
    vec4 weights;
    vec2 place = clamp(near.centre + near.steps * foot, 0.0, near.last);
    near.depth = near.sign * between(around(place, near.first_cell, near.last, weights).y, weights);
    return near;
}

// The outline in one map near the ray in direction `along` with that foot, both by the axes. x: signed
// distance of the ray from the outline, positive where it meets the object; y: depth along the ray of the outline's
// nearest point. Object's frame, in r.
vec2 outline(NearMap near, uint side, vec3 along, vec3 foot) {
    vec2 place = near.centre + near.steps * (foot + near.depth * along);
    vec2 within = clamp(place, 0.0, near.last);
    vec2 beyond = (place - within) * near.texel;
    vec4 weights;
    uvec2 cell = around(within, near.first_cell, near.last, weights);
    float distance = REACH * between(cell.x, weights) - length(beyond);
    return vec2(distance, near.sign * between(cell.y, weights));
}

#if BOXES || HALVES
// Where a ray enters the box around an object, or its faces, and where it leaves them. If it misses one, the interval has
// no ends, and the outline alone decides.
vec2 if_met(vec2 ends) {
    return ends.x > ends.y ? vec2(-NO_BOX, NO_BOX) : ends;
}

vec2 box_slabs(uint field, vec3 point, vec3 direction) {
    return slabs(node_quad(field).xyz - point, node_quad(field + 1).xyz - point, direction);
}

uint face_count(uint field) {
    return uint(node_quad(field).w);
}

vec4 face_plane(uint field, uint face) {
    return node_quad(field - 1 - face);
}

// What the plane of a face leaves of a ray that is turned `along` its normal and begins so far below it.
vec2 cut_by_face(vec2 ends, float along, float below) {
    float at = below / (abs(along) < LEAST_STEP ? LEAST_STEP : along);
    return along <= -LEAST_STEP ? vec2(max(ends.x, at), ends.y) : vec2(ends.x, min(ends.y, at));
}
#endif
