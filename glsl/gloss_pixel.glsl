// What a pixel of a glossy entity reflects towards the eye. The shader that includes this has entities and what
// sub_light.glsl needs, where the scene has lights that highlights are of.
layout(binding = GLOSS_BINDING) uniform textureBuffer gloss_entities;
#include "generated/gloss_structs.glsl"
#include "generated/gloss_entity_at.glsl"
layout(location = 6) in vec3 from_eye; // world axes, metres
layout(location = 7) centroid in vec3 normal; // world
layout(location = 8) centroid in vec4 first;    // glsl/gloss.comp
layout(location = 9) centroid in vec3 second;
#if HIGHLIGHTS
layout(location = 10) centroid in vec4 shares[SHOWN_QUADS];
#endif
#define MAP_BINDING GLOSS_BINDING + 3
#define TABLE_BINDING GLOSS_BINDING + 4
#define SKY MIRROR
#include "gloss.glsl"
#if HIGHLIGHTS
#include "highlight.glsl"
#endif
#if MIRRORED
#include "mirror.glsl"
#endif

#if HIGHLIGHTS
// One of the lights that highlights are of; any where there are fewer, which has no share.
Entity highlight_light(GlossEntity entity, uint i) {
    uint pair = (i < 8 ? entity.lights : entity.more_lights)[i / 2 % 4];
    return ENTITY(pair >> 16 * (i % 2) & 0xffff);
}

// How much of it arrives: of the first four `share`, of the others as vertices have it.
float share_of(vec4 share, float within, uint i) {
    [[unroll]] for (uint q = 1; q < SHOWN_QUADS; q++) {
        share = i / 4 == q ? within * shares[q] : share;
    }
    return share[i % 4];
}
#endif

#if TEXTURED
layout(binding = GLOSS_BINDING + 5) uniform sampler2D gloss_picture;  // green: roughness, blue: metal
layout(binding = GLOSS_BINDING + 6) uniform sampler2D normal_picture; // in tangent space
layout(binding = GLOSS_BINDING + 7) uniform sampler2D emission_picture;

// The normal that the picture gives a place. The tangents follow from how places and coordinates change over the screen
// (Schueler, Normal Mapping Without Precomputed Tangents, ShaderX 5).
vec3 mapped_normal(vec3 n, vec3 place, vec2 uv, float slope) {
    vec3 place_x = dFdx(place), place_y = dFdy(place);
    vec2 uv_x = dFdx(uv), uv_y = dFdy(uv);
    float turn = uv_x.x * uv_y.y - uv_y.x * uv_x.y;
    vec3 along_u = (place_x * uv_y.y - place_y * uv_x.y) * sign(turn);
    vec3 against_v = (place_x * uv_y.x - place_y * uv_x.x) * sign(turn);
    along_u -= n * dot(n, along_u);
    against_v -= n * dot(n, against_v);
    vec3 found = 2.0 * textured(normal_picture, uv).xyz - 1.0;
    vec3 tilted = slope * found.x * along_u / max(length(along_u), 1e-20)
                + slope * found.y * against_v / max(length(against_v), 1e-20) + max(found.z, 0.0) * n;
    return turn != 0.0 && dot(tilted, tilted) > 0.0 ? normalize(tilted) : n;
}

// Light that a surface which faces along `n` would have if as much were blocked for it as for its vertices, and by the
// surface itself, whose own normal is `ground`.
vec3 open_light(GlossEntity entity, vec3 n, vec3 ground, vec3 place, vec3 bounced, vec4 share, float within) {
    // Of the roughest lobe the map holds what a diffuse surface sees.
    vec3 sum = (0.5 + 0.5 * dot(n, ground)) * (bounced + entity.sky_scale * sky_at(n, LEVELS - 1.0));
#if HIGHLIGHTS
    uint i = 0;
    do {
        Entity shining = highlight_light(entity, i);
        SeenLight light = seen_light(shining.centre.xyz - entity.eye - place, shining);
        vec3 along = along_axes(light, vec2(0.0));
        float facing = dot(mat3(light.toward, light.across, light.down) * along, n);
        float unit = part_light(light, Block(vec2(0.0), 0.0, 1.0, 1.0), vec2(0.0), along);
        sum += share_of(share, within, i) * unit * max(facing, 0.0) / PI * shining.emission;
        i++;
    } while (i < entity.light_count);
#endif
    return sum;
}
#endif

// Shares of the lights that highlights are of, as vertices have them.
vec4 vertex_shares(float within) {
#if HIGHLIGHTS
    return within * shares[0];
#else
    return vec4(0.0);
#endif
}

