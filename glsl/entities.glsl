// All entities, at ENTITY_BINDING. They are the same for a whole workgroup. A GPU loads them once, from a uniform or storage block. A
// software device reads blocks lane by lane; a texel read brings four numbers at a time.
#if UNIFORM
layout(std140, binding = ENTITY_BINDING) uniform Entities { Entity entities[ENTITY_LIMIT]; };
#define ENTITY(e) entities[e]
#define ENTITY_CENTRE(e) entities[e].centre
#elif TEXEL
layout(binding = ENTITY_BINDING) uniform textureBuffer entities;
Entity entity_at(uint e) {
    int at = int(e) * 11;
    vec4 third = texelFetch(entities, at + 2);
    return Entity(texelFetch(entities, at), texelFetch(entities, at + 1), third.xy, floatBitsToUint(third.z),
        floatBitsToUint(third.w), texelFetch(entities, at + 3), texelFetch(entities, at + 4), texelFetch(entities, at + 5),
        texelFetch(entities, at + 6), texelFetch(entities, at + 7), texelFetch(entities, at + 8), texelFetch(entities, at + 9),
        texelFetch(entities, at + 10));
}
#define ENTITY(e) entity_at(e)
#define ENTITY_CENTRE(e) texelFetch(entities, int(e) * 11)
#else
layout(std430, binding = ENTITY_BINDING) readonly buffer Entities { Entity entities[]; };
#define ENTITY(e) entities[e]
#define ENTITY_CENTRE(e) entities[e].centre
#endif
