#version 460
#extension GL_EXT_samplerless_texture_functions : require
// Smooths a pixel whose centre lies within half a pixel of a line, along x or y: the colour of the pixel on the line's
// other side is blended in by the share of the pixel that the line cuts off.
layout(binding = 0) uniform texture2D picture; // alpha: tag of the entity seen
layout(binding = 1) uniform texture2D depth;   // reversed: greater is nearer, 0 infinitely far
layout(location = 0) in float line_depth;
layout(location = 1) in float offset;         // from the line to the pixel's centre, in pixels
layout(location = 2) flat in vec3 line_mark;  // side of the surface, +1 or -1; 1 for offsets along x, 0 along y; tag
layout(location = 0) out vec4 color;

layout(push_constant) uniform Push {
    ivec4 area; // pixels that may be read: from x, y, to x, y
} push;

vec4 picture_at(ivec2 pixel) {
    return texelFetch(picture, clamp(pixel, push.area.xy, push.area.zw), 0);
}

// Whether a pixel shows the line's entity.
bool shows(vec4 texel) {
    return abs(texel.a - line_mark.z) < 0.5 * TAG_STEP;
}

float depth_at(ivec2 pixel) {
    return texelFetch(depth, clamp(pixel, push.area.xy, push.area.zw), 0).r;
}

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    ivec2 across = (line_mark.y > 0.5 ? ivec2(1, 0) : ivec2(0, 1)) * (offset > 0.0 ? -1 : 1);
    bool inside = offset * line_mark.x > 0.0;
    vec4 own = texelFetch(picture, pixel, 0);
    vec4 beyond = picture_at(pixel + across);
    // The rasteriser snaps corners, so a pixel centre close to the line may be rasterised on its other side.
    vec4 opposite = picture_at(pixel - across);
    if (abs(offset) < SNAPPED && shows(own) == shows(beyond) && shows(own) != shows(opposite)) {
        across = -across;
        inside = !inside;
        beyond = opposite;
    }
    ivec2 other = clamp(pixel + across, push.area.xy, push.area.zw);
    ivec2 outer = inside ? other : pixel;
    ivec2 outwards = inside ? across : -across;

    if (!shows(inside ? own : beyond)) {
        discard; // something hides the surface
    }
    // Depth of the outer side at the line: that of the pixel's centre, or its slope extrapolated to the line.
    float behind = depth_at(outer);
    float slope = behind - depth_at(outer + outwards);
    float reach = inside ? 1.0 - abs(offset) : abs(offset);
    if (min(behind, behind + slope * reach) > line_depth * (1.0 + TOLERANCE)) {
        discard; // something hides the line
    }
    float share = 0.5 - abs(offset);
    color = vec4(mix(own.rgb, beyond.rgb, share), 1.0);
}
