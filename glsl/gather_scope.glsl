// The rule that keeps an entity off a cluster's list, in f32: src/lists/scope.rs has the same functions in f64 and says why.

struct Scope {
    vec3 origin;  // centre of the receiver, world
    vec3 centre;  // of the cluster, from there
    float radius; // metres
    vec3 axis;
    vec2 spread;
    float reflectance;
    float slack;
};

// Angles from 0 to pi: x the cosine, y the sine.
vec2 angle_of_sine(float sine) {
    float s = min(sine, 1.0);
    return vec2(sqrt((1.0 - s) * (1.0 + s)), s);
}

vec2 angle_of_cosine(float cosine) {
    float c = clamp(cosine, -1.0, 1.0);
    return vec2(c, sqrt((1.0 - c) * (1.0 + c)));
}

vec2 plus(vec2 a, vec2 b) {
    vec2 sum = vec2(a.x * b.x - a.y * b.y, max(a.y * b.x + a.x * b.y, 0.0));
    return a.x + b.x < 0.0 ? vec2(-1.0, 0.0) : sum;
}

float cosine_less(vec2 a, vec2 b) {
    return a.x >= b.x ? 1.0 : dot(a, b);
}

Scope scope_of(Entity receiver, Bounds bounds, float slack) {
    float scale = receiver.albedo.w;
    return Scope(receiver.centre.xyz, to_world(receiver, bounds.sphere.xyz * scale), bounds.sphere.w * scale,
        to_world(receiver, bounds.cone.xyz), angle_of_cosine(bounds.cone.w), receiver.emission.w, slack);
}

float weight_of(vec2 half_angle, float cosine) {
    float c = max(cosine, 0.0);
    float lobe = max(c, COSINE_LOBE.x + c * (COSINE_LOBE.y + c * COSINE_LOBE.z));
    return 2.0 * half_angle.y * half_angle.y / (1.0 + half_angle.x) * lobe;
}

bool negligible(Scope scope, float radiance) {
    return scope.reflectance * radiance < eps;
}

struct View {
    vec3 toward;
    float nearest;
    float farthest;
    float radius; // of the sphere
    vec2 spread;
    vec2 turn;
    bool outside;
    bool below;
    float weight;
    bool whole;
    bool cap;
};

View view_of(Scope scope, vec4 sphere) {
    vec3 to = (sphere.xyz - scope.origin) - scope.centre;
    float distance = max(length(to), 1e-15);
    float radius = scope.radius + scope.slack * distance;
    View view;
    view.toward = to / distance;
    view.nearest = distance - radius;
    view.farthest = distance + radius;
    view.radius = sphere.w;
    vec2 from_axis = angle_of_cosine(dot(view.toward, scope.axis));
    view.turn = angle_of_sine(radius / distance);
    float highest = distance * cosine_less(from_axis, scope.spread) + radius;
    view.below = (switches & SKIP_HORIZON) != 0 && highest < -(sphere.w + FADE_SINE * view.farthest);
    view.outside = view.nearest > sphere.w;
    vec2 half_angle = angle_of_sine(sphere.w / max(view.nearest, 1e-15));
    view.spread = plus(half_angle, view.turn);
    float weight = weight_of(half_angle, cosine_less(from_axis, plus(scope.spread, view.spread)));
    view.weight = view.outside ? weight : EVERYTHING;
    bool caps = (switches & SKIP_CAPS) != 0;
    view.whole = !caps || sphere.w > CAP_SINE_LEAST * view.nearest;
    view.cap = caps && sphere.w < CAP_SINE_MOST * view.farthest;
    return view;
}

bool light_listed(Scope scope, vec4 facing, float radiance, View light) {
    bool elsewhere = facing.w >= -1.0 && light.nearest > 0.0
        && -dot(light.toward, facing.xyz) < plus(angle_of_cosine(facing.w), light.turn).x;
    return !light.below && !elsewhere && !negligible(scope, radiance * light.weight);
}

bool apart(View a, View b, vec2 fade) {
    vec2 reach = plus(a.spread, plus(b.spread, fade));
    return a.outside && b.outside && dot(a.toward, b.toward) < reach.x;
}

// Whether an occluder is listed in the chain of a light.
bool occluder_listed(Scope scope, View view, View light, bool sharp, float radiance) {
    bool behind = (switches & SKIP_BEHIND) != 0 && view.nearest - (sharp ? view.radius : 0.0) > light.farthest;
    vec2 fade = sharp ? vec2(1.0, 0.0) : vec2(FADE_COSINE, FADE_SINE);
    bool aside = (switches & SKIP_CONES) != 0 && apart(view, light, fade);
    return !view.below && !behind && !aside && !negligible(scope, radiance * min(view.weight, light.weight));
}

// Whether an occluder is listed in the chain of the sky.
bool occluder_listed(Scope scope, View view, float radiance) {
    return !view.below && !negligible(scope, radiance * view.weight);
}

// Whether no sphere of at most `largest` whose centre lies within `crowd.w` of `crowd.xyz` matters to a cluster within the bounds.
bool leaves_out(Scope scope, vec4 crowd, float largest) {
    vec3 to = (crowd.xyz - scope.origin) - scope.centre;
    float distance = max(length(to), 1e-15);
    float radius = scope.radius + scope.slack * distance;
    float blur = radius + crowd.w;
    float nearest = distance - blur;
    if (nearest <= max(largest, radius)) {
        return negligible(scope, EVERYTHING * brightest);
    }
    vec2 turn = plus(angle_of_sine(radius / nearest), angle_of_sine(blur / distance));
    vec2 half_angle = angle_of_sine(largest / nearest);
    vec2 from_axis = angle_of_cosine(dot(to, scope.axis) / distance);
    float weight = weight_of(half_angle, cosine_less(from_axis, plus(scope.spread, plus(half_angle, turn))));
    return negligible(scope, weight * brightest);
}
