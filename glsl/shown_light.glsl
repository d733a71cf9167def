// Light of pixels for the pass that shows it, from what "pixel light" has found.
#include "screen_light.glsl"
layout(binding = LIGHT_BINDING) uniform utexture2D screen_light;

// Replaces light and shares by those of this pixel, or of the first one beside it that shows the same surface; they stay
// where there is none.
void find_light(uint entity, bool wanted, inout vec3 light, inout vec4 shares) {
    const ivec2 BESIDE[5] = ivec2[](ivec2(0), ivec2(1, 0), ivec2(-1, 0), ivec2(0, 1), ivec2(0, -1));
    float off = SAME_DEPTH * gl_FragCoord.z + 2.0 * fwidth(gl_FragCoord.z);
    ivec2 last = textureSize(screen_light, 0) - 1;
    uint i = 0;
    bool found = false;
    // A loop, because a software device runs a branch that no lane takes.
    do {
        ivec2 at = clamp(ivec2(gl_FragCoord.xy) + BESIDE[i], ivec2(0), last);
        uvec4 texel = texelFetch(screen_light, at, 0);
        found = wanted && is_of(texel, entity, gl_FragCoord.z, off);
        light = found ? light_of(texel) : light;
        shares = found ? shares_of(texel) : shares;
        i++;
    } while (wanted && !found && i < 5);
}
