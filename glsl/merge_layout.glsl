// What merge and sharp read besides fields. Entity and Cluster are the structs of src/layout.rs.
#include "generated/structs.glsl"

// The rotation that a cosine and sine stand for, applied to two coordinates, and its inverse.
vec2 turn(vec2 turned_by, vec2 p) {
    return vec2(turned_by.x * p.x - turned_by.y * p.y, turned_by.y * p.x + turned_by.x * p.y);
}
vec2 turn_back(vec2 turned_by, vec2 p) {
    return vec2(turned_by.x * p.x + turned_by.y * p.y, turned_by.x * p.y - turned_by.y * p.x);
}
vec3 to_world(Entity entity, vec3 p) {
    p.xy = turn(entity.gamma, p.xy);
    p.zx = turn(entity.alpha_beta.zw, p.zx);
    p.xy = turn(entity.alpha_beta.xy, p.xy);
    return p;
}
vec3 to_object(Entity entity, vec3 p) {
    p.xy = turn_back(entity.alpha_beta.xy, p.xy);
    p.zx = turn_back(entity.alpha_beta.zw, p.zx);
    p.xy = turn_back(entity.gamma, p.xy);
    return p;
}

// A place (object's frame, in r) in the space of the object's lattice. The stretch of each axis is 1 and 64ths, 0 to 64
// of them, of which seven bits an axis make one whole number.
vec3 to_lattice(Entity entity, vec3 p) {
    uint packed = uint(entity.shift.w);
    vec3 sixty_fourths = vec3(packed & 127u, packed >> 7 & 127u, packed >> 14 & 127u);
    return p + p * sixty_fourths / 64.0 + entity.shift.xyz;
}

// 1 where the samples of the object's lattice lie on the edges of a cube's faces, 0 where they are cells' centres: the
// bit above.
float lattice_edges(Entity entity) {
    return float(uint(entity.shift.w) >> FIT_BITS);
}

// An entry: what one lookup is for, as ListEntry::pack puts it together. The first ENTRY_BITS bits: entity, or of a sharp
// light how many entries of its chain stand before it. As many more: the light whose chain this is, SKY_CHAIN for the
// sky's.
const uint SKY_CHAIN = (1u << ENTRY_BITS) - 1u;
const uint ENTRY_LIGHT = 1u << 2 * ENTRY_BITS;      // meets the light rather than multiplying an occluder
const uint ENTRY_CHANNEL = 2 * ENTRY_BITS + 1;      // two bits: 0 to 2 for a channel of a radiance field, 3 for a light of one colour
const uint ENTRY_LAST = 1u << 2 * ENTRY_BITS + 3;   // ends the chain: the next entry begins anew from the transfer
// Without ENTRY_LIGHT, in place of a channel:
const uint ENTRY_CAP = 1u;    // an occluder as a cap
const uint ENTRY_SHEET = 2u;  // an occluder that is a sheet
const uint ENTRY_VOLUME = 3u; // all that rests
const uint ENTRY_CUBOID = 4u; // an occluder that is a box, before a sharp light
const uint ENTRY_GLOBE = 5u;  // a closed surface around a sharp light

bool is_kind(uint packed, uint kind) {
    return (packed & (ENTRY_LIGHT | 7u << ENTRY_CHANNEL)) == kind << ENTRY_CHANNEL;
}
