#version 460
// Transforms a corner of the strip around a line, which is the line moved by half a pixel up and down, or left and
// right.
layout(location = 0) in vec4 corner; // x, y in normalised device coordinates; depth of the line; offset from it in pixels
layout(location = 1) in vec3 mark;   // as in smooth.frag
layout(location = 0) out float line_depth;
layout(location = 1) out float offset;
layout(location = 2) flat out vec3 line_mark;

void main() {
    line_depth = corner.z;
    offset = corner.w;
    line_mark = mark;
    gl_Position = vec4(corner.xy, 0.5, 1.0);
}
