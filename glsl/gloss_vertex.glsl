// What a vertex of a glossy entity passes on to its pixels. The shader that includes this binds `vertices`, which have a
// position and a normal each.
layout(binding = GLOSS_BINDING) uniform textureBuffer gloss_entities;
#include "generated/gloss_structs.glsl"
#include "generated/gloss_entity_at.glsl"
layout(binding = GLOSS_BINDING + 1) uniform textureBuffer reflected;    // two of every vertex: glsl/gloss.comp
layout(binding = GLOSS_BINDING + 2) uniform utextureBuffer shown_shares; // of the lights that highlights are of
layout(location = 6) out vec3 from_eye; // world axes, metres
layout(location = 7) out vec3 normal;   // world
layout(location = 8) out vec4 first;   // glsl/gloss.comp
layout(location = 9) out vec3 second;
#if HIGHLIGHTS
layout(location = 10) out vec4 shares[SHOWN_QUADS];
#endif

void pass_gloss(uint index, uint v) {
    GlossEntity entity = gloss_entity_at(index);
    int at = int(2 * (entity.vertex_first + v)), lit = int(entity.radiosity_first + v);
    vec4 place = vec4(texelFetch(vertices, at).xyz, 1.0);
    from_eye = vec3(dot(entity.row_x, place), dot(entity.row_y, place), dot(entity.row_z, place));
    vec3 own = texelFetch(vertices, at + 1).xyz;
    normal = vec3(dot(entity.row_x.xyz, own), dot(entity.row_y.xyz, own), dot(entity.row_z.xyz, own));
    first = texelFetch(reflected, 2 * lit);
    second = texelFetch(reflected, 2 * lit + 1).rgb;
#if HIGHLIGHTS
    uvec4 bytes = texelFetch(shown_shares, lit);
    [[unroll]] for (uint q = 0; q < SHOWN_QUADS; q++) {
        shares[q] = unpackUnorm4x8(bytes[q]);
    }
#endif
}
