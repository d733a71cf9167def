// Holes of a surface: places whose alpha is below a cutoff. With several samples a pixel, as many are covered as the
// place is far from the hole's edge.
void cut_holes(float alpha, float cutoff) {
#if SAMPLES > 1
    float change = fwidth(alpha);
    float covered = cutoff > 0.0 ? clamp((alpha - cutoff + 1e-4) / max(change, 1e-4) + 0.5, 0.0, 1.0) : 1.0;
    int count = int(covered * float(SAMPLES) + 0.5);
    gl_SampleMask[0] = (1 << count) - 1;
    if (count == 0) {
        discard;
    }
#else
    if (alpha < cutoff) {
        discard;
    }
#endif
}
