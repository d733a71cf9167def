#version 460
#extension GL_EXT_samplerless_texture_functions : require
// Takes a pixel's light from the four coarse texels around it, where they lie on its surface and no edge runs between
// them, neither of a shadow nor of a facet. An edge is near to all four that it runs between, or they differ. Other pixels
// are left to be evaluated.
#include "screen_light.glsl"
layout(binding = COARSE_BINDING) uniform utexture2D coarse;
layout(location = 0) out uvec4 kept;
#if HOLES
layout(location = 3) in vec2 uv;
layout(binding = 12) uniform sampler2D picture;
#include "holes.glsl"
#endif
#if GRID
#include "grid_push.glsl"
#else
#include "triangle_push.glsl"
#endif

void main() {
#if HOLES
    cut_holes(texture(picture, uv).a, push.alpha_cutoff);
#endif
    vec2 place = gl_FragCoord.xy / float(COARSE_PX) - 0.5;
    vec2 slope = float(COARSE_PX) * vec2(dFdx(gl_FragCoord.z), dFdy(gl_FragCoord.z));
    ivec2 low = ivec2(floor(place)), last = textureSize(coarse, 0) - 1;
    vec2 within = place - vec2(low);
    vec3 light = vec3(0.0);
    vec4 shares = vec4(0.0);
    vec3 least = vec3(65504.0), most = vec3(0.0);
    float whole = 0.0;
    uint found = 0, near = 0;
    for (uint i = 0; i < 4; i++) {
        ivec2 at = low + ivec2(i & 1, i >> 1);
        uvec4 texel = texelFetch(coarse, clamp(at, ivec2(0), last), 0);
        float depth = gl_FragCoord.z + dot(slope, vec2(at) - place);
        bool fits = is_of(texel, push.receiver, depth, SAME_DEPTH * gl_FragCoord.z);
        vec3 own = light_of(texel);
        float weight = ((i & 1) == 0 ? 1.0 - within.x : within.x) * ((i >> 1) == 0 ? 1.0 - within.y : within.y);
        weight = fits ? weight : 0.0;
        light += weight * own;
        shares += weight * shares_of(texel);
        whole += weight;
        least = fits ? min(least, own) : least;
        most = fits ? max(most, own) : most;
        found += fits ? 1 : 0;
        near += fits && is_edge_near(texel) ? 1 : 0;
    }
    bool differ = dot(most - least, vec3(1.0)) > MOST_CHANGE * dot(most, vec3(1.0));
    if (whole < LEAST_WHOLE || near == 4 || near > 0 && found < 4 || differ) {
        discard;
    }
    kept = pack_light(push.receiver, gl_FragCoord.z, light / whole, shares / whole, false);
}
