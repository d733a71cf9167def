// All entities, at ENTITY_BINDING. They are the same for a whole workgroup. A GPU loads them once, from a uniform or
// storage block. A software device reads blocks lane by lane; a texel read brings four numbers at a time.
#if UNIFORM
layout(std140, binding = ENTITY_BINDING) uniform Entities { Entity entities[ENTITY_LIMIT]; };
#define ENTITY(e) entities[e]
#elif TEXEL
layout(binding = ENTITY_BINDING) uniform textureBuffer entities;
#include "generated/entity_at.glsl"
#define ENTITY(e) entity_at(e)
#else
layout(std430, binding = ENTITY_BINDING) readonly buffer Entities { Entity entities[]; };
#define ENTITY(e) entities[e]
#endif
