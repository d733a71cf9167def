// The reflection of a sharp light: the share of the microfacets that mirror it, times the light they all would reflect.
// The shader that includes this includes sub_light.glsl and gloss.glsl.
#include "surface_axes.glsl"

// Slope of the microfacets that mirror a direction, by two axes of the surface, in widths of the lobe.
vec2 slope_of(View view, mat3 surface, vec3 along) {
    vec3 half_vector = (along + view.toward) * surface;
    return half_vector.xy / (max(half_vector.z, LEAST_HALF_Z) * view.alpha);
}

// Share of the microfacets whose slopes lie in a disc, by the squares of its middle's distance from no slope and of its
// radius. GGX, 1 / pi (1 + p^2)^2, is a uniform sphere projected stereographically, and discs are its caps.
float share_in_disc(float away_square, float radius_square) {
    float apart = 1.0 + away_square - radius_square, scale = sqrt(apart * apart + 4.0 * radius_square);
    return apart > 0.0 ? 2.0 * radius_square / (scale * (scale + apart)) : 0.5 - 0.5 * apart / scale;
}

// Light that is reflected from a direction, without Schlick's term, if all microfacets mirrored it; `lit` is its cosine
// to the normal.
float light_of_all(View view, vec3 along, float lit) {
    float view_half = half_cosine(view, along);
    float half_z = max(dot(view.normal, along + view.toward) / (2.0 * view_half), LEAST_HALF_Z);
    return 4.0 * view_half / half_z * masking(view, lit) * lit;
}

// What an edge adds to the share of the microfacets whose slopes lie in a polygon: Green's theorem.
float share_by_edge(vec2 from, vec2 to) {
    vec2 along = to - from;
    float span = max(length(along), 1e-12);
    along /= span;
    float off = from.x * along.y - from.y * along.x, start = dot(from, along);
    float q = inversesqrt(1.0 + off * off);
    return off * q * atan(span * q, 1.0 + start * (start + span) * q * q) / (2.0 * PI);
}

// The light's outline as slopes: the ends of two diameters of a disc, or the corners of a rectangle.
struct Outline {
    vec2 ends[4];
    float lowest;  // least cosine of the normal and those microfacets'
    float above;   // share of a flat light above the surface's horizon, by the heights of those ends
    float highest; // largest cosine of the surface to them
    float cosine;  // mean of theirs, without those below
    bool polygon;
};

Outline outline_of(View view, mat3 surface, SeenLight light, mat3 axes) {
    Outline outline;
    outline.polygon = false;
#if PANELS
    outline.polygon = is_rectangle(light);
#endif
    outline.lowest = 1.0;
    vec4 heights;
    vec2 place = outline.polygon ? vec2(1.0) : vec2(1.0, 0.0);
    for (uint k = 0; k < 4; k++) {
        vec3 along = axes * along_axes(light, place);
        outline.ends[k] = slope_of(view, surface, along);
        outline.lowest = min(outline.lowest, dot(view.normal, normalize(along + view.toward)));
        heights[k] = dot(view.normal, along);
        place = vec2(-place.y, place.x);
    }
    float top = max(max(heights.x, heights.y), max(heights.z, heights.w));
    float bottom = min(min(heights.x, heights.y), min(heights.z, heights.w));
    if (!outline.polygon) {
        float middle = 0.25 * dot(heights, vec4(1.0)), reach = 0.5 * length(heights.xy - heights.zw);
        top = middle + reach;
        bottom = middle - reach;
    }
    outline.highest = max(top, 0.0);
    outline.cosine = 0.25 * dot(max(heights, 0.0), vec4(1.0));
    outline.above = clamp(top / max(top - bottom, 1e-6), 0.0, 1.0);
    return outline;
}

// The share of a rectangle, or of the first so many of its edges: a software device leaves a loop early that no lane goes
// on with, and runs a branch that none takes. Edges are bent as slopes: each counts as two.
float share_in_rectangle(View view, mat3 surface, SeenLight light, mat3 axes, Outline outline, uint edges) {
    float sum = 0.0;
    vec2 place = vec2(1.0);
    for (uint k = 0; k < edges; k++) {
        vec2 next = vec2(-place.y, place.x);
        vec2 between = slope_of(view, surface, axes * along_axes(light, 0.5 * (place + next)));
        sum += share_by_edge(outline.ends[k], between) + share_by_edge(between, outline.ends[(k + 1) % 4]);
        place = next;
    }
    return abs(sum);
}

