// The share of a part of a lamp that a place sees past what rests, by a cube map of what is nearest to the part's
// middle. Rays to places on the part step through the map as over a height field.
//
// Gaps are told by inverse distances along the way from the part to the place. What leaves a gap of g (1/m) and lies
// off that way by the tangent o hides of the part what lies o / g from its middle, metres.
layout(binding = LAMP_BINDING) uniform textureBuffer lamp_maps;
layout(binding = LAMP_BINDING + 1) uniform textureBuffer lamp_texels;
#include "generated/lamp_map_structs.glsl"
#include "generated/lamp_map_at.glsl"
#if BLENDS
#define FOR_OTHERS (push.texel_px > 1) // whether a place is evaluated for those around it too
#else
#define FOR_OTHERS false
#endif

// A place as a part of a lamp sees it.
struct LampPlace {
    LampMap map;
    uint part;      // which of its lamp it is of
    mat2 edges;     // half the part's as the place sees them, metres
    vec2 depths;    // of these edges along the way to the place
    mat3 axes;      // third: from the part to the place
    float inverse;  // of its distance, 1/m
    vec3 normal;    // of the surface
    float height;   // of the place along it, from the part's middle, metres
    float steep;    // size of its cosine to that way, away from 0
    bool is_round;
};

// The gap of what stands before the surface near a tangent, or -1.
float gap_before(LampPlace at, vec2 tangent) {
    vec3 toward = at.axes * vec3(tangent, 1.0), size = abs(toward);
    uint axis = size.x >= max(size.y, size.z) ? 0 : size.y >= size.z ? 1 : 2;
    float ahead = axis == 0 ? toward.x : axis == 1 ? toward.y : toward.z, sign = ahead < 0.0 ? -1.0 : 1.0;
    vec2 side = axis == 0 ? toward.yz : axis == 1 ? toward.zx : toward.xy;
    float px = at.map.side_px;
    vec2 texel = clamp(floor((side / abs(ahead) * 0.5 + 0.5) * px), 0.0, px - 1.0);
    vec2 middle = (2.0 * texel + 1.0) / px - 1.0;
    vec3 way = axis == 0 ? vec3(sign, middle) : axis == 1 ? vec3(middle.y, sign, middle.x) : vec3(middle, sign);
    uint width = uint(px), face = 2 * axis + (sign < 0.0 ? 1 : 0);
    uint at_texel = at.map.first_texel + (face * width + uint(texel.y)) * width + uint(texel.x);
    float found = texelFetch(lamp_texels, int(at_texel)).r / at.map.nearest_m;
    float along = dot(at.axes[2], way);
    // What stands before the surface is above its plane, unless that is a facet of a round one and turns away. Of a round
    // one it is nearer than the place too, and of a vertex both: in a corner a texel shows the other wall as well.
    float texel_bias = 2.0 / px * along, bias = (at.is_round ? ROUND_BIAS : FLAT_BIAS) * texel_bias;
    bool above = at.is_round && at.height > 0.0 || dot(at.normal, way) > found * at.height + bias * at.steep;
    bool nearer = FACINGS > 1 && !at.is_round || found > at.inverse * (along + ROUND_BIAS * texel_bias);
    return along > 0.0 && above && nearer ? found / max(along, 1e-6) - at.inverse : -1.0;
}

