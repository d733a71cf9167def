#version 460
layout(location = 0) out float nearness;

void main() {
    nearness = gl_FragCoord.w; // 1 / distance along the view's axis
}
