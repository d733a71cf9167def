// Places whose light pass "pixel light" evaluates, of the coarse ones first and of pixels then: PixelWork of
// src/draw/pixel_light.rs.
struct PixelStep {
    uint groups[3]; // of 64 places, in x
    uint count;
};

// Texel of a place in a buffer of light, behind its size.
uint texel_of(uvec2 at, uint width) {
    return 1 + at.y * width + at.x;
}
