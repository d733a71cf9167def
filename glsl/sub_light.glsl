// A round light and its parts, four to a block. The twin is src/field/sub_light.rs.

struct SeenLight {
    vec3 toward;    // unit, to its centre
    vec3 across;    // unit axes at right angles to that
    vec3 down;
    float distance; // of its centre, metres
    float sine;     // of its angular radius
    float fine;     // share of the four fine blocks
};

struct Block {
    vec2 middle;  // on a disc of radius 1
    float radius; // on that disc
    float weight; // of a part: irradiance that it sends to a surface that faces it, times its tilt, of radiance 1
    float sine;   // of a part's angular radius
};

// `to`: vector to the centre.
SeenLight seen_light(vec3 to, float radius) {
    SeenLight light;
    light.distance = length(to);
    // From its very centre it is seen above, as the twin has it.
    light.toward = light.distance > 0.0 ? to / light.distance : vec3(0.0, 1.0, 0.0);
    light.sine = min(radius / max(light.distance, 1e-30), MOST_SINE);
    vec3 across = cross(light.toward, vec3(TURNED_X, TURNED_Y, TURNED_Z));
    light.across = across / max(length(across), 1e-30);
    light.down = cross(light.toward, light.across);
    light.fine = clamp((light.sine / LIMIT_SINE - 1.0) / (BLEND - 1.0), 0.0, 1.0);
    return light;
}

// Corner k of the square around the middle of a disc of radius 1.
vec2 corner(uint k) {
    float reach = (k & 2) == 0 ? CORNER : -CORNER;
    return (k & 1) == 0 ? vec2(reach, 0.0) : vec2(0.0, reach);
}

// Block 0 is the whole light, 1 to 4 are lights of half its radius.
Block block_of(SeenLight light, uint b) {
    Block block;
    block.middle = b == 0 ? vec2(0.0) : corner(b - 1);
    block.radius = b == 0 ? 1.0 : 0.5;
    block.sine = 0.5 * light.sine * block.radius;
    block.weight = 3.14159265 * light.sine * light.sine * (b == 0 ? 0.25 * (1.0 - light.fine) : 0.0625 * light.fine);
    return block;
}

// Cosine of the angle between the light's middle and a place on its disc.
float tilt_of(SeenLight light, vec2 place) {
    return sqrt(1.0 - light.sine * light.sine * dot(place, place));
}

// Direction of a place on the light's disc, by the light's axes.
vec3 along_axes(SeenLight light, vec2 place) {
    return vec3(tilt_of(light, place), light.sine * place);
}

vec2 part_place(Block block, uint k) {
    return block.middle + block.radius * corner(k);
}

// Mean of the cosine to a normal over a part, which the horizon may cut.
float part_cosine(float cosine, float sine) {
    float cut = clamp(cosine + sine, 0.0, 2.0 * sine);
    return cut * cut / max(4.0 * sine, 1e-30) + max(cosine - sine, 0.0);
}
