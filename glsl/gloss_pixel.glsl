// What a pixel of a glossy entity reflects towards the eye. The shader that includes this has entities and what
// sub_light.glsl needs, where the scene has lights that highlights are of.
layout(binding = GLOSS_BINDING) uniform textureBuffer gloss_entities;
#include "generated/gloss_structs.glsl"
#include "generated/gloss_entity_at.glsl"
layout(location = 6) centroid in vec3 from_eye; // world axes, metres
layout(location = 7) centroid in vec3 normal;   // world
layout(location = 8) centroid in vec4 first;    // glsl/gloss.comp
layout(location = 9) centroid in vec3 second;
#if HIGHLIGHTS
layout(location = 10) centroid in vec4 shares;
#endif
#define MAP_BINDING GLOSS_BINDING + 3
#define TABLE_BINDING GLOSS_BINDING + 4
#define SKY MIRROR
#include "gloss.glsl"

// Radiance of a pixel without emission. `light` is that of a diffuse surface of colour `base`; `within` is that of
// within_triangle.
vec3 glossy(uint index, vec3 base, vec3 light, float within) {
    GlossEntity entity = gloss_entity_at(index);
    vec3 place = within * from_eye;
    View view = view_of(place, normal, entity.roughness);
    Reflection found = Reflection(within * first.rgb, within * second);
#if MIRROR
    // Vertices have the share of the sky that gets through, and the light that has bounced.
    Reflection sky = reflect_sky(view, entity.roughness);
    vec2 of_unit = reflected_share(view, entity.roughness);
    found = Reflection(found.facing * sky.facing + of_unit.x * found.grazing,
        found.facing * sky.grazing + of_unit.y * found.grazing);
#endif
#if HIGHLIGHTS
    // Loops are tested at their ends, as in the merge. What is NONE has no share.
    uint i = 0;
    do {
        Entity shining = ENTITY(entity.lights[i] == NONE ? 0 : entity.lights[i]);
        vec2 part = within * shares[i] * reflect_light(view, shining.centre.xyz - entity.eye - place, shining);
        found.facing += part.x * shining.emission;
        found.grazing += part.y * shining.emission;
        i++;
    } while (i < entity.light_count);
#endif
    vec3 f0 = mix(vec3(entity.f0), base, entity.metallic);
    vec3 specular = f0 * found.facing + found.grazing;
    // Light that microfacets pass on to each other: Kulla and Conty, Revisiting Physically Based Shading at Imageworks,
    // SIGGRAPH 2017 course, as a factor.
    vec3 again = f0 * entity.mean_energy / max(1.0 - f0 * (1.0 - entity.mean_energy), 1e-6);
    specular *= 1.0 + again * (1.0 / max(within * first.w, LEAST_ENERGY) - 1.0);
    return diffuse_share(view.z, entity.metallic, entity.f0) * light + specular;
}
