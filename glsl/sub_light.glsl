// A ball, a panel or a tube of light and its parts, four to a block. The twin is src/field/sub_light.rs.
#include "slabs.glsl"

struct SeenLight {
    vec3 toward;    // unit, to its centre
    vec3 across;    // unit axes at right angles to that
    vec3 down;
    float distance; // of its centre, metres
    float sine;     // of the angular radius of its bounding sphere
    float fine;     // share of the four fine blocks
#if OUTLINES && BOXES
    mat3 to_box;    // from the axes above to the light's own
    vec3 box[2];    // least and largest corner of the light, from its centre, metres; equal where they tell nothing
#endif
#if PANELS
    uint kind;
    float ratio;    // of a rectangle's edges, second over first
    vec3 facing;    // unit normal of a panel's side that shines, by the axes above
    mat2x3 half_edges; // from its middle to the middles of two edges, by the axes above, metres
    float area;     // square metres
#endif
};

struct Block {
    vec2 middle;  // 0 to 1 from the light's
    float scale;  // its size, of the light's
    float area;   // share of the light in each part
    float weight; // of this block beside those of another size
};

#if PANELS
// A tube is the rectangle about its axis that faces whoever sees it.
bool is_rectangle(SeenLight light) {
    return light.kind >= LIGHT_RECTANGLE;
}

bool is_panel(SeenLight light) {
    return light.kind == LIGHT_DISC || is_rectangle(light);
}

// Whether it is a rectangle so long that its parts lie in one row.
bool is_strip(SeenLight light) {
    return is_rectangle(light) && (light.ratio * STRIP < 1.0 || light.ratio > STRIP);
}
#endif

// `to`: vector to the centre.
SeenLight seen_light(vec3 to, Entity shining) {
    SeenLight light;
#if PANELS
    light.kind = shining.light_kind;
    light.ratio = shining.light_ratio;
    bool rectangle = is_rectangle(light), tube = light.kind >= LIGHT_TUBE, slat = tube && abs(shining.light_thin) < 1.0;
    vec2 radii = (rectangle ? shining.light_size * vec2(1.0, light.ratio) : vec2(sqrt(shining.light_size))) / shining.centre.w;
    vec3 axis = vec3(equal(uvec3(tube ? light.kind : LIGHT_TUBE), LIGHT_TUBE + uvec3(0, 1, 2)));
    vec3 length_axis = to_world(shining, axis), wide = to_world(shining, shining.light_thin < 0.0 ? axis.yzx : axis.zxy);
    vec3 flat_axis = cross(length_axis, wide);
    // Of a slat the chord of its section between the corners that are outermost from the point; beyond its ends, of which
    // more is seen then, one across the way to its middle.
    vec2 sides = radii.y * vec2(1.0, abs(shining.light_thin)), point = -vec2(dot(wide, to), dot(flat_axis, to));
    vec2 near = vec2(point.x < 0.0 ? -sides.x : sides.x, point.y < 0.0 ? -sides.y : sides.y);
    bvec2 beside_it = greaterThan(abs(point), sides);
    vec2 first = vec2(beside_it.y ? -near.x : near.x, near.y), last = vec2(near.x, beside_it.x ? -near.y : near.y);
    vec2 middle = 0.5 * (first + last), chord = 0.5 * (last - first);
    float off = max(length(point), 1e-30), beyond = clamp((abs(dot(length_axis, to)) - radii.x) / off, 0.0, 1.0);
    vec2 turned = vec2(-point.y, point.x) / off;
    turned *= dot(abs(turned), sides) * (dot(turned, chord) < 0.0 ? -1.0 : 1.0);
    middle *= 1.0 - beyond;
    chord = mix(chord, turned, beyond);
    to += slat ? middle.x * wide + middle.y * flat_axis : vec3(0.0);
    vec3 width_axis = chord.x * wide + chord.y * flat_axis;
#endif
    light.distance = length(to);
    // From its very centre it is seen above, as the twin has it.
    light.toward = light.distance > 0.0 ? to / light.distance : vec3(0.0, 1.0, 0.0);
    light.sine = min(1.0 / (shining.centre.w * max(light.distance, 1e-30)), MOST_SINE);
    vec3 across = cross(light.toward, vec3(TURNED_X, TURNED_Y, TURNED_Z));
    light.across = across / max(length(across), 1e-30);
    light.down = cross(light.toward, light.across);
    float limit = LIMIT_SINE;
#if OUTLINES
    // Four parts do not carry the outline of a mesh, but from afar its projected area tells its light.
    limit = shining.light_kind == LIGHT_OUTLINE ? LIMIT_OUTLINE : limit;
#endif
    light.fine = clamp((light.sine / limit - 1.0) / (BLEND - 1.0), 0.0, 1.0);
#if OUTLINES && BOXES
    light.to_box = mat3(to_object(shining, light.toward), to_object(shining, light.across), to_object(shining, light.down));
    light.box[0] = vec3(0.0);
    light.box[1] = vec3(0.0);
#endif
#if PANELS
    mat3 axes = mat3(light.toward, light.across, light.down);
    vec3 along = length_axis * axes, beside = cross(along, vec3(1.0, 0.0, 0.0));
    beside = slat ? width_axis * axes : tube ? beside : to_world(shining, vec3(0.0, 0.0, 1.0)) * axes;
    float seen = slat ? length(beside) / radii.y : 1.0;
    radii.y *= seen;
    light.ratio *= seen;
    beside = tube ? beside / max(length(beside), 1e-6 * sides.x) : beside;
    light.facing = tube ? cross(along, beside) : to_world(shining, vec3(0.0, 1.0, 0.0)) * axes;
    // Of two sides that shine, the one that is seen.
    light.facing *= (slat || light.kind == LIGHT_SHEET) && light.facing.x > 0.0 ? -1.0 : 1.0;
    light.half_edges[0] = radii.x * along;
    light.half_edges[1] = radii.y * beside;
    light.area = radii.x * radii.y * (rectangle ? 4.0 : PI);
#endif
    return light;
}

