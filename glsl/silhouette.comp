#version 460
#extension GL_EXT_samplerless_texture_functions : require
// Views of an object, or of half of it, to maps of signed distance and depth, in two steps. The outline is known at
// points between neighbouring pixels of which one is covered; these points lie in 2 VIEW - 1 columns: half a pixel
// apart, alternately between vertical and between horizontal neighbours.
//   COLUMNS: for every column and every row of the map, the nearest point of the outline in that column.
//   otherwise: for every texel of the map, the nearest of these over all columns.
// This is the exact two-pass distance transform of Meijster, Roerdink and Hesselink, "A General Algorithm for Computing
// Distance Transforms in Linear Time" (2000), with a plain minimum in the second pass.

layout(local_size_x = WORKGROUP) in;

const int COLUMN_COUNT = 2 * VIEW - 1;
const float NOTHING = 6e4; // pixels, larger than any view and within a half

layout(binding = 0) uniform texture2D views;
#if COLUMNS
layout(std430, binding = 1) writeonly buffer Nearest { uint nearest[]; };
#else
layout(std430, binding = 1) readonly buffer Nearest { uint nearest[]; };
layout(std430, binding = 2) readonly buffer Halves { vec2 halves[]; }; // half edges of each map's rectangle, in r
layout(std430, binding = 3) writeonly buffer Maps { uint maps[]; };    // two texels a word
#endif

layout(push_constant) uniform Push {
    uint map_first; // map of the atlas's first view
    uint map_count; // views in the atlas
} push;

ivec2 origin(uint view) {
    return ivec2(view % ATLAS_COLUMNS, view / ATLAS_COLUMNS) * VIEW;
}

vec2 seen(ivec2 at) {
    return texelFetch(views, at, 0).rg;
}

bool covered(vec2 depths) {
    return depths.r > CLEAR;
}

// Middle between the nearest and the farthest surface at a covered pixel: at an outline both are near it.
float depth_of(vec2 a, vec2 b) {
    vec2 depths = covered(a) ? a : b;
    return 0.5 * (depths.r - depths.g);
}

float row_position(int row) {
    return (float(row) + 0.5) * (float(VIEW) / float(MAP));
}

#if COLUMNS
void main() {
    uint invocation = gl_GlobalInvocationID.x;
    uint view = invocation / COLUMN_COUNT;
    int column = int(invocation % COLUMN_COUNT);
    if (view >= push.map_count) {
        return;
    }
    bool beside = column % 2 == 1; // between horizontal neighbours
    ivec2 at = origin(view) + ivec2(column / 2, 0);
    float last = -NOTHING;
    float last_depth = 0.0;
    vec2 above = vec2(CLEAR);
    int row = 0;
    for (int y = 0; y <= VIEW; y++) {
        float here = NOTHING;
        float depth = 0.0;
        if (y < VIEW) {
            vec2 a = seen(at + ivec2(0, y));
            vec2 b = beside ? seen(at + ivec2(1, y)) : above;
            bool edge = (beside || y > 0) && covered(a) != covered(b);
            above = a;
            if (!edge) {
                continue;
            }
            here = float(y) + (beside ? 0.5 : 0.0);
            depth = depth_of(a, b);
        }
        // Rows between the point before and this one belong to the nearer of the two. The mean of points that are
        // equally near makes mirrored views mirrored maps.
        while (row < MAP && row_position(row) < here) {
            float at_row = row_position(row);
            float before = at_row - last, behind = here - at_row;
            float found_depth = before < behind ? last_depth : before > behind ? depth : 0.5 * (last_depth + depth);
            uint found = packHalf2x16(vec2(min(min(before, behind), NOTHING), found_depth));
            nearest[(view * MAP + row) * COLUMN_COUNT + column] = found;
            row++;
        }
        last = here;
        last_depth = depth;
    }
}
#else
// Signed bytes of distance and depth of one texel.
uint texel(uint view, ivec2 at) {
    vec2 pixel = 2.0 * halves[push.map_first + view] / float(VIEW);
    vec2 place = vec2(row_position(at.x), row_position(at.y));
    float least = 3e38;
    vec2 depth = vec2(0.0); // sum over the nearest points, and their number
    uint first = (view * MAP + uint(at.y)) * COLUMN_COUNT;
    for (int column = 0; column < COLUMN_COUNT; column++) {
        vec2 found = unpackHalf2x16(nearest[first + column]);
        vec2 to = vec2(0.5 * float(column + 1) - place.x, found.x) * pixel;
        float squared = dot(to, to);
        depth = squared < least ? vec2(0.0) : depth;
        least = min(least, squared);
        depth += squared == least ? vec2(found.y, 1.0) : vec2(0.0);
    }
    // Inside where most of the pixels around the texel's centre are covered; 0 where as many are as are not.
    ivec2 low = ivec2(floor(place - 0.25));
    ivec2 high = ivec2(floor(place + 0.25));
    int inside = 0;
    vec2 surface = vec2(0.0); // sum of its depths, and their number
    for (int k = 0; k < 4; k++) {
        ivec2 beside = ivec2((k & 1) == 0 ? low.x : high.x, (k & 2) == 0 ? low.y : high.y);
        vec2 depths = seen(origin(view) + beside);
        inside += covered(depths) ? 1 : -1;
        surface += covered(depths) ? vec2(depth_of(depths, depths), 1.0) : vec2(0.0);
    }
    float signed_distance = sqrt(least) * float(sign(inside));
    float found_depth = depth.x / depth.y;
#if HALF
    float within = smoothstep(SURFACE_FROM, SURFACE_TO, signed_distance);
    found_depth = mix(found_depth, surface.x / max(surface.y, 1.0), within);
#endif
    vec2 scaled = clamp(vec2(signed_distance / REACH, found_depth), -1.0, 1.0) * 127.0;
    ivec2 bytes = ivec2(roundEven(scaled)) & 0xff;
    return uint(bytes.x | bytes.y << 8);
}

void main() {
    uint invocation = gl_GlobalInvocationID.x;
    const uint PAIRS = uint(MAP * MAP / 2);
    uint view = invocation / PAIRS;
    if (view >= push.map_count) {
        return;
    }
    int pair = int(invocation % PAIRS);
    ivec2 at = ivec2(2 * pair % MAP, 2 * pair / MAP);
    uint low = texel(view, at);
    uint high = texel(view, at + ivec2(1, 0));
    maps[(push.map_first + view) * PAIRS + uint(pair)] = low | high << 16;
}
#endif
