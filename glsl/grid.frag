#version 460
#include "finish.glsl"
// Shades a point of a grid with the interpolated radiance of its cell's triangle. One fetch finds the triangle and three read its
// corners, which on a software rasteriser is much cheaper than drawing small triangles.
layout(binding = 0) uniform utextureBuffer corners;  // vertices of each cell; see asset::grid
layout(binding = 1) uniform textureBuffer radiosity; // of every vertex of the scene
layout(location = 0) in vec2 place;
layout(location = 0) out vec4 color; // alpha: the entity's tag

layout(push_constant) uniform Push {
    mat4 clip_from_object;
    vec4 emission_white; // radiance factor; w = radiance that is shown as white
    float tag;
    uint first;  // its first vertex in the radiosity buffer
    uvec2 cells; // in a row, and rows
    uint receiver;      // the entity
    uint cluster_first; // its first cluster among those whose chains are known
    vec4 normal;        // object's frame
} push;

#if PIXEL
// Blocks of cells that a shadow's edge comes near are drawn by this: their pixels evaluate sharp lights themselves, since vertices carry no
// edge that is finer than their cells.
#extension GL_EXT_control_flow_attributes : require
layout(location = 1) in vec3 at_object; // object's frame, metres
#include "merge_layout.glsl"
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
#include "sharp_light.glsl"

vec3 pixel_light(uvec2 chain) {
    Entity receiver = ENTITY(push.receiver);
    Surface surface;
    surface.position = receiver.albedo.w * to_world(receiver, at_object);
    surface.normal = to_world(receiver, push.normal.xyz);
    surface.origin = receiver.centre.xyz;
    return sharp_sum(surface, chain.x, chain.y) * receiver.albedo.rgb;
}
#endif

void main() {
    uvec2 cell = uvec2(clamp(ivec2(floor(place)), ivec2(0), ivec2(push.cells) - 1));
    vec2 at = place - vec2(cell);
    uvec4 corner = texelFetch(corners, int(cell.y * push.cells.x + cell.x));
    bool upwards = corner.x >= 0x80000000u;
    corner.x &= 0x7fffffffu;
    // Two corners lie on the cell's diagonal; the third is the one on this point's side of it.
    bool far = upwards ? at.y > at.x : at.x + at.y > 1.0;
    uvec3 triangle = upwards ? uvec3(corner.x, corner.w, far ? corner.z : corner.y)
                             : uvec3(corner.y, corner.z, far ? corner.w : corner.x);
    vec3 weight;
    if (upwards) {
        weight = far ? vec3(1.0 - at.y, at.x, at.y - at.x) : vec3(1.0 - at.x, at.y, at.x - at.y);
    } else {
        weight = far ? vec3(1.0 - at.y, 1.0 - at.x, at.x + at.y - 1.0) : vec3(at.x, at.y, 1.0 - at.x - at.y);
    }
    uint first = min(triangle.x, min(triangle.y, triangle.z));
    triangle += push.first;
    vec3 light = weight.x * texelFetch(radiosity, int(triangle.x)).rgb
               + weight.y * texelFetch(radiosity, int(triangle.y)).rgb
               + weight.z * texelFetch(radiosity, int(triangle.z)).rgb;
#if PIXEL
    uvec2 chain = texelFetch(chains, int(push.cluster_first + first / WORKGROUP)).xy;
    if (chain.y > 0) {
        light = weight.x * texelFetch(soft, int(triangle.x)).rgb + weight.y * texelFetch(soft, int(triangle.y)).rgb
              + weight.z * texelFetch(soft, int(triangle.z)).rgb + pixel_light(chain);
    }
#endif
    color = vec4(finish(push.emission_white.rgb + light, push.emission_white.w), push.tag);
}
