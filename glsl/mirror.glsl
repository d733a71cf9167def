// What a flat surface mirrors, from the picture that is drawn for it: src/draw/mirror.rs.
layout(binding = MIRROR_BINDING) uniform sampler2D mirror_levels; // alpha: 1, or 0 where nothing stands
layout(binding = MIRROR_BINDING + 1) uniform sampler2D mirror_far; // what depth leaves of 1

// Share of the mirror's picture in what a pixel reflects: 0 off the plane.
float mirror_share(GlossEntity entity, vec3 n, vec3 from_eye) {
    float off = dot(entity.mirror_plane.xyz, from_eye) + entity.mirror_plane.w;
    bool lies = dot(entity.mirror_plane.xyz, n) > MIRROR_FLAT && abs(off) < (1.0 - MIRROR_FLAT) * length(from_eye);
    return lies ? entity.mirror_place.w : 0.0;
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

// Radiance of what stands there, and the share of the lobe that it fills.
vec4 mirrored_light(GlossEntity entity, float alpha) {
    vec2 size = vec2(textureSize(mirror_levels, 0)), ends = entity.mirror_view.xy;
    vec2 place = (gl_FragCoord.xy * entity.mirror_place.xy + vec2(entity.mirror_place.z, 0.0)) * size;
    float widest = MIRROR_SPREAD * alpha * entity.mirror_view.z;
    // How far behind the mirror that is, as a share of the way, in the mean around the place.
    float coarse = blur_level(0.5 * widest);
    float far = textureLod(mirror_far, within_part(place, ends, coarse) / size, coarse).x;
    float level = blur_level(widest * min(far * entity.mirror_view.w / gl_FragCoord.w, 1.0));
    return textureLod(mirror_levels, within_part(place, ends, level) / size, level);
}
