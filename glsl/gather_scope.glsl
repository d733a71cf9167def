// What a cluster of vertices, or a group of them, sees of spheres: src/render/scope.rs has the same functions and says why.
#include "repeatable.glsl"

const float EVERYTHING = 1e30;
const uint SKIPS_HORIZON = 1, SKIPS_CONES = 2, SKIPS_BEHIND = 4, SKIPS_FACING = 8, SKIPS_CAPS = 16;

// Places are world axes from the receiver's centre.
struct Scope {
    vec3 centre;
    float radius;
    vec3 axis;
    vec2 spread;
    vec3 origin;
    float reflectance;
};

precise vec2 turned(vec2 by, vec2 p) {
    precise vec2 q = vec2(by.x * p.x - by.y * p.y, by.y * p.x + by.x * p.y);
    return q;
}

precise vec3 turned_to_world(Entity entity, vec3 p) {
    precise vec3 q = p;
    q.xy = turned(entity.gamma, q.xy);
    q.zx = turned(entity.alpha_beta.zw, q.zx);
    q.xy = turned(entity.alpha_beta.xy, q.xy);
    return q;
}

Scope scope_of(Entity receiver, Bounds bounds) {
    float scale = receiver.albedo.w;
    precise vec3 scaled = bounds.sphere.xyz * scale;
    precise float radius = bounds.sphere.w * scale;
    return Scope(turned_to_world(receiver, scaled), radius, turned_to_world(receiver, bounds.cone.xyz),
        angle_of_cosine(bounds.cone.w), receiver.centre.xyz, receiver.emission.w);
}

precise float lobe(float cosine) {
    float c = max(cosine, 0.0);
    precise float l = 0.09375 + c * (0.5 + c * 0.46875);
    return max(c, l);
}

precise float weight_of(vec2 half_angle, float cosine) {
    precise float below = 1.0 + half_angle.x;
    precise float cap = 2.0 * half_angle.y * half_angle.y * inverse(below);
    precise float raised = cosine + SLACK_ANGLE;
    precise float weight = cap * lobe(min(raised, 1.0)) * SLACK;
    return weight;
}

bool negligible(Scope scope, float radiance) {
    precise float reflected = scope.reflectance * radiance;
    return reflected < eps;
}

struct View {
    vec3 to;
    float inverse_distance;
    float distance;
    vec2 spread;
    vec2 turn;
    bool outside;
    bool below;
    float weight;
    bool whole;
    bool cap;
};

precise vec3 way(Scope scope, vec3 place) {
    precise vec3 to = (place - scope.origin) - scope.centre;
    return to;
}

View view_of(Scope scope, vec4 sphere) {
    View view;
    view.to = way(scope, sphere.xyz);
    float square = max(sum_of_products(view.to, view.to), 1e-30);
    view.inverse_distance = inverse_root(square);
    precise float distance = square * view.inverse_distance;
    view.distance = distance;
    precise float cosine = sum_of_products(view.to, scope.axis) * view.inverse_distance;
    vec2 toward = angle_of_cosine(cosine);
    precise float turn = scope.radius * view.inverse_distance;
    view.turn = angle_of_sine(min(turn, 1.0));
    precise float highest = distance * cosine_less(toward, scope.spread) + scope.radius;
    precise float threshold = (sphere.w + FADE_SINE * (distance + scope.radius)) * BELOW;
    view.below = (switches & SKIPS_HORIZON) != 0 && highest < threshold;
    precise float nearest = distance - scope.radius;
    bool caps = (switches & SKIPS_CAPS) != 0;
    precise float large = CAP_SINE_LEAST * nearest;
    precise float small = CAP_SINE_MOST * (distance + scope.radius);
    view.whole = !caps || sphere.w > large;
    view.cap = caps && sphere.w < small;
    view.outside = nearest > max(sphere.w, 1e-15);
    precise float sine = sphere.w * inverse(max(nearest, 1e-15));
    vec2 half_angle = angle_of_sine(min(sine, 1.0));
    view.spread = plus(half_angle, view.turn);
    float weight = weight_of(half_angle, cosine_less(toward, plus(scope.spread, view.spread)));
    view.weight = view.outside ? weight : EVERYTHING;
    return view;
}

bool light_listed(Scope scope, vec4 facing, float radiance, View light) {
    precise float away = -sum_of_products(light.to, facing.xyz) * light.inverse_distance;
    bool elsewhere = (switches & SKIPS_FACING) != 0 && facing.w >= -1.0 && light.distance > scope.radius
        && away < plus(angle_of_cosine(facing.w), light.turn).x;
    precise float brings = radiance * light.weight;
    return !light.below && !elsewhere && !negligible(scope, brings);
}

bool apart(View a, View b) {
    precise float cosine = sum_of_products(a.to, b.to) * a.inverse_distance * b.inverse_distance;
    vec2 reach = plus(a.spread, plus(b.spread, vec2(FADE_COSINE_SLACK, FADE_SINE_SLACK)));
    return a.outside && b.outside && clamp(cosine, -1.0, 1.0) < reach.x;
}

// Of a chain with a light.
bool occluder_listed(Scope scope, View view, View light, float radiance) {
    precise float end = (light.distance + 2.0 * scope.radius) * SLACK;
    bool behind = (switches & SKIPS_BEHIND) != 0 && view.distance > end;
    bool aside = (switches & SKIPS_CONES) != 0 && apart(view, light);
    precise float takes = radiance * min(view.weight, light.weight);
    return !view.below && !behind && !aside && !negligible(scope, takes);
}

// Of the sky's chain.
bool occluder_listed(Scope scope, View view, float radiance) {
    precise float takes = radiance * view.weight;
    return !view.below && !negligible(scope, takes);
}

// At least the weight of every sphere of at most `radius` whose centre lies within `crowd.w` of `crowd.xyz`.
float crowd_weight(Scope scope, vec4 crowd, float radius) {
    vec3 to = way(scope, crowd.xyz);
    float square = max(sum_of_products(to, to), 1e-30);
    float inverse_distance = inverse_root(square);
    precise float blur = scope.radius + crowd.w;
    precise float nearest = square * inverse_distance - blur;
    if (nearest <= max(max(radius, scope.radius), 1e-15)) {
        return EVERYTHING;
    }
    precise float cosine = sum_of_products(to, scope.axis) * inverse_distance;
    float inverse_nearest = inverse(nearest);
    precise vec3 sines = vec3(radius * inverse_nearest, blur * inverse_distance, scope.radius * inverse_nearest);
    vec2 half_angle = angle_of_sine(min(sines.x, 1.0));
    vec2 reach = plus(half_angle, angle_of_sine(min(sines.z, 1.0)));
    reach = plus(plus(scope.spread, reach), angle_of_sine(min(sines.y, 1.0)));
    precise float weight = weight_of(half_angle, cosine_less(angle_of_cosine(cosine), reach)) * GROUP_SLACK;
    return weight;
}
