// The reflection of a sharp light: the share of the microfacets that mirror it, times the light they all would reflect.
// The shader that includes this includes sub_light.glsl and gloss.glsl.

#include "surface_axes.glsl"

// Slope of the microfacets that mirror a direction, by two axes of the surface, in widths of the lobe.
vec2 slope_of(View view, mat3 surface, vec3 along) {
    vec3 half_vector = (along + view.toward) * surface;
    return half_vector.xy / (max(half_vector.z, LEAST_HALF_Z) * view.alpha);
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
    bool polygon;
};

Outline outline_of(View view, mat3 surface, SeenLight light, mat3 axes) {
    Outline outline;
    outline.polygon = false;
#if PANELS
    outline.polygon = is_rectangle(light);
#endif
    vec2 place = outline.polygon ? vec2(1.0) : vec2(1.0, 0.0);
    for (uint k = 0; k < 4; k++) {
        outline.ends[k] = slope_of(view, surface, axes * along_axes(light, place));
        place = vec2(-place.y, place.x);
    }
    return outline;
}

// The share of a rectangle. Its edges are bent as slopes: each counts as two.
float share_in_rectangle(View view, mat3 surface, SeenLight light, mat3 axes, Outline outline) {
    float sum = 0.0;
    vec2 place = vec2(1.0);
    for (uint k = 0; k < 4; k++) {
        vec2 next = vec2(-place.y, place.x);
        vec2 between = slope_of(view, surface, axes * along_axes(light, 0.5 * (place + next)));
        sum += share_by_edge(outline.ends[k], between) + share_by_edge(between, outline.ends[(k + 1) % 4]);
        place = next;
    }
    return abs(sum);
}

// The reflection of a whole light, of radiance 1; `to` leads to its centre.
vec2 reflect_light(View view, vec3 to, Entity shining) {
    SeenLight light = seen_light(to, shining);
    mat3 axes = mat3(light.toward, light.across, light.down), surface = surface_axes(view.normal);
    Outline outline = outline_of(view, surface, light, axes);
    vec2 first = 0.5 * (outline.ends[0] - outline.ends[2]), second = 0.5 * (outline.ends[1] - outline.ends[3]);
    vec2 middle = 0.25 * (outline.ends[0] + outline.ends[1] + outline.ends[2] + outline.ends[3]);
    float turn = first.x * second.y - first.y * second.x, away = dot(middle, middle);
    // The disc of the same area, and the place on the light that a mirror would show.
    float radius = abs(turn) * (outline.polygon ? 2.0 / PI : 1.0);
    turn = abs(turn) < 1e-20 ? 1e-20 : turn;
    vec2 place = vec2(second.x * middle.y - second.y * middle.x, first.y * middle.x - first.x * middle.y) / turn;
    float share;
    if (outline.polygon && radius > WIDE_OUTLINE * (1.0 + away)) {
        share = share_in_rectangle(view, surface, light, axes, outline);
    } else {
        // An ellipse that is wide counts by where its own outline lies. No light is smaller than a pixel.
        float wide = 16.0 * radius * radius;
        float by_outline = outline.polygon ? 0.0 : wide / max(wide + away * away, 1e-30);
        float widened = max(length(vec2(radius, view.footprint / (view.alpha * view.alpha))), 1e-30);
        share = share_in_disc(mix(away, dot(place, place) * radius, by_outline), widened) * radius / widened;
    }
    // The place that most of those microfacets mirror.
    float off = outline.polygon ? max(abs(place.x), abs(place.y)) : length(place);
    place *= radius / ((1.0 + radius) * max(off, 1.0));
    vec3 along = along_axes(light, place);
    float centre = dot(view.normal, light.toward);
    float lit = max(dot(view.normal, axes * along), part_cosine(centre, light.sine));
    float above = clamp(0.5 + 0.5 * centre / light.sine, 0.0, 1.0);
#if PANELS
    above = is_panel(light) && dot(light.facing, along) > 0.0 ? 0.0 : above;
#endif
    along = axes * along;
    float value = lit > 0.0 ? share * above * mirrored(view, along, lit) : 0.0, term = schlick(half_cosine(view, along));
    return value * vec2(1.0 - term, term);
}