// Radiance of a pixel without emission. `light` is that of a diffuse surface of colour `base`, `share` of the first four
// lights that highlights are of how much arrives; `within` is that of within_triangle.
vec3 glossy(uint index, vec3 base, vec3 light, vec4 share, vec2 uv, float within) {
    GlossEntity entity = gloss_entity_at(index);
    vec3 n = normalize(normal);
    float roughness = entity.roughness, metallic = entity.metallic;
    Reflection found = Reflection(within * first.rgb, within * second);
#if TEXTURED
    vec4 of_gloss = textured(gloss_picture, uv);
    roughness = clamp(entity.factors.x * of_gloss.g, 0.0, 1.0);
    metallic = clamp(entity.factors.y * of_gloss.b, 0.0, 1.0);
    vec3 mapped = mapped_normal(n, from_eye, uv, entity.factors.z);
    vec3 smooth_light = open_light(entity, n, n, from_eye, found.grazing, share, within);
    vec3 mapped_light = open_light(entity, mapped, n, from_eye, found.grazing, share, within);
    light *= clamp(mapped_light / max(smooth_light, vec3(1e-20)), vec3(0.0), vec3(MOST_TILTED));
    View view = view_of(from_eye, mapped, roughness);
    view.ground = n;
#else
    View view = view_of(from_eye, n, roughness);
#endif
    float energy = within * first.w;
#if MIRROR
    // Vertices have the share of the sky that gets through, and the light that has bounced.
    vec2 of_unit = reflected_share(view, roughness);
    vec3 through = found.facing, nearby = found.grazing;
#if MIRRORED
    int mirror = mirror_of(entity, n, from_eye);
    float of_mirror = mirror < 0 ? 0.0 : entity.mirror_share[mirror];
#if PROBES
    vec3 ray = reflect(-view.toward, view.normal), place = from_eye - entity.probe.xyz;
    float turn = max(length(dFdx(ray)), length(dFdy(ray)));
    bool is_probe = entity.probe.w > 0.0;
    // What faces inwards sees its own surface, as its vertices do.
    float outward = smoothstep(-0.1, 0.1, dot(n, place) / max(length(place), 1e-6));
    of_mirror = is_probe ? outward * entity.mirror_share.x : of_mirror;
#else
    const bool is_probe = false;
#endif
    if (of_mirror > 0.0) {
        vec4 mirrored;
        if (is_probe) {
#if PROBES
            mirrored = probed_light(entity, view.alpha, place, ray, turn);
#endif
        } else {
            vec3 tilt = view.normal - n;
            mirrored = mirrored_light(entity, mirror, sqrt(view.alpha * view.alpha + dot(tilt, tilt)));
        }
        through = mix(through, vec3((1.0 - mirrored.a) * entity.sky_scale), of_mirror);
        nearby = mix(nearby, mirrored.rgb, of_mirror);
    }
#endif
    found = Reflection(of_unit.x * nearby, of_unit.y * nearby);
    if (through != vec3(0.0)) {
        Reflection sky = reflect_sky(view, roughness);
        found.facing += through * sky.facing;
        found.grazing += through * sky.grazing;
    }
    energy = of_unit.x + of_unit.y;
#endif
    vec3 f0 = mix(vec3(entity.f0), base, metallic);
#if HIGHLIGHTS
    // A disc of half of a pixel's area.
    vec3 turn_x = dFdx(view.normal), turn_y = dFdy(view.normal);
    view.footprint = (dot(turn_x, turn_x) + dot(turn_y, turn_y)) / (4.0 * PI);
    // Loops are tested at their ends, as in the merge.
    vec3 besides = diffuse_share(view.z, metallic, entity.f0) * light + f0 * found.facing + found.grazing;
    float least = LEAST_HIGHLIGHT * dot(besides, vec3(1.0));
    uint i = 0;
    do {
        // A software device evaluates a highlight for each turn of the loop that evaluates any.
        bool faint;
        do {
            Entity shining = highlight_light(entity, i);
            vec3 to = shining.centre.xyz - entity.eye - from_eye;
            float most = most_light(view, to, shining, max(f0.x, max(f0.y, f0.z)));
            faint = share_of(share, within, i) * most * dot(shining.emission, vec3(1.0)) <= least;
            i += faint ? 1 : 0;
        } while (faint && i < entity.light_count);
        if (i < entity.light_count) {
            Entity shining = highlight_light(entity, i);
            vec2 part = share_of(share, within, i) * reflect_light(view, shining.centre.xyz - entity.eye - from_eye, shining);
            found.facing += part.x * shining.emission;
            found.grazing += part.y * shining.emission;
            i++;
        }
    } while (i < entity.light_count);
#endif
    // A back shows the diffuse light of its front alone.
    vec3 specular = gl_FrontFacing ? f0 * found.facing + found.grazing : vec3(0.0);
    // Light that microfacets pass on to each other: Kulla and Conty, Revisiting Physically Based Shading at Imageworks,
    // SIGGRAPH 2017 course, as a factor.
    vec3 again = f0 * entity.mean_energy / max(1.0 - f0 * (1.0 - entity.mean_energy), 1e-6);
    specular *= 1.0 + again * (1.0 / max(energy, LEAST_ENERGY) - 1.0);
    return diffuse_share(view.z, metallic, entity.f0) * light + specular;
}

// What a pixel emits, of what its vertices do.
vec3 glow(uint index, vec3 by_vertex, vec3 factor, vec2 uv) {
#if TEXTURED
    GlossEntity entity = gloss_entity_at(index);
    return mix(by_vertex, factor * entity.glow.rgb * textured(emission_picture, uv).rgb, entity.factors.w);
#else
    return by_vertex;
#endif
}
