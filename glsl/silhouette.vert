#version 460
// An object as parallel light of one direction sees it.
layout(location = 0) in vec3 position;
layout(location = 0) out float depth;

layout(push_constant) uniform Push {
    vec4 across;    // along x: from a position to the rectangle's -1..1
    vec4 down;      // along y
    vec4 direction; // unit, of the light; w: 0 shows the whole object, 1 what lies beyond the centre, -1 what lies before it
} push;

void main() {
    depth = dot(push.direction.xyz, position);
    // No depth is tested; what lies between 0 and 1 passes the clip test.
    float clipped = push.direction.w == 0.0 ? 0.5 : 0.5 * push.direction.w * depth;
    gl_Position = vec4(dot(push.across.xyz, position) + push.across.w, dot(push.down.xyz, position) + push.down.w, clipped, 1.0);
}