// The share of a part that is hidden from a place. `blur`: tangent by which rays are spread.
//
// A ray to a place on the part that lies l from its middle leaves a gap of g where it is off the way by g l. It is
// hidden where it stays behind what the map has, or comes out from behind it: through it, where a few halvings of that
// step find it near the ray, and else beside its edge. Between two steps it may also pass behind something. y: the sum
// of the gaps of what hides the part, by the share.
vec2 hidden_share(LampPlace at, bool square, float blur) {
    uint taps = at.map.parts > 1 ? PART_TAPS : LAMP_TAPS;
    float least = 2.0 / at.map.side_px / max(max(length(at.edges[0]), length(at.edges[1])), 1e-6);
    float most = max(at.map.most_inverse - at.inverse, 2.0 * least);
    float ratio = pow(most / least, 1.0 / float(LAMP_STEPS - 1));
    vec2 turn = vec2(1.0, 0.0), hidden = vec2(0.0);
    for (uint k = 0; k < taps; k++) {
        float along = (float(k) + 0.5) / float(taps), other = fract(float(at.part * taps + k) * 0.6180340 + 0.5);
        vec2 around = sqrt(along) * turn, middle = blur * around;
        vec2 on_part = square ? 2.0 * vec2(along, other) - 1.0 : around, place = at.edges * on_part;
        float depth = dot(at.depths, on_part), end = depth > 0.0 ? max(1.0 / depth - at.inverse, 0.0) : EVERYTHING;
        float from = 0.0, to = min(least * pow(ratio, other - 0.5), end), gap = gap_before(at, middle);
        vec4 leaves = vec4(-1.0); // of the step: its ends and the gaps there
        float passes = 0.0;       // gap of what stands beside a step
        for (uint i = 0; i < LAMP_STEPS; i++) {
            float next = gap_before(at, middle + to * place);
            leaves = leaves.x < 0.0 && gap > from && next <= to ? vec4(from, to, gap, next) : leaves;
            passes = passes == 0.0 && gap <= from && next > from && next <= to ? next : passes;
            gap = next;
            from = to;
            to = min(ratio * to, end);
        }
        for (uint i = 0; i < HALVINGS; i++) {
            float half_way = 0.5 * (leaves.x + leaves.y), there = gap_before(at, middle + half_way * place);
            leaves = there > half_way ? vec4(half_way, leaves.y, there, leaves.w)
                                      : vec4(leaves.x, half_way, leaves.z, there);
        }
        bool through = leaves.x >= 0.0 && (leaves.z <= leaves.y || leaves.w >= leaves.x);
        bool behind = passes > 0.0 && gap_before(at, middle + passes * place) > STILL_THERE * passes;
        float met = gap > from ? gap : through ? leaves.z : behind ? passes : 0.0;
        hidden += met > 0.0 ? vec2(1.0, met) / float(taps) : vec2(0.0);
        turn = NEXT_TAP * turn;
    }
    return hidden;
}

// `place`: from the part's middle, world axes, metres. `edges`: half the part's, world axes, metres. `steps`: as those
// of `sun_share`.
float lamp_share(LampMap map, uint part, vec3 place, vec3 normal, bool is_round, mat2x3 edges, bool square, float step,
                 out float steps) {
    place = length(place) > 1e-6 ? place : vec3(0.0, 1e-6, 0.0);
    float distance = length(place);
    LampPlace at;
    at.map = map;
    at.part = part;
    at.axes[2] = place / distance;
    vec3 across = cross(at.axes[2], vec3(TURNED_X, TURNED_Y, TURNED_Z));
    at.axes[0] = across / max(length(across), 1e-30);
    at.axes[1] = cross(at.axes[2], at.axes[0]);
    at.inverse = 1.0 / distance;
    at.normal = normal;
    at.height = dot(normal, place);
    at.steep = max(abs(at.height) * at.inverse, LEAST_FACING);
    at.is_round = is_round;
    mat2x3 seen = mat2x3(edges[0] * at.axes, edges[1] * at.axes);
    at.edges = mat2(seen[0].xy, seen[1].xy);
    at.depths = vec2(seen[0].z, seen[1].z);
    float blur = LEAST_BLUR * 2.0 / map.side_px;
    float moved = max(1.0, EDGE_REACH) * step * at.inverse; // tangent to the next place
    // Places that are evaluated for others find what is hidden around them, too.
    vec2 hidden[2] = vec2[](vec2(0.0), vec2(0.0));
    uint k = 0;
    do {
        hidden[k] = hidden_share(at, square, k == 0 ? blur : blur + moved);
        k++;
    } while (k < (FOR_OTHERS ? 2 : 1));
    vec2 around = FOR_OTHERS ? hidden[1] : hidden[0];
    bool is_edge = max(hidden[0].x, around.x) > 0.001 && min(hidden[0].x, around.x) < 0.999;
    float gap = (hidden[0].y + around.y) / max(hidden[0].x + around.x, 1e-6);
    float half_width = gap * min(length(at.edges[0]), length(at.edges[1])) + blur;
    steps = is_edge ? min(step * at.inverse / half_width, MOST_STEPS) : 0.0;
    return 1.0 - hidden[0].x;
}
