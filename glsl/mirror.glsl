// What a flat surface mirrors, from the picture that is drawn for it: src/draw/mirror.rs.
layout(binding = MIRROR_BINDING) uniform sampler2D mirror_levels; // alpha: 1, or 0 where nothing stands
layout(binding = MIRROR_BINDING + 1) uniform sampler2D mirror_far; // what depth leaves of 1

// Share of the mirror's picture in what a pixel reflects: 0 off the plane.
float is_mirror(GlossEntity entity, vec3 n, vec3 from_eye) {
    float off = dot(entity.mirror_plane.xyz, from_eye) + entity.mirror_plane.w;
    bool lies = dot(entity.mirror_plane.xyz, n) > MIRROR_FLAT && abs(off) < (1.0 - MIRROR_FLAT) * length(from_eye);
    return lies ? entity.mirror_place.w : 0.0;
}

// Radiance of what stands there, and the share of the lobe that it fills.
vec4 mirrored_light(GlossEntity entity, float alpha) {
    vec2 size = vec2(textureSize(mirror_levels, 0)), ends = entity.mirror_view.xy;
    vec2 place = (gl_FragCoord.xy * entity.mirror_place.xy + vec2(entity.mirror_place.z, 0.0)) * size;
    float widest = MIRROR_SPREAD * alpha * entity.mirror_view.z;
    // How far behind the mirror that is, as a share of the way, in the mean around the place.
    float rough_level = log2(max(0.5 * widest, 1.0)), rim = 0.5 * exp2(ceil(rough_level));
    float left = textureLod(mirror_far, vec2(clamp(place.x, ends.x + rim, ends.y - rim), place.y) / size, rough_level).x;
    float level = log2(max(widest * min(left * entity.mirror_view.w / gl_FragCoord.w, 1.0), 1.0));
    rim = 0.5 * exp2(ceil(level));
    return textureLod(mirror_levels, vec2(clamp(place.x, ends.x + rim, ends.y - rim), place.y) / size, level);
}
