// What a surface mirrors, from the pictures that are drawn for it: src/draw/mirror.rs.
layout(binding = MIRROR_BINDING) uniform sampler2D mirror_levels; // alpha: 1, or 0 where nothing stands
layout(binding = MIRROR_BINDING + 1) uniform sampler2D mirror_far; // glsl/mirror_far.frag

// Shares of the way behind the mirror: less is that of something which touches it, and so many times more is beyond.
const float TOUCHES = 0.1;
const float PAST_GAP = 4.0;
// Least share of a lobe that stands for all of it.
const float LEAST_KNOWN = 0.02;
// Widths of texels, over that of slopes, whose blurs with these weights have the same share within any radius as slopes
// of GGX have, p^2 / (1 + p^2), within 0.03; one alone, of 1.8, within 0.13.
const vec2 LOBE_WIDTHS = vec2(1.24, 4.26);
const vec2 LOBE_WEIGHTS = vec2(0.683, 0.317);

// The mirror whose plane a pixel lies on; -1 where it lies on none.
int mirror_of(GlossEntity entity, vec3 n, vec3 from_eye) {
    vec4 cosine = entity.mirror_x * n.x + entity.mirror_y * n.y + entity.mirror_z * n.z;
    vec4 off = entity.mirror_x * from_eye.x + entity.mirror_y * from_eye.y + entity.mirror_z * from_eye.z;
    bvec4 faces = greaterThan(cosine, vec4(MIRROR_FLAT));
    bvec4 near = lessThan(abs(off + entity.mirror_offset), vec4((1.0 - MIRROR_FLAT) * length(from_eye)));
    vec4 lies = vec4(faces) * vec4(near);
    return lies.x > 0.0 ? 0 : lies.y > 0.0 ? 1 : lies.z > 0.0 ? 2 : lies.w > 0.0 ? 3 : -1;
}

// The level of detail whose texels are as wide as a radius, texels of the finest.
float blur_level(float radius) {
    return clamp(log2(max(radius, 1.0)), 0.0, float(textureQueryLevels(mirror_levels) - 1));
}

// A place from which filters of a level read no texel of other mirrors.
vec2 within_part(vec2 place, vec2 ends, float level) {
    float rim = 0.5 * exp2(ceil(level));
    return vec2(clamp(place.x, ends.x + rim, ends.y - rim), place.y);
}

// A place, or the texel beside it of something that touches the mirror: through the gap under that, what lies beyond is
// seen. `scale` makes a depth the share of the way that is behind the mirror.
vec2 before_gap(vec2 place, vec2 ends, float scale) {
    ivec2 first = ivec2(ends.x, 0), last = ivec2(ends.y, textureSize(mirror_far, 0).y) - 1;
    ivec2 texel = ivec2(place), nearest = texel;
    float least = texelFetch(mirror_far, texel, 0).x, most = least;
    for (int i = 0; i < 9; i++) {
        ivec2 at = clamp(texel + ivec2(i % 3, i / 3) - 1, first, last);
        float far = texelFetch(mirror_far, at, 0).x;
        nearest = far < least ? at : nearest;
        least = min(far, least);
        most = max(far, most);
    }
    return least * scale < TOUCHES && most > PAST_GAP * least ? vec2(nearest) + 0.5 : place;
}

