// What a sheet blocks, in closed form for up to four bands (src/sh/polygon.rs), and how far it counts.
#include "sheet.glsl"

const float HALF_ROOT = 0.70710678;

// The angle of (x, y) from the axis of x, for y >= 0. The polynomial is fitted, off by 2.5e-7 at most; Vulkan's own may
// be off by 2.4e-4 of the angle.
float angle_of(float y, float x) {
    float most = max(abs(x), y);
    float t = min(abs(x), y) / max(most, 1e-30);
    float s = t * t;
    float angle = t * (0.999996112 + s * (-0.333173681 + s * (0.198078157 + s * (-0.132333426
                + s * (0.079623681 + s * (-0.033604228 + s * 0.00681179573))))));
    angle = y > abs(x) ? 0.5 * PI - angle : angle;
    return x < 0.0 ? PI - angle : angle;
}

// Adds one side: `normal` is that of the plane through the point and the side, and points inwards; the side's ends
// together lie in direction `middle`; `sine` and `cosine` are those of the angle between them.
void add_side(vec3 normal, vec3 middle, float sine, float cosine, inout float b[COEFFICIENTS]) {
    float angle = angle_of(sine, cosine);
    // Of small angles the cosine is rounded to 1.
    float half_sine = cosine > 0.0 ? sine * inversesqrt(2.0 + 2.0 * cosine) : sqrt(0.5 - 0.5 * cosine);
    middle = normalize(middle);
    float of_normal[COEFFICIENTS], above[COEFFICIENTS], below[COEFFICIENTS];
    sh_basis(normal, of_normal);
    sh_basis(HALF_ROOT * (middle + normal), above);
    sh_basis(HALF_ROOT * (middle - normal), below);
    [[unroll]] for (uint k = 1; k < SHEET_COEFFICIENTS; k++) {
        float change = above[k] - below[k];
        b[k] += k < 4 ? 0.5 * angle * of_normal[k]
              : k < 9 ? half_sine / 3.0 * change
              : HALF_ROOT / 6.0 * sine * change - (0.125 * angle - sine / 24.0) * of_normal[k];
    }
}

void sheet_blocked(Sheet sheet, out float b[COEFFICIENTS]) {
    [[unroll]] for (uint k = 0; k < COEFFICIENTS; k++) {
        b[k] = 0.0;
    }
    float h = sheet.height;
    // Distances of the corners: low and high along the first axis, then along the second.
    vec4 corners = sqrt(sheet.to_ends.xyxy * sheet.to_ends.xyxy + sheet.ends.zzww * sheet.ends.zzww);
    float solid_angle = 0.0;
    [[unroll]] for (uint i = 0; i < 4; i++) {
        float outward = (i & 1) == 0 ? -1.0 : 1.0;
        bool first = i < 2;
        float end = sheet.ends[i], off = sheet.to_ends[i];
        vec3 across = sheet.axes[first ? 0 : 1], along = sheet.axes[first ? 1 : 0];
        float low = sheet.ends[first ? 2 : 0], high = sheet.ends[first ? 3 : 1];
        float to_low = corners[first ? i : 2 * i - 4], to_high = corners[first ? i + 2 : 2 * i - 3];
        vec3 normal = outward / off * (end * sheet.axes[2] - h * across);
        vec3 foot = end * across + h * sheet.axes[2];
        vec3 middle = (to_low + to_high) * foot + (low * to_high + high * to_low) * along;
        float per = 1.0 / (to_low * to_high);
        add_side(normal, middle, off * (high - low) * per, (off * off + low * high) * per, b);
        if (first) {
            // The solid angle between this side and the foot of the point's own height.
            float part = angle_of(abs(end) * h * (high * to_low - low * to_high), h * h * to_low * to_high + low * high * end * end);
            solid_angle += end < 0.0 ? -outward * part : outward * part;
        }
    }
    b[0] = Y00 * solid_angle;
}

float sheet_above_horizon(Sheet sheet, vec3 normal) {
#if SKIP_HORIZON
    vec3 n = normal * sheet.axes;
    vec2 highest = max(sheet.ends.xz * n.xy, sheet.ends.yw * n.xy);
    vec2 near = clamp(vec2(0.0), sheet.ends.xz, sheet.ends.yw);
    float nearest = length(vec3(near, sheet.height));
    return smoothstep(0.0, FADE_SINE, (highest.x + highest.y + sheet.height * n.z) / nearest);
#else
    return 1.0;
#endif
}

// How much of a sheet lies before a light: as far as the light's centre lies beyond its plane, less where the light
// stands beside it.
float sheet_before(Sheet sheet, Cone light, float inverse_radius) {
    vec3 along = light.toward * sheet.axes;
    float beyond = smoothstep(0.0, BEHIND_SHEET, (along.z * light.distance - sheet.height) * inverse_radius);
#if SKIP_CONES
    vec4 inside = inside_of(sheet, along);
    float least = min(min(inside.x, inside.y), min(inside.z, inside.w));
    beyond *= smoothstep(-light.sine - FADE_SINE, min(MEET_SINE - light.sine, 0.0), least);
#endif
    return beyond;
}
