#version 460
#extension GL_EXT_samplerless_texture_functions : require
// Adds the light of one ball to every given point, shadowed through a map of the occluders that is drawn from the
// ball's centre: by a single comparison (TAPS 0), or by percentage-closer soft shadows, Fernando, "Percentage-Closer
// Soft Shadows" (SIGGRAPH 2005).

layout(local_size_x = 64) in;

layout(binding = 0) uniform texture2D nearness; // views of MAP texels, up to three beside each other
layout(std430, binding = 1) readonly buffer Vertices { vec4 vertices[]; }; // position and entity; normal and offset; albedo
layout(std430, binding = 2) buffer Radiosity { vec4 radiosity[]; };

layout(push_constant) uniform Push {
    vec4 light;    // centre and radius, metres
    vec4 radiance; // linear RGB; the light's entity
    vec4 right;    // of the only view; tangent of half the angle across it
    vec4 down;     // of the only view; distance of the nearest occluder, metres
    vec4 forward;  // of the only view
    uint vertex_count;
    uint view_count; // 1, or 6 for the faces of a cube
    uint is_first;   // whether nothing has been added yet
} push;


// Where the map has an occluder along a vector from the light, as a share of the vector. The texel knows its own centre
// only, so the vector is moved there.
float met(inout vec3 vector) {
    vec3 right = push.right.xyz;
    vec3 down = push.down.xyz;
    vec3 forward = push.forward.xyz;
    float slope = push.right.w;
    int face = 0;
    if (push.view_count > 1) {
        vec3 size = abs(vector);
        int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
        bool behind = vector[axis] < 0.0;
        right = vec3(axis == 2, axis == 0, axis == 1);
        down = vec3(axis == 1, axis == 2, axis == 0);
        forward = vec3(axis == 0, axis == 1, axis == 2) * (behind ? -1.0 : 1.0);
        slope = 1.0;
        face = 2 * axis + int(behind);
    }
    float along = dot(forward, vector);
    vec2 place = vec2(dot(right, vector), dot(down, vector)) / (max(along, 1e-20) * slope);
    if (along <= 0.0 || max(abs(place.x), abs(place.y)) > 1.0) {
        return EVERYTHING;
    }
    ivec2 texel = clamp(ivec2((place * 0.5 + 0.5) * float(MAP)), 0, MAP - 1);
    vec2 middle = (vec2(texel) + 0.5) * (2.0 / float(MAP)) - 1.0;
    vector = along * (forward + slope * (middle.x * right + middle.y * down));
    float found = texelFetch(nearness, texel + MAP * ivec2(face % 3, face / 3), 0).r;
    return found > 0.0 ? 1.0 / (found * along) : EVERYTHING;
}

// Where an occluder lies on the way from the light to the receiver's plane, as a share of the way; EVERYTHING behind
// the plane.
float occluder(vec3 vector, vec3 to_vertex, vec3 normal) {
    float share = met(vector);
    float facing = dot(normal, vector);
    float plane = facing < -1e-3 * length(vector) ? dot(normal, to_vertex) / facing : 1.0;
    // Texels are compared at their centres. This allows for the curvature of a surface within a
    // texel.
    float bias = 1e-3 + push.right.w / float(MAP);
    return share < plane * (1.0 - bias) ? share / plane : EVERYTHING;
}

#if TAPS > 0
// Points of even density on the unit disc, by the golden angle (Vogel 1979).
vec2 disc(int i, int count) {
    float angle = 2.3999632 * float(i);
    return sqrt((float(i) + 0.5) / float(count)) * vec2(cos(angle), sin(angle));
}
#endif

float visibility(vec3 to_vertex, vec3 normal) {
#if TAPS == 0
    return occluder(to_vertex, to_vertex, normal) < EVERYTHING ? 0.0 : 1.0;
#else
    float distance = length(to_vertex);
    vec3 axis = to_vertex / distance;
    vec3 across = normalize(abs(axis.y) < 0.7 ? vec3(axis.z, 0.0, -axis.x) : vec3(0.0, -axis.z, axis.y));
    vec3 beside = cross(axis, across);
    float nearest = push.down.w;
    float reach = min(push.light.w * max(distance - nearest, 0.0) / nearest, 0.5 * distance);
    float sum = 0.0;
    float count = 0.0;
    for (int i = 0; i < SEARCHES; i++) {
        vec2 at = reach * disc(i, SEARCHES);
        float share = occluder(to_vertex + at.x * across + at.y * beside, to_vertex, normal);
        if (share < EVERYTHING) {
            sum += share;
            count += 1.0;
        }
    }
    if (count == 0.0) {
        return 1.0;
    }
    float share = sum / count;
    float width = min(push.light.w * (1.0 - share) / share, reach);
    float seen = 0.0;
    for (int i = 0; i < TAPS; i++) {
        vec2 at = width * disc(i, TAPS);
        seen += occluder(to_vertex + at.x * across + at.y * beside, to_vertex, normal) < EVERYTHING ? 0.0 : 1.0;
    }
    return seen / float(TAPS);
#endif
}

// Irradiance of a ball of radiance 1 / pi whose centre is seen under a cosine, `ratio` radii away, cut by the horizon:
// Lagarde and de Rousiers, "Moving Frostbite to Physically Based Rendering" (2014), section 4.7.2.
float irradiance(float cosine, float ratio) {
    if (ratio <= 1.0) {
        return 1.0; // within the ball
    }
    if (cosine * ratio >= 1.0) {
        return cosine / (ratio * ratio);
    }
    if (cosine * ratio <= -1.0) {
        return 0.0;
    }
    float sine = sqrt(max(1.0 - cosine * cosine, 1e-12));
    float rim = sqrt(ratio * ratio - 1.0);
    float cut = clamp(-rim * cosine / sine, -1.0, 1.0);
    float edge = sine * sqrt(1.0 - cut * cut);
    return ((cosine * acos(cut) - rim * edge) / (ratio * ratio) + atan(edge / rim)) / PI;
}

void main() {
    uint vertex = gl_GlobalInvocationID.x;
    if (vertex >= push.vertex_count) {
        return;
    }
    vec4 position = vertices[3 * vertex];
    vec4 offset = vertices[3 * vertex + 1];
    vec3 normal = offset.xyz;
    vec3 to_vertex = position.xyz - push.light.xyz;
    float distance = length(to_vertex);
    float cosine = -dot(normal, to_vertex) / max(distance, 1e-20);
    float light = position.w == push.radiance.w ? 0.0 : irradiance(cosine, distance / push.light.w);
    vec3 added = vec3(0.0);
    if (light > 0.0) {
        added = light * visibility(to_vertex + offset.w * normal, normal) * push.radiance.rgb * vertices[3 * vertex + 2].rgb;
    }
    radiosity[vertex] = vec4(added, 0.0) + (push.is_first != 0 ? vec4(0.0) : radiosity[vertex]);
}
