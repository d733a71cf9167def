#version 460
// An occluder as a light sees it.
layout(location = 0) in vec3 position; // metres, of the mesh

layout(push_constant) uniform Push {
    mat4 to_view; // x and y from -w to w across the view, z the near distance, w the distance along the view's axis
} push;

void main() {
    gl_Position = push.to_view * vec4(position, 1.0);
}
