// A lookup in a field: position to stored samples and weights, and their weighted sum. The twin is Lattice::corners and
// ShadowField::lookup. A quad is four coefficients: vec4, or four halves.
// DIRECTIONS 0 cube, 1 latitude-longitude; SPACING 0 chord, 1 log, 2 linear; LOOKUP 0 nearest, 1 radial, 2 trilinear.

#if IMAGE
// Fields as one image of three dimensions: shells along z, the directions of all faces along y, a coefficient quad beside the other
// along x. Channels of fields stand above and beside each other; a base is the number of a channel. The sampler interpolates.
layout(binding = FIELD_BINDING) uniform sampler3D field_image;
#elif PACKED
// Two quads of halves a texel: as many bytes a read as a texel can have.
layout(binding = FIELD_BINDING) uniform utextureBuffer field_quads;
#if SHIFTED
// The bits of a half, moved to where a float has them, are that float times 2^-112, which the weights undo. A processor without
// an instruction for whole vectors of halves is quicker so.
const float FIELD_UNIT = 5192296858534827628530496329220096.0;
const uint HALF_BITS = 0x8fffe000u;
vec2 field_pair(uint halves) {
    return vec2(uintBitsToFloat(uint(int(halves << 16) >> 3) & HALF_BITS), uintBitsToFloat(uint(int(halves) >> 3) & HALF_BITS));
}
#else
vec2 field_pair(uint halves) {
    return unpackHalf2x16(halves);
}
#endif
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

#if !SHIFTED
const float FIELD_UNIT = 1.0;
#endif

const uint FIELD_QUADS = FIELD_STRIDE / 4; // of an occlusion sample
const uint CHANNEL_QUADS = STRIDE / 4;     // of a channel of radiance, and of a transfer vector
#if IMAGE
const uint CHANNEL_STEP = 1;
#else
const uint CHANNEL_STEP = CHANNEL_QUADS;
#endif
const uint FETCHED_QUADS = FIELD_QUADS > CHANNEL_QUADS ? FIELD_QUADS : CHANNEL_QUADS;

#if IMAGE
const uint CORNERS = 1;
#elif LOOKUP == 2
const uint CORNERS = 8;
#elif LOOKUP == 1
const uint CORNERS = 2;
#else
const uint CORNERS = 1;
#endif

struct FieldPlace {
#if IMAGE
    vec3 texel;            // within a channel, of its first quad; texel centres at halves
#else
    uint corner[CORNERS];  // stored sample
#endif
    float weight[CORNERS]; // includes the factors that undo the stored scale and FIELD_UNIT
};

float field_warp(float s) {
    float q = s * s;
    return s * (WARP_0 + q * (WARP_1 + q * WARP_2));
}

#if DIRECTIONS == 0
// Base of the face's stored cells, and coordinates among them (samples at whole numbers, border included). A row's ends are samples
// (edges 1), or half a step beyond the last that is the face's own (edges 0).
void field_plane(vec3 p, float edges, out uint base, out vec2 cell) {
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
    cell = vec2(field_warp(st.x), field_warp(st.y)) * (0.5 * CELLS + 0.5 * edges) + (0.5 * CELLS + 0.5);
}
#else
void field_plane(vec3 p, float edges, out uint base, out vec2 cell) {
    const float PI = 3.14159265358979;
    float latitude = acos(clamp(p.y * inversesqrt(max(dot(p, p), 1e-30)), -1.0, 1.0)) / PI * LATITUDES - 0.5;
    float turn = p.x == 0.0 && p.z == 0.0 ? 0.0 : atan(p.z, p.x) / (2.0 * PI);
    base = 0;
    cell = vec2((turn - floor(turn)) * LONGITUDES, clamp(latitude, 0.0, LATITUDES - 1.0));
}
#endif

// radial: slope, offset, inner and outer radius of the field's shells.
// edges: see field_plane.
FieldPlace field_place(vec3 p, vec4 radial, float edges) {
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
    float unscale = FIELD_UNIT * h * beyond * beyond;
#else
    float unscale = FIELD_UNIT * beyond * beyond;
#endif
#if IMAGE
    uint face_base;
    vec2 face_cell;
    field_plane(p, edges, face_base, face_cell);
    FieldPlace place;
    place.texel = vec3(face_cell.x, face_cell.y + float(face_base / (CELLS + 2)), t) + 0.5;
    place.weight[0] = unscale;
    return place;
#else
#if LOOKUP == 0
    t = floor(t + 0.5);
#endif
    float shell = min(floor(t), max(SHELLS - 2.0, 0.0));
    float radial_fraction = t - shell;

    uint base;
    vec2 cell;
    field_plane(p, edges, base, cell);
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
#endif
}

// One channel of the field whose first quad is `base`; samples are `sample_quads` quads apart.
void field_gather(FieldPlace place, uint base, uint sample_quads, out float b[FETCHED]) {
    // All corners are read before any is used: a processor keeps nothing in registers while it reads a texel, a GPU waits once.
    vec4 sums[FETCHED_QUADS];
#if IMAGE
    vec3 size = vec3(textureSize(field_image, 0));
    uint along = uint(size.z) / SHELLS;
    vec3 texel = place.texel + vec3(0, float(base / along * (6 * (CELLS + 2))), float(base % along * SHELLS));
    [[unroll]] for (uint q = 0; q < FETCHED_QUADS; q++) {
        sums[q] = place.weight[0] * textureLod(field_image, (texel + vec3(float(q * (CELLS + 2)), 0, 0)) / size, 0.0);
    }
#elif PACKED
    [[unroll]] for (uint q = 0; q < FETCHED_QUADS; q += 2) {
        uvec4 halves[CORNERS];
        [[unroll]] for (uint k = 0; k < CORNERS; k++) {
            halves[k] = texelFetch(field_quads, int((base + place.corner[k] * sample_quads + q) / 2));
        }
        sums[q] = vec4(0.0);
        sums[q + 1] = vec4(0.0);
        [[unroll]] for (uint k = 0; k < CORNERS; k++) {
            sums[q] += place.weight[k] * vec4(field_pair(halves[k].x), field_pair(halves[k].y));
            sums[q + 1] += place.weight[k] * vec4(field_pair(halves[k].z), field_pair(halves[k].w));
        }
    }
#else
    [[unroll]] for (uint q = 0; q < FETCHED_QUADS; q++) {
        vec4 quads[CORNERS];
        [[unroll]] for (uint k = 0; k < CORNERS; k++) {
            quads[k] = field_quad(base + place.corner[k] * sample_quads + q);
        }
        sums[q] = vec4(0.0);
        [[unroll]] for (uint k = 0; k < CORNERS; k++) {
            sums[q] += place.weight[k] * quads[k];
        }
    }
#endif
    [[unroll]] for (uint i = 0; i < FETCHED; i++) {
        b[i] = sums[i / 4][i % 4];
    }
}
