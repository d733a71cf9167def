// A buffer that a function reads: as texels where TEXEL is 1, which processors read many times faster, else as a
// storage block.
#ifndef READABLE
#define READABLE
#if TEXEL
#define READ_VEC4(slot, block, name, read) \
    layout(binding = slot) uniform textureBuffer name; \
    vec4 read(uint i) { return texelFetch(name, int(i)); }
#define READ_UVEC2(slot, block, name, read) \
    layout(binding = slot) uniform utextureBuffer name; \
    uvec2 read(uint i) { return texelFetch(name, int(i)).xy; }
#define READ_UINT(slot, block, name, read) \
    layout(binding = slot) uniform utextureBuffer name; \
    uint read(uint i) { return texelFetch(name, int(i)).x; }
#else
#define READ_BLOCK(slot, kind, block, name, read) \
    layout(std430, binding = slot) readonly buffer block { kind name[]; }; \
    kind read(uint i) { return name[i]; }
#define READ_VEC4(slot, block, name, read) READ_BLOCK(slot, vec4, block, name, read)
#define READ_UVEC2(slot, block, name, read) READ_BLOCK(slot, uvec2, block, name, read)
#define READ_UINT(slot, block, name, read) READ_BLOCK(slot, uint, block, name, read)
#endif
#endif