// The share of the microfacets that mirror a light, and the place on it that most of these mirror.
float share_in_outline(View view, mat3 surface, SeenLight light, mat3 axes, Outline outline, out vec2 place) {
    vec2 first = 0.5 * (outline.ends[0] - outline.ends[2]), second = 0.5 * (outline.ends[1] - outline.ends[3]);
    vec2 middle = 0.25 * (outline.ends[0] + outline.ends[1] + outline.ends[2] + outline.ends[3]);
    float turn = first.x * second.y - first.y * second.x, away = dot(middle, middle);
    // The disc of the same area, and the place on the light that a mirror would show. No light is smaller than a pixel.
    float radius = abs(turn) * (outline.polygon ? 2.0 / PI : 1.0);
    float footprint = view.footprint / (view.alpha * view.alpha), widened = max(length(vec2(radius, footprint)), 1e-30);
    turn = abs(turn) < 1e-20 ? 1e-20 : turn;
    vec2 across = vec2(second.x * middle.y - second.y * middle.x, first.y * middle.x - first.x * middle.y) / turn;
    across = clamp(across, -1e9, 1e9);
    // A strip is long before its area is large.
    float widest = max(dot(first, first), dot(second, second));
    bool whole = outline.polygon && widest > WIDE_OUTLINE * (1.0 + away) && radius > footprint;
    float share = share_in_rectangle(view, surface, light, axes, outline, whole ? 4 : 0);
    if (!whole) {
        // An ellipse that is wide counts by where its own outline lies.
        float wide = 16.0 * radius * radius;
        float by_outline = outline.polygon ? 0.0 : wide / max(wide + away * away, 1e-30);
        share = share_in_disc(mix(away, dot(across, across) * radius, by_outline), widened) * radius / widened;
    }
    // Diameters lead to the corners of a rectangle.
    place = outline.polygon ? vec2(across.x - across.y, across.x + across.y) : across;
    float off = outline.polygon ? max(abs(place.x), abs(place.y)) : length(place);
    place *= radius / ((1.0 + radius) * max(off, 1.0));
    return share;
}

// The reflection of a whole light, of radiance 1; `to` leads to its centre.
vec2 reflect_light(View view, vec3 to, Entity shining) {
    SeenLight light = seen_light(to, shining);
    mat3 axes = mat3(light.toward, light.across, light.down), surface = surface_axes(view.normal);
    Outline outline = outline_of(view, surface, light, axes);
    float centre = dot(view.normal, light.toward), cosine = part_cosine(centre, light.sine);
#if PANELS
    cosine = is_panel(light) ? outline.cosine : cosine;
#endif
    vec2 place;
    float share = share_in_outline(view, surface, light, axes, outline, place);
    vec3 by_axes = along_axes(light, place), along = axes * by_axes;
    float lit = max(dot(view.normal, along), cosine);
    float value = share * light_of_all(view, along, lit);
    // Slopes have no bound at the horizon: there the light is a point.
    float omega = part_light(light, Block(vec2(0.0), 0.0, 1.0, 1.0), vec2(0.0), along_axes(light, vec2(0.0)));
    float low = lobe_of_part(view, light.toward, cosine, omega) * cosine * omega;
    // No more than if all of it stood where the lobe is brightest, as of a panel that nearly lies in the surface.
    value = min(value, omega * outline.highest * masking(view, cosine) / (PI * view.alpha * view.alpha));
    value = mix(low, value, clamp((outline.lowest / view.alpha - LOW_FROM) / (LOW_TO - LOW_FROM), 0.0, 1.0));
    float above = clamp(0.5 + 0.5 * centre / light.sine, 0.0, 1.0);
    bool seen = lit > 0.0;
#if PANELS
    above = is_panel(light) ? outline.above : above;
    seen = seen && !(is_panel(light) && dot(light.facing, by_axes) > 0.0);
#endif
    float term = schlick(half_cosine(view, along));
    return seen ? above * value * vec2(1.0 - term, term) : vec2(0.0);
}

// A bound of what a surface of reflectance `f0` reflects of a light of radiance 1: all its microfacets have the density of
// those that are nearest to the middle of the lobe.
float most_light(View view, vec3 to, Entity shining, float f0) {
    float distance = max(length(to), 1e-30);
    vec3 toward = to / distance, halves = toward + view.toward;
    float sine = min(1.0 / (shining.centre.w * distance), 1.0);
    float half_z = dot(view.normal, halves), across = length(halves - half_z * view.normal), size = length(halves);
    // The half vector of the light's rim lies no farther off than half as far as the rim.
    float nearest = max(across - sine, 0.0) / (min(half_z + sine, 2.0) * view.alpha);
    float lowest = max(half_z - sine, 0.0);
    // Slopes stretch where the half vector is nearer to the horizon than the light is to it.
    float radius = sine / max(lowest * view.alpha, 1e-6);
    float stretch = max(0.5 * (size + sine) * (size + sine) / max(lowest, 1e-6), 1.0);
    float spread = 1.0 + nearest * nearest;
    float share = min((stretch * radius * radius + view.footprint / (view.alpha * view.alpha)) / (spread * spread), 1.0);
    float lit = clamp(dot(view.normal, toward) + sine, 0.0, 1.0);
    float term = schlick(max(0.5 * size - sine, 0.0));
    return lowest > 0.3 ? (f0 + term) * share * 4.0 * size / lowest * masking(view, lit) * lit : lit * EVERYTHING;
}