// Radiance of what stands there, and the share of the lobe that it fills.
vec4 mirrored_light(GlossEntity entity, int mirror, float alpha) {
    vec2 size = vec2(textureSize(mirror_levels, 0));
    vec2 ends = entity.mirror_left[mirror] + vec2(0.0, entity.mirror_view.z);
    vec2 place = gl_FragCoord.xy * entity.mirror_view.xy + vec2(ends.x, 0.0);
    float scale = entity.mirror_behind[mirror] / gl_FragCoord.w;
    float widest = MIRROR_SPREAD * alpha * entity.mirror_view.w;
    place = before_gap(within_part(place, ends, 0.0), ends, scale);
    // How far behind the mirror that is, as a share of the way: the least of means around the place, for the wider ones
    // hold what lies beyond something that touches the mirror.
    float coarse = blur_level(0.5 * widest), far = 1.0;
    for (uint i = 0; i < 3; i++) {
        float level = 0.5 * float(i) * coarse;
        far = min(far, textureLod(mirror_far, within_part(place, ends, level) / size, level).x);
    }
    vec4 sum = vec4(0.0);
    float whole = 0.0; // share of the lobe that the picture knows of
    for (uint i = 0; i < 2; i++) {
        float level = blur_level(LOBE_WIDTHS[i] * alpha * entity.mirror_view.w * min(far * scale, 1.0));
        vec2 at = within_part(place, ends, level) / size;
        sum += LOBE_WEIGHTS[i] * textureLod(mirror_levels, at, level);
        whole += LOBE_WEIGHTS[i] * textureLod(mirror_far, at, level).y;
    }
    return sum / max(whole, LEAST_KNOWN);
}

#if PROBES
const uint PROBE_STEPS = 5;
const uint PROBE_HALVINGS = 5;

// Where a direction from a probe is in its pictures, texels.
vec2 probe_place(GlossEntity entity, vec3 toward, float level) {
    vec3 size = abs(toward);
    uint axis = size.x >= max(size.y, size.z) ? 0 : size.y >= size.z ? 1 : 2;
    vec2 tilt = vec2(toward[(axis + 1) % 3], toward[(axis + 2) % 3]) / max(size[axis], 1e-20);
    float side = entity.probe.w, rim = 0.5 * exp2(ceil(level));
    uint face = 2 * axis + (toward[axis] < 0.0 ? 1 : 0);
    vec2 corner = vec2(entity.mirror_left.x, 0.0) + side * vec2(face % 3, face / 3);
    return corner + clamp(side * (0.5 + 0.5 * PROBE_ZOOM * tilt), rim, side - rim);
}

// Whether a place, from a probe, lies behind what the probe sees that way.
bool is_behind(GlossEntity entity, vec3 place, float level) {
    vec3 sides = abs(place);
    vec2 texel = probe_place(entity, place, level) / vec2(textureSize(mirror_far, 0));
    float near = 1.0 - textureLod(mirror_far, texel, level).x;
    return max(sides.x, max(sides.y, sides.z)) * near > entity.mirror_behind.x;
}

// Radiance of what a curved surface mirrors along a unit vector from a place, from its probe, and the share of the lobe
// that it fills; `turn` is how far that vector turns from one pixel to the next. The ray is followed in steps to where it
// is first behind what the probe sees, a share of the way to infinity, and the last step is halved.
vec4 probed_light(GlossEntity entity, float alpha, vec3 place, vec3 toward, float turn) {
    float scale = max(length(place), 1e-6);
    float widest = PROBE_SPREAD * alpha * entity.mirror_view.w, of_pixel = 0.5 * turn * entity.mirror_view.w;
    float level = min(blur_level(0.5 * widest + of_pixel), float(PROBE_LEVEL));
    float before = 0.0, behind = 1.0;
    for (uint i = 0; i < PROBE_STEPS + PROBE_HALVINGS; i++) {
        float next = i < PROBE_STEPS ? float(i + 1) / float(PROBE_STEPS + 1) : 0.5 * (before + behind);
        bool open = i >= PROBE_STEPS || behind == 1.0;
        bool hit = is_behind(entity, place + scale * next / (1.0 - next) * toward, level);
        behind = open && hit ? next : behind;
        before = open && !hit ? next : before;
    }
    float share = 0.5 * (before + behind), way = scale * share / (1.0 - share);
    vec3 met = place + way * toward;
    float reach = 2.0 * alpha * entity.mirror_view.w * min(way / max(length(met), 1e-6), 1.0);
    vec2 size = vec2(textureSize(mirror_levels, 0));
    vec4 sum = vec4(0.0);
    for (uint i = 0; i < 2; i++) {
        level = min(blur_level(LOBE_WIDTHS[i] * reach + of_pixel), float(PROBE_LEVEL));
        sum += LOBE_WEIGHTS[i] * textureLod(mirror_levels, probe_place(entity, met, level) / size, level);
    }
    return sum;
}
#endif