// The root of the share of a spot's light that shines this way, before it is held to 0 to 1; 1 of any other light.
float ramp_of(SeenLight light, Entity shining) {
    return -dot(to_world(shining, vec3(0.0, 1.0, 0.0)), light.toward) * shining.light_ramp.x + shining.light_ramp.y;
}

// Place of part k of a whole.
vec2 corner(SeenLight light, uint k) {
    vec2 place = (k & 1) == 0 ? vec2(CORNER, 0.0) : vec2(0.0, CORNER);
    place = (k & 2) == 0 ? place : -place;
#if PANELS
    if (is_rectangle(light)) {
        float along = 0.5 * float(k) - 0.75;
        place = vec2((k & 1) == 0 ? -0.5 : 0.5, (k & 2) == 0 ? -0.5 : 0.5);
        place = is_strip(light) ? (light.ratio < 1.0 ? vec2(along, 0.0) : vec2(0.0, along)) : place;
    }
#endif
    return place;
}

// Block 0 is the whole light, 1 to 4 are its quarters.
Block block_of(SeenLight light, uint b) {
    Block block;
    block.middle = vec2(0.0);
    block.scale = 1.0;
    block.area = 0.25;
    block.weight = 1.0 - light.fine;
    if (b > 0) {
        block.middle = corner(light, b - 1);
        block.scale = 0.5;
#if PANELS
        block.scale = is_strip(light) ? 0.25 : 0.5;
#endif
        block.area = 0.0625;
        block.weight = light.fine;
    }
    return block;
}

vec2 part_place(SeenLight light, Block block, uint k) {
    return block.middle + block.scale * corner(light, k);
}

// Cosine of the angle between the light's middle and a place on its disc.
float tilt_of(SeenLight light, vec2 place) {
    return sqrt(1.0 - light.sine * light.sine * dot(place, place));
}

// Unit direction of a place on the light, by the light's axes.
vec3 along_axes(SeenLight light, vec2 place) {
#if PANELS
    if (is_panel(light)) {
        vec3 to = vec3(light.distance, 0.0, 0.0) + light.half_edges * place;
        return to / max(length(to), 1e-30);
    }
#endif
    return vec3(tilt_of(light, place), light.sine * place);
}

// How far the light's surface is at a place, in direction `along`.
float reach_of(SeenLight light, vec2 place, vec3 along) {
#if PANELS
    if (is_panel(light)) {
        return length(vec3(light.distance, 0.0, 0.0) + light.half_edges * place);
    }
#endif
    float reach = light.distance * (along.x - light.sine * sqrt(1.0 - dot(place, place)));
#if OUTLINES && BOXES
    // A flat body lies behind most of its bounding sphere.
    vec3 direction = light.to_box * along;
    vec3 point = -light.distance * light.to_box[0];
    vec2 ends = slabs(light.box[0] - point, light.box[1] - point, direction);
    // One that misses the body passes it there, at the latest where it leaves the sphere.
    float passes = clamp(0.5 * (ends.x + ends.y), reach, light.distance * (1.0 + light.sine));
    bool tells = light.box[0].x < light.box[1].x;
    reach = tells ? max(reach, ends.x < ends.y ? ends.x : passes) : reach;
#endif
    return reach;
}

// Irradiance that a part sends to a surface that faces it, of radiance 1.
float part_light(SeenLight light, Block block, vec2 place, vec3 along) {
#if PANELS
    if (is_panel(light)) {
        float reach = reach_of(light, place, along), area = light.area * block.area;
        return area * max(-dot(light.facing, along), 0.0) / (reach * reach + area / PI);
    }
#endif
    return PI * light.sine * light.sine * block.area / along.x;
}

// Sine of a part's angular radius.
float part_sine(SeenLight light, Block block, vec2 place, vec3 along) {
#if PANELS
    if (is_panel(light)) {
        return min(sqrt(part_light(light, block, place, along) / PI), MOST_SINE);
    }
#endif
    return light.sine * sqrt(block.area);
}

// Mean of the cosine to a normal over a part, which the horizon may cut.
float part_cosine(float cosine, float sine) {
    float cut = clamp(cosine + sine, 0.0, 2.0 * sine);
    return cut * cut / max(4.0 * sine, 1e-30) + max(cosine - sine, 0.0);
}
