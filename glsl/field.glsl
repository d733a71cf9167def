// A lookup in a field: position to stored samples and weights, and their weighted sum. The twin is Lattice::corners and
// ShadowField::lookup. A quad is four coefficients: vec4, or four halves.
// DIRECTIONS 0 cube, 1 latitude-longitude; SPACING 0 chord, 1 log, 2 linear; LOOKUP 0 nearest, 1 radial, 2 trilinear.

#if PACKED
// Two quads of halves a texel: as many bytes a read as a texel can have.
layout(binding = FIELD_BINDING) uniform utextureBuffer field_quads;
#elif TEXEL
layout(binding = FIELD_BINDING) uniform textureBuffer field_quads;
vec4 field_quad(uint i) {
    return texelFetch(field_quads, int(i));
}
#elif HALF
layout(std430, binding = FIELD_BINDING) readonly buffer FieldQuads { uvec2 field_quads[]; };
vec4 field_quad(uint i) {
    uvec2 packed = field_quads[i];
    return vec4(unpackHalf2x16(packed.x), unpackHalf2x16(packed.y));
}
#else
layout(std430, binding = FIELD_BINDING) readonly buffer FieldQuads { vec4 field_quads[]; };
vec4 field_quad(uint i) {
    return field_quads[i];
}
#endif

const uint FIELD_QUADS = FIELD_STRIDE / 4; // of an occlusion sample
const uint CHANNEL_QUADS = STRIDE / 4;     // of a channel of radiance, and of a transfer vector
const uint FETCHED_QUADS = FIELD_QUADS > CHANNEL_QUADS ? FIELD_QUADS : CHANNEL_QUADS;

#if LOOKUP == 2
const uint CORNERS = 8;
#elif LOOKUP == 1
const uint CORNERS = 2;
#else
const uint CORNERS = 1;
#endif

struct FieldPlace {
    uint corner[CORNERS];  // stored sample
    float weight[CORNERS]; // includes the factor that undoes the stored scale
};

float field_warp(float s) {
    float q = s * s;
    return s * (WARP_0 + q * (WARP_1 + q * WARP_2));
}

#if DIRECTIONS == 0
// Base of the face's stored cells, and coordinates among them (cell centres at whole numbers, border included).
void field_plane(vec3 p, out uint base, out vec2 cell) {
    vec3 a = abs(p);
    vec2 st;
    float major;
    uint face;
    if (a.x >= a.y && a.x >= a.z) {
        face = p.x >= 0.0 ? 0 : 1;
        st = vec2(p.x >= 0.0 ? -p.z : p.z, -p.y);
        major = a.x;
    } else if (a.y >= a.z) {
        face = p.y >= 0.0 ? 2 : 3;
        st = vec2(p.x, p.y >= 0.0 ? p.z : -p.z);
        major = a.y;
    } else {
        face = p.z >= 0.0 ? 4 : 5;
        st = vec2(p.z >= 0.0 ? p.x : -p.x, -p.y);
        major = a.z;
    }
    // At the very centre any direction will do; it must only be a number.
    st /= max(major, 1e-30);
    base = face * (CELLS + 2) * (CELLS + 2);
    cell = vec2(field_warp(st.x), field_warp(st.y)) * (0.5 * CELLS) + (0.5 * CELLS + 0.5);
}
#else
void field_plane(vec3 p, out uint base, out vec2 cell) {
    const float PI = 3.14159265358979;
    float latitude = acos(clamp(p.y * inversesqrt(max(dot(p, p), 1e-30)), -1.0, 1.0)) / PI * LATITUDES - 0.5;
    float turn = p.x == 0.0 && p.z == 0.0 ? 0.0 : atan(p.z, p.x) / (2.0 * PI);
    base = 0;
    cell = vec2((turn - floor(turn)) * LONGITUDES, clamp(latitude, 0.0, LATITUDES - 1.0));
}
#endif

