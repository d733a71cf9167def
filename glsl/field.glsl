// A lookup in a field: position to stored samples and weights, and their weighted sum. The twin is Lattice::corners and
// ShadowField::lookup. A quad is four coefficients: vec4, or four halves. Choices are constants in plain
// conditions, of which the compiler keeps one side; only what a driver must not see is left to the preprocessor: how
// fields are bound and read.

const uint CHANNEL_QUADS = STRIDE / 4; // of a sample of occlusion, a channel of radiance, and a transfer vector

// Samples that a lookup interpolates: the corners of a tetrahedron.
const uint CORNERS = 4;

// The bits of a half, moved to where a float has them (SHIFTED), are that float times 2^-112, which the weights undo.
const float FIELD_UNIT = SHIFTED == 1 ? 5192296858534827628530496329220096.0 : 1.0;

struct FieldPlace {
    uint corner[CORNERS];  // stored sample
    float weight[CORNERS]; // includes the factors that undo the stored scale and FIELD_UNIT
};

#include "cube.glsl"

// Place on the face that a direction meets, among its stored samples. The first and the last of a row lie on the face's
// edges, the others at equal steps between them (edges 1), or half a step farther in (edges 0).
vec2 field_plane(vec3 p, float edges, out float face) {
    uint met = cube_face(p);
    face = float(met);
    // At the very centre any direction will do; it must only be a number.
    vec2 at = cube_warped(met, p, 1e-30) * (0.5 * CELLS + 0.5 * edges) + (0.5 * CELLS + 0.5);
    // The outermost steps are half as wide, and count as whole ones.
    return at + (1.0 - edges) * (min(at - 1.0, 0.0) + max(at - CELLS, 0.0));
}

// The corners of the tetrahedron around `at` in a block of samples from number `first` on; `last` is the last cell along
// each axis, `stride` how far apart the numbers of neighbours are, `scale` a factor on all weights. A cell is cut into
// six tetrahedra about its diagonal from the sample of even numbers to that of odd ones, so that cells that touch are
// cut alike. Along each the fractions fall in one order.
FieldPlace simplex(vec3 at, vec3 last, vec3 stride, float first, float scale) {
    vec3 low = min(floor(at), last);
    vec3 odd = low - 2.0 * floor(0.5 * low);
    vec3 up = 1.0 - 2.0 * odd;
    vec3 f = odd + up * (at - low);
    first += dot(low + odd, stride);
    stride *= up;
    float all = first + stride.x + stride.y + stride.z;
    float most = max(max(f.x, f.y), f.z), least = min(min(f.x, f.y), f.z);
    float middle = f.x + f.y + f.z - most - least;
    float by_most = f.x == most ? stride.x : f.y == most ? stride.y : stride.z;
    float by_least = f.z == least ? stride.z : f.y == least ? stride.y : stride.x;

    FieldPlace place;
    place.corner[0] = uint(first);
    place.corner[1] = uint(first + by_most);
    place.corner[2] = uint(all - by_least);
    place.corner[3] = uint(all);
    place.weight[0] = scale * (1.0 - most);
    place.weight[1] = scale * (most - middle);
    place.weight[2] = scale * (middle - least);
    place.weight[3] = scale * least;
    return place;
}

// Place in the stored arrangement: x and y along a face, z from shell to shell; samples are at whole numbers.
const float COLUMNS = CELLS + 2;
const float PLANE = 6.0 * COLUMNS * COLUMNS;

// radial: slope, offset, inner and outer radius of the field's shells.
// edges: see field_plane.
FieldPlace field_place(vec3 p, vec4 radial, float edges) {
    float d = sqrt(dot(p, p));
    float near = clamp(d, radial.z, radial.w);
    // c: cosine of the half-angle of the bounding sphere, or of what stands for it inside (Lattice::reach);
    // h = 1 - c without cancellation, where c squared is (near - edge) (near + edge) / reach.
    float edge = min(radial.z, 1.0);
    float reach = near * near + (1.0 - edge * edge);
    float h = 1.0 / (reach + sqrt(max(0.0, (near - edge) * (near + edge) * reach)));
    float beyond = radial.w / max(d, radial.w);
    float unscale = FIELD_UNIT * h * beyond * beyond;

    vec3 at;
    float face;
    at.xy = field_plane(p, edges, face);
    at.z = clamp(radial.x * sqrt(0.5 * h) + radial.y, 0.0, SHELLS - 1.0);
    return simplex(at, vec3(CELLS, CELLS, max(SHELLS - 2.0, 0.0)), vec3(1.0, COLUMNS, SHELLS > 1 ? PLANE : 0.0),
                   face * COLUMNS * COLUMNS, unscale);
}

// Each has field_sums: the weighted sums of one channel of the field whose first quad is `base`; samples are
// `sample_quads` quads apart.
#if PACKED
#include "field_packed.glsl"
#else
#include "field_quads.glsl"
#endif

void field_gather(FieldPlace place, uint base, uint sample_quads, out float b[COEFFICIENTS]) {
    vec4 sums[CHANNEL_QUADS];
    field_sums(place, base, sample_quads, sums);
    [[unroll]] for (uint i = 0; i < COEFFICIENTS; i++) {
        b[i] = sums[i / 4][i % 4];
    }
}
