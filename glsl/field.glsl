// A lookup in a field: position to stored samples and weights, and their weighted sum. The twin is Lattice::corners and
// ShadowField::lookup. A quad is four coefficients: vec4, or four halves. DIRECTIONS 0 cube, 1 latitude-longitude;
// SPACING 0 chord, 1 linear. They and the other choices are constants in plain conditions, of which the compiler keeps
// one side; only what a driver must not see is left to the preprocessor: how fields are bound and read.

const uint FIELD_QUADS = FIELD_STRIDE / 4; // of an occlusion sample
const uint CHANNEL_QUADS = STRIDE / 4;     // of a channel of radiance, and of a transfer vector
const uint FETCHED_QUADS = FIELD_QUADS > CHANNEL_QUADS ? FIELD_QUADS : CHANNEL_QUADS;

// Samples that a lookup interpolates: four directions on each of two shells.
const uint CORNERS = 8;

// The bits of a half, moved to where a float has them (SHIFTED), are that float times 2^-112, which the weights undo.
const float FIELD_UNIT = SHIFTED == 1 ? 5192296858534827628530496329220096.0 : 1.0;

struct FieldPlace {
    uint corner[CORNERS];  // stored sample
    float weight[CORNERS]; // includes the factors that undo the stored scale and FIELD_UNIT
};

#include "cube.glsl"

// Base of the face's stored cells, and coordinates among them (samples at whole numbers, border included). A row's ends
// are samples (edges 1), or half a step beyond the last that is the face's own (edges 0).
void field_plane_cube(vec3 p, float edges, out uint base, out vec2 cell) {
    uint face = cube_face(p);
    // At the very centre any direction will do; it must only be a number.
    vec2 warped = cube_warped(face, p, 1e-30);
    base = face * (CELLS + 2) * (CELLS + 2);
    cell = warped * (0.5 * CELLS + 0.5 * edges) + (0.5 * CELLS + 0.5);
}

void field_plane_latlon(vec3 p, out vec2 cell) {
    float latitude = acos(clamp(p.y * inversesqrt(max(dot(p, p), 1e-30)), -1.0, 1.0)) / PI * LATITUDES - 0.5;
    float turn = p.x == 0.0 && p.z == 0.0 ? 0.0 : atan(p.z, p.x) / (2.0 * PI);
    cell = vec2((turn - floor(turn)) * LONGITUDES, clamp(latitude, 0.0, LATITUDES - 1.0));
}

// The stored directions of one shell around a direction.
struct FieldCells {
    uint base; // of the face
    uvec2 first;
    uvec2 second;
    vec2 fraction;
};

const uint COLUMNS = DIRECTIONS == 0 ? CELLS + 2 : LONGITUDES;
const uint PLANE = DIRECTIONS == 0 ? 6 * COLUMNS * COLUMNS : LATITUDES * LONGITUDES;

FieldCells field_cells(vec3 p, float edges) {
    FieldCells cells;
    cells.base = 0;
    vec2 cell;
    vec2 low;
    if (DIRECTIONS == 0) {
        field_plane_cube(p, edges, cells.base, cell);
        low = min(floor(cell), vec2(CELLS));
        cells.first = uvec2(low);
        cells.second = cells.first + 1;
    } else {
        field_plane_latlon(p, cell);
        low = vec2(floor(cell.x), min(floor(cell.y), max(LATITUDES - 2.0, 0.0)));
        cells.first = uvec2(uint(low.x) % LONGITUDES, uint(low.y));
        cells.second = uvec2((uint(low.x) + 1) % LONGITUDES, min(cells.first.y + 1, uint(LATITUDES) - 1));
    }
    cells.fraction = cell - low;
    return cells;
}

// radial: slope, offset, inner and outer radius of the field's shells.
// edges: see field_plane_cube.
FieldPlace field_place(vec3 p, vec4 radial, float edges) {
    float d = sqrt(dot(p, p));
    float near = clamp(d, radial.z, radial.w);
    // c: cosine of the half-angle of the bounding sphere, or of what stands for it inside (Lattice::reach);
    // h = 1 - c without cancellation, where c squared is (near - edge) (near + edge) / reach.
    float edge = min(radial.z, 1.0);
    float reach = near * near + (1.0 - edge * edge);
    float h = 1.0 / (reach + sqrt(max(0.0, (near - edge) * (near + edge) * reach)));
    float coordinate = SPACING == 0 ? sqrt(0.5 * h) : near;
    float t = clamp(radial.x * coordinate + radial.y, 0.0, SHELLS - 1.0);
    float beyond = radial.w / max(d, radial.w);
    float unscale = FIELD_UNIT * (SPACING == 0 ? h : 1.0) * beyond * beyond;

    FieldCells cells = field_cells(p, edges);
    FieldPlace place;
    float shell = min(floor(t), max(SHELLS - 2.0, 0.0));
    float radial_fraction = t - shell;
    uint base = cells.base + uint(shell) * PLANE;
    uint up = SHELLS > 1 ? PLANE : 0;
    vec2 fraction = cells.fraction;
    // The lowest bits of a corner's number choose the cell along x and y, the next bit the shell.
    [[unroll]] for (uint k = 0; k < CORNERS; k++) {
        bool right = (k & 1) != 0;
        bool lower = (k & 2) != 0;
        bool outer = (k & 4) != 0;
        float wx = right ? fraction.x : 1.0 - fraction.x;
        float wy = lower ? fraction.y : 1.0 - fraction.y;
        float wz = outer ? radial_fraction : 1.0 - radial_fraction;
        uint x = right ? cells.second.x : cells.first.x;
        uint y = lower ? cells.second.y : cells.first.y;
        place.corner[k] = base + y * COLUMNS + x + (outer ? up : 0);
        place.weight[k] = wx * wy * (wz * unscale);
    }
    return place;
}

// Each has field_sums: the weighted sums of one channel of the field whose first quad is `base`; samples are
// `sample_quads` quads apart.
#if PACKED
#include "field_packed.glsl"
#else
#include "field_quads.glsl"
#endif

void field_gather(FieldPlace place, uint base, uint sample_quads, out float b[FETCHED]) {
    vec4 sums[FETCHED_QUADS];
    field_sums(place, base, sample_quads, sums);
    [[unroll]] for (uint i = 0; i < FETCHED; i++) {
        b[i] = sums[i / 4][i % 4];
    }
}
