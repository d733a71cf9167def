// The share of the parts of a light that a box lets through.
#include "cuboid.glsl"

vec4 past_cuboid(Entity occluder, Surface surface, SeenLight light, Block block) {
    // By the light's axes.
    mat3 to_axes = transpose(mat3(light.toward, light.across, light.down));
    mat3 edges;
    EACH for (uint i = 0; i < 3; i++) {
        edges[i] = to_axes * to_world(occluder, node_quad(occluder.silhouette + i).xyz);
    }
    vec3 to = occluder.centre.xyz - surface.origin - surface.position;
    Box box = box_of(edges, to_axes * to * occluder.centre.w);
    vec4 free;
    EACH for (uint k = 0; k < 4; k++) {
        vec2 part = part_place(light, block, k);
        vec3 along = along_axes(light, part);
        float sine = part_sine(light, block, part, along);
        float tangent = sine * inversesqrt(1.0 - sine * sine);
        float limit = reach_of(light, part, along) * occluder.centre.w;
        float nearest, away;
        free[k] = 1.0 - occluder.opacity * box_blocks(box, along, tangent, limit, nearest, away);
#if EDGES
        float penumbra = max(away, NEAREST_EDGE) * max(tangent, LEAST_PENUMBRA);
        find_edge(nearest, away, limit, penumbra, inversesqrt(block.area), surface.step * occluder.centre.w);
#endif
    }
    return free;
}
