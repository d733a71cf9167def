// Light of sharp lights on a pixel. The shader that includes this defines FACINGS, the number of vertices whose weighed
// light the pixel has. It binds corners of cells or triangles at 0, and the radiosity of every vertex at 1, and its push
// constants have the receiver.
#include "merge_layout.glsl"
const uint NONE = 0xffffffffu;
#define ENTITY_BINDING 2
#include "entities.glsl"
#define NODE_BINDING 3
#include "silhouette_field.glsl"
layout(binding = 5) uniform utextureBuffer entries;
uint entry_at(uint i) {
    return texelFetch(entries, int(i)).x;
}
layout(binding = 6) uniform utextureBuffer chains; // of every cluster: first entry, and how many
layout(binding = 7) uniform textureBuffer soft;    // light on vertices without that of sharp lights
#if SELF
layout(binding = 10) uniform utextureBuffer self_cells;
uvec2 self_cell(uint i) {
    return texelFetch(self_cells, int(i)).xy;
}
#include "self_visibility.glsl"
#endif
#define STATES 1
#include "sharp_light.glsl"
#if SHOWN
layout(binding = 9) uniform utextureBuffer shown_lights_of; // of every entity
#endif
#include "screen_light.glsl"

// What the vertices of a pixel's triangle say of shadows: returns whether an edge is near, and keeps the rest.
bool read_marks(uvec3 corners) {
    uint marks = marks_of(radiosity, corners);
    light_states = marks >> 1;
    near_occluders = marks >> 1 + 2 * MARKED_LIGHTS;
    return marks_edge(marks);
}

// The chain of the cluster that vertex `v` of an entity belongs to.
uvec2 chain_of(uint cluster_first, uint v) {
    return texelFetch(chains, int(cluster_first + v / WORKGROUP)).xy;
}

// What is kept of a pixel: `soft` light, and that of sharp lights where the chain has any entries. `at`: object's frame, metres.
uvec4 pixel_light(Entity receiver, vec3 soft, vec3 at, Facing facings[FACINGS], uvec2 chain) {
    Surface surface;
    surface.position = receiver.scale * to_world(receiver, at);
    surface.origin = receiver.centre.xyz;
    surface.inverse_radius = receiver.centre.w;
    surface.facings = facings;
    surface.step = receiver.scale * max(length(dFdx(at)), length(dFdy(at)));
    vec3 light = soft;
#if SHOWN
    shown_lights = texelFetch(shown_lights_of, int(push.receiver));
#else
    const vec4 shown_shares = vec4(0.0);
#endif
    if (chain.y > 0) {
        light += sharp_sum(surface, chain.x, chain.y) * receiver.albedo;
    }
    return pack_light(push.receiver, gl_FragCoord.z, light, shown_shares, shows_badly(receiver.albedo, soft));
}
