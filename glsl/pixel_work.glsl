// Places whose light pass "pixel light" evaluates, of the coarse ones first and of pixels then: PixelWork of
// src/draw/pixel_light.rs. What includes this defines WORK_BLOCK, its binding and use.
struct PixelStep {
    uint groups[3]; // of 64 places: in rows of MOST_GROUPS
    uint count;
};
const uint MOST_GROUPS = 65535; // that every device runs along an axis

WORK_BLOCK Work {
    uint total;
    uint spare[3];
    PixelStep steps[2];
    uint places[];
} work;
