// The share of a sun's disc that a place sees past what rests, by maps of what is nearest to the sun: percentage-closer
// soft shadows (Fernando, SIGGRAPH 2005 Sketches).
layout(binding = SUN_BINDING) uniform textureBuffer sun_maps;
layout(binding = SUN_BINDING + 1) uniform texture2D sun_heights; // of SunMap.range_m; 0 where nothing stands
#include "generated/sun_map_structs.glsl"
#include "generated/sun_map_at.glsl"

// A place on a surface, and its plane above a map.
struct Sunned {
    vec2 texel;    // of the place
    float height;  // above the map's lowest, metres
    vec2 slope;    // of the height, metres a texel
    bool is_round; // whether the plane stands for something round
};

Sunned sunned_at(SunMap map, vec3 place, vec3 normal, bool is_round) {
    Sunned at;
    at.texel = vec2(dot(map.across, place) + map.across_first, dot(map.down, place) + map.down_first);
    at.height = dot(map.toward, place) - map.lowest;
    float facing = dot(normal, map.toward);
    facing = facing < 0.0 ? min(facing, -LEAST_FACING) : max(facing, LEAST_FACING);
    at.slope = -map.texel_m * map.texel_m * vec2(dot(normal, map.across), dot(normal, map.down)) / facing;
    at.is_round = is_round;
    return at;
}

// How far above the plane something stands beside a place, `off` texels away, metres; below 0 where nothing does. What is
// round does not fall as steeply as the plane, which is taken as level there.
float gap_beside(SunMap map, Sunned at, vec2 off) {
    vec2 texel = floor(at.texel + off) + 0.5;
    vec2 within = clamp(texel, map.low, map.high);
    float height = texelFetch(sun_heights, ivec2(within), 0).r;
    float rise = dot(at.slope, texel - at.texel);
    rise = at.is_round ? max(rise, 0.0) : rise;
    float gap = map.range_m * height - at.height - rise - (at.is_round ? ROUND_BIAS : FLAT_BIAS) * map.texel_m;
    return texel == within && height > 0.0 ? gap : -1.0;
}

// `place`: from the map's middle, metres. `step`: as that of Surface. `steps`: of them in half the width of a penumbra that
// comes as near, or 0.
float sun_share(SunMap map, vec3 place, vec3 normal, bool is_round, float step, out float steps) {
    Sunned at = sunned_at(map, place, normal, is_round);
    float blur = map.tangent / map.texel_m; // texels by a gap of 1 m
    float reach = max(blur * (map.range_m - at.height), 1.0);
    // Taps in which something may hide a part of the sun: their gaps and their number.
    vec2 turn = vec2(1.0, 0.0), hides = vec2(0.0);
    for (uint k = 0; k < SEEKING_TAPS; k++) {
        float off = float(k) / float(SEEKING_TAPS - 1) * reach;
        float gap = gap_beside(map, at, off * turn);
        hides += gap > 0.0 && off <= blur * gap + 1.0 ? vec2(gap, 1.0) : vec2(0.0);
        turn = NEXT_TAP * turn;
    }
    float gap = hides.x / max(hides.y, 1.0);
    float touches = is_round ? 0.0 : clamp(2.0 - gap / (TOUCHING_TEXELS * map.texel_m), 0.0, 1.0);
    float radius = max(blur * gap, mix(LEAST_BLUR, 2.0 * LEAST_BLUR, touches));
    float wide = radius + max(1.0, EDGE_REACH) * step / map.texel_m;
    vec2 blocked = vec2(0.0); // shares of the taps within the blur, and of those as far as the next place
    for (uint k = 0; k < BLURRING_TAPS; k++) {
        vec2 tap = sqrt((float(k) + 0.5) / float(BLURRING_TAPS)) * turn;
        blocked.x += gap_beside(map, at, radius * tap) > 0.0 ? 1.0 / float(BLURRING_TAPS) : 0.0;
        blocked.y += gap_beside(map, at, wide * tap) > 0.0 ? 1.0 / float(BLURRING_TAPS) : 0.0;
        turn = NEXT_TAP * turn;
    }
    bool is_edge = any(greaterThan(blocked, vec2(0.001))) && any(lessThan(blocked, vec2(0.999)));
    steps = is_edge ? min(step / (radius * map.texel_m), MOST_STEPS) : 0.0;
    // What texels blur lets no light in where two surfaces meet.
    float share = clamp(1.0 - blocked.x, 0.0, 1.0);
    float dark = clamp((share - DARKENED) / (1.0 - DARKENED), 0.0, 1.0);
    return mix(share, dark, touches);
}
