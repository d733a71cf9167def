// Reflection by microfacets: the metallic-roughness model of glTF 2.0, appendix B. The twin is src/gloss/twin.rs.
//
// Results come in pairs that are linear in the colour of a surface that is faced, F0: the first is multiplied by it,
// the second is added (Schlick's Fresnel term, F0 + (1 - F0) (1 - v.h)^5).

struct Reflection {
    vec3 facing;
    vec3 grazing;
};

// Which way a surface is seen.
struct View {
    vec3 normal; // unit, world
    vec3 toward; // unit, from the surface to the eye
    float z;     // cosine between them, above 0
    float alpha; // width of the microfacets' slopes
    vec3 ground; // as the normal, of the surface itself, which textures do not tilt
    float footprint; // square of the radius of a pixel, as a disc of slopes
};

View view_of(vec3 from_eye, vec3 normal, float roughness) {
    View view;
    view.normal = normalize(normal);
    view.toward = -normalize(from_eye);
    view.z = max(dot(view.normal, view.toward), LEAST_VIEW_Z);
    view.alpha = max(roughness * roughness, LEAST_ALPHA);
    view.ground = view.normal;
    view.footprint = 0.0;
    return view;
}

float schlick(float view_half) {
    float below = clamp(1.0 - view_half, 0.0, 1.0), square = below * below;
    return square * square * below;
}

// Masking and shadowing over 4 (n.v) (n.l).
float masking(View view, float light_z) {
    float square = view.alpha * view.alpha;
    float seen = light_z * sqrt(view.z * view.z * (1.0 - square) + square);
    float lit = view.z * sqrt(light_z * light_z * (1.0 - square) + square);
    return 0.5 / max(seen + lit, 1e-30);
}

// Share of the base colour that reflects diffusely under a uniform sky: the mean over all lights of 1 less the Fresnel
// term. Under other light it differs by at most 0.04.
float diffuse_share(float z, float metallic, float f0) {
    float x = 1.0 - z;
    float lost = ((0.0248 * x - 0.0008) * x + 0.0039) * x;
    return (1.0 - metallic) * (1.0 - f0) * (1.0 - lost);
}

#if SKY
layout(binding = MAP_BINDING) uniform sampler2D sky_map; // levels one below the other: src/gloss/sky_map.rs
layout(binding = TABLE_BINDING) uniform sampler2D lobes; // src/gloss/lobe.rs

vec4 lobe_row(uint row, float roughness, float z) {
    vec2 cell = vec2(sqrt(max(1.0 - z, 0.0)), roughness) * (TABLE - 1.0) + 0.5;
    return textureLod(lobes, vec2(cell.x / TABLE, (cell.y + TABLE * float(row)) / (2.0 * TAPS * TABLE)), 0.0);
}

vec3 sky_level(vec2 place, float level) {
    float wide = MAP_SIDE + 2.0;
    return textureLod(sky_map, vec2(place.x / wide, (place.y + wide * level) / (wide * LEVELS)), 0.0).rgb;
}

// Distant light from a direction, prefiltered; `level` counts the maps.
vec3 sky_at(vec3 direction, float level) {
    vec3 at = direction / (abs(direction.x) + abs(direction.y) + abs(direction.z));
    vec2 folded = (1.0 - abs(at.zx)) * vec2(at.x < 0.0 ? -1.0 : 1.0, at.z < 0.0 ? -1.0 : 1.0);
    vec2 place = 1.0 + MAP_SIDE * (0.5 + 0.5 * (at.y < 0.0 ? folded : at.xz));
    float below = clamp(floor(level), 0.0, LEVELS - 2.0);
    return mix(sky_level(place, below), sky_level(place, below + 1.0), level - below);
}

// A tap of the lobe: where it looks, and what of it is reflected.
struct Tap {
    vec3 toward;
    float level;
    float weight;
    float whole; // what the lobe reflects by Schlick's term, of unit light
};

Tap tap_of(View view, float roughness, uint k) {
    vec4 row = lobe_row(k, roughness, view.z);
    vec3 away = view.normal * dot(view.normal, view.toward) - view.toward;
    away /= max(length(away), 1e-6);
    float angle = acos(min(view.z, 1.0)) + view.alpha * row.x;
    Tap tap;
    tap.toward = normalize(sin(angle) * away + max(cos(angle), 0.0) * view.normal);
    tap.level = row.y;
    tap.weight = row.z;
    tap.whole = row.w;
    return tap;
}

// The reflection of all distant light.
Reflection reflect_sky(View view, float roughness) {
    vec3 sum = vec3(0.0), by_schlick = vec3(0.0);
    float weight = 0.0, of_schlick = 0.0, whole = 0.0;
    for (uint k = 0; k < TAPS; k++) {
        Tap tap = tap_of(view, roughness, k);
        vec3 light = tap.weight * sky_at(tap.toward, tap.level);
#if TEXTURED
        // The surface itself hides what lies below it.
        light *= clamp(0.5 + 2.0 * dot(tap.toward, view.ground), 0.0, 1.0);
#endif
        float term = schlick(dot(view.toward, normalize(view.toward + tap.toward)));
        sum += light;
        by_schlick += term * light;
        weight += tap.weight;
        of_schlick += term * tap.weight;
        whole = tap.whole;
    }
    // Three taps find the share of Schlick's term less well than the table has it.
    vec3 mean = by_schlick / max(of_schlick, 1e-6);
    return Reflection((1.0 - whole / max(weight, 1e-6)) * sum, whole * mean);
}

// What a lobe reflects of unit light from everywhere.
vec2 reflected_share(View view, float roughness) {
    float weight = 0.0, whole = 0.0;
    for (uint k = 0; k < TAPS; k++) {
        vec4 row = lobe_row(k, roughness, view.z);
        weight += row.z;
        whole = row.w;
    }
    return vec2(weight - whole, whole);
}
#endif

#if HIGHLIGHTS || LINKS
// Cosine between the view and the vector half way to a direction.
float half_cosine(View view, vec3 along) {
    return max(sqrt(max(0.5 + 0.5 * dot(along, view.toward), 0.0)), 1e-4);
}

// The lobe towards a small part of a light, without Schlick's term. `along` is unit, to its middle, `lit` its cosine to
// the normal and `omega` its solid angle. The part counts as a point, and the slopes are as much wider as it is wide.
float lobe_of_part(View view, vec3 along, float lit, float omega) {
    float view_half = half_cosine(view, along);
    float half_z = max(dot(view.normal, along + view.toward) / (2.0 * view_half), 0.0);
    float slopes = min(omega / max(4.0 * view_half * half_z * half_z * half_z, 1e-30), MOST_SLOPES);
    float widened = view.alpha * view.alpha + WIDENED * slopes;
    float below = (widened - 1.0) * half_z * half_z + 1.0;
    return widened / (PI * below * below) * masking(view, lit);
}
#endif
