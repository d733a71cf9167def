// Light of pixels for the pass that shows it, from what "pixel light" has found.
#include "screen_light.glsl"
layout(binding = LIGHT_BINDING) uniform utexture2D screen_light;

// Replaces light and shares by those of this pixel, or of the first one beside it that shows the same surface; they stay
// where there is none.
void find_light(uint entity, bool wanted, inout vec3 light, inout vec4 shares) {
    const ivec2 BESIDE[4] = ivec2[](ivec2(1, 0), ivec2(-1, 0), ivec2(0, 1), ivec2(0, -1));
    float off = SAME_DEPTH * gl_FragCoord.z + 2.0 * fwidth(gl_FragCoord.z);
    ivec2 last = textureSize(screen_light, 0) - 1;
    uint key = light_key(entity, gl_FrontFacing);
    uvec4 texel = texelFetch(screen_light, ivec2(gl_FragCoord.xy), 0);
    bool seeks = wanted && !is_of(texel, key, gl_FragCoord.z, off);
    // A loop, because a software device runs a branch that no lane takes. On lavapipe a lane that leaves one before others
    // may lose what it has computed there: those that seek leave it together.
    uvec4 beside = uvec4(0);
    uint i = 0;
    do {
        ivec2 at = clamp(ivec2(gl_FragCoord.xy) + BESIDE[i], ivec2(0), last);
        uvec4 there = texelFetch(screen_light, at, 0);
        beside = beside == uvec4(0) && is_of(there, key, gl_FragCoord.z, off) ? there : beside;
        i++;
    } while (seeks && i < 4);
    texel = seeks ? beside : texel;
    bool found = wanted && texel != uvec4(0);
    light = found ? light_of(texel) : light;
    shares = found ? shares_of(texel) : shares;
}
