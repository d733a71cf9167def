// Area of a unit disc on one side of a straight edge, over pi: x is the signed distance of the disc's centre from the
// edge in radii, positive on the side that counts. The twin is blocked_share in src/field/silhouette.rs, 1/2 + (x
// sqrt(1 - x x) + asin x) / pi. The rest of the disc shrinks as the power 3/2 of what is left to the rim, t, times a
// polynomial that is fitted here: wrong by 2.0e-6 at most.
float blocked_share(float x) {
    float t = 1.0 - min(abs(x), 1.0);
    float rest = t * sqrt(t) * (0.60034857 + t * (-0.09104316 + t * (-0.00565620 - t * 0.00364921)));
    return x > 0.0 ? 1.0 - rest : rest;
}