// radial: slope, offset, inner and outer radius of the field's shells.
FieldPlace field_place(vec3 p, vec4 radial) {
    float d = sqrt(dot(p, p));
    float near = clamp(d, radial.z, radial.w);
    // c: cosine of the half-angle of the bounding sphere, or of what stands for it inside (Lattice::reach);
    // h = 1 - c without cancellation.
    float edge = min(radial.z, 1.0);
    float reach = near * near + (1.0 - edge * edge);
    float c = sqrt(max(0.0, (near - edge) * (near + edge) / reach));
    float h = 1.0 / (reach * (1.0 + c));
#if SPACING == 0
    float coordinate = sqrt(0.5 * h);
#elif SPACING == 1
    float coordinate = log(near);
#else
    float coordinate = near;
#endif
    float t = clamp(radial.x * coordinate + radial.y, 0.0, SHELLS - 1.0);
    float beyond = radial.w / max(d, radial.w);
#if SCALED
    float unscale = h * beyond * beyond;
#else
    float unscale = beyond * beyond;
#endif
#if LOOKUP == 0
    t = floor(t + 0.5);
#endif
    float shell = min(floor(t), max(SHELLS - 2.0, 0.0));
    float radial_fraction = t - shell;

    uint base;
    vec2 cell;
    field_plane(p, base, cell);
#if LOOKUP != 2
    cell = floor(cell + 0.5);
#endif
#if DIRECTIONS == 0
    vec2 low = min(floor(cell), vec2(CELLS));
    uvec2 first = uvec2(low);
    uvec2 second = first + 1;
    const uint COLUMNS = CELLS + 2;
    const uint PLANE = 6 * COLUMNS * COLUMNS;
#else
    vec2 low = vec2(floor(cell.x), min(floor(cell.y), max(LATITUDES - 2.0, 0.0)));
    uvec2 first = uvec2(uint(low.x) % LONGITUDES, uint(low.y));
    uvec2 second = uvec2((uint(low.x) + 1) % LONGITUDES, min(first.y + 1, uint(LATITUDES) - 1));
    const uint COLUMNS = LONGITUDES;
    const uint PLANE = LATITUDES * LONGITUDES;
#endif
    vec2 fraction = cell - low;
    base += uint(shell) * PLANE;
    uint up = SHELLS > 1 ? PLANE : 0;

    FieldPlace place;
#if LOOKUP == 2
    [[unroll]] for (uint k = 0; k < 8; k++) {
        uint x = (k & 1) == 0 ? first.x : second.x;
        uint y = (k & 2) == 0 ? first.y : second.y;
        float wx = (k & 1) == 0 ? 1.0 - fraction.x : fraction.x;
        float wy = (k & 2) == 0 ? 1.0 - fraction.y : fraction.y;
        float wz = (k & 4) == 0 ? 1.0 - radial_fraction : radial_fraction;
        place.corner[k] = base + y * COLUMNS + x + ((k & 4) == 0 ? 0 : up);
        place.weight[k] = wx * wy * (wz * unscale);
    }
#else
    uint cell_index = base + (fraction.y > 0.5 ? second.y : first.y) * COLUMNS + (fraction.x > 0.5 ? second.x : first.x);
#if LOOKUP == 1
    place.corner[0] = cell_index;
    place.corner[1] = cell_index + up;
    place.weight[0] = (1.0 - radial_fraction) * unscale;
    place.weight[1] = radial_fraction * unscale;
#else
    place.corner[0] = cell_index + (radial_fraction > 0.5 ? up : 0);
    place.weight[0] = unscale;
#endif
#endif
    return place;
}

// One channel of the field whose first quad is `base`; samples are `sample_quads` quads apart.
void field_gather(FieldPlace place, uint base, uint sample_quads, out float b[FETCHED]) {
    vec4 sums[FETCHED_QUADS];
    [[unroll]] for (uint q = 0; q < FETCHED_QUADS; q++) {
        sums[q] = vec4(0.0);
    }
    [[unroll]] for (uint k = 0; k < CORNERS; k++) {
        uint at = base + place.corner[k] * sample_quads;
#if PACKED
        [[unroll]] for (uint q = 0; q < FETCHED_QUADS; q += 2) {
            uvec4 halves = texelFetch(field_quads, int((at + q) / 2));
            sums[q] += place.weight[k] * vec4(unpackHalf2x16(halves.x), unpackHalf2x16(halves.y));
            sums[q + 1] += place.weight[k] * vec4(unpackHalf2x16(halves.z), unpackHalf2x16(halves.w));
        }
#else
        [[unroll]] for (uint q = 0; q < FETCHED_QUADS; q++) {
            sums[q] += place.weight[k] * field_quad(at + q);
        }
#endif
    }
    [[unroll]] for (uint i = 0; i < FETCHED; i++) {
        b[i] = sums[i / 4][i % 4];
    }
}
