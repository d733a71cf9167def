#version 460
// One cube face seen from a sample point. Faces are axis-aligned, so right, down and forward are signed unit vectors
// and the products below are exact.
layout(location = 0) in vec4 position; // in r
#if RADIANCE
layout(location = 1) in vec3 color;
layout(location = 0) out vec3 radiance;
#endif

layout(push_constant) uniform Push {
    vec4 eye;
    vec4 right;
    vec4 down;
    vec4 forward;
} push;

void main() {
    vec3 q = position.xyz - push.eye.xyz;
    float w = dot(push.forward.xyz, q);
    // Moves a vertex off the plane of the eye, where w is in r. To find a triangle's facing, SwiftShader divides by w
    // before it clips; it returns 1 for 1 / 0, and a huge quotient gives a wrong facing.
    if (abs(w) < 1e-6) {
        w = w < 0.0 ? -1e-6 : 1e-6;
    }
#if RADIANCE
    // Reversed depth w_near / w without a far plane; geometry closer than eye.w (in r) is clipped.
    float z = push.eye.w;
    radiance = color;
#else
    // No depth is kept: z = w / 2 passes every clip test in front of the eye, so no near plane cuts the object.
    float z = 0.5 * w;
#endif
    gl_Position = vec4(dot(push.right.xyz, q), dot(push.down.xyz, q), z, w);
}
