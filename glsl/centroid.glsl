// Inputs with `centroid` are interpolated within their triangle, where a pixel's centre may lie outside. Lavapipe
// (22.3) still multiplies them by the w of the centre. `one` is such an input that is 1 at every vertex: what this
// returns takes that out.
float within_triangle(float one) {
    return abs(one - 1.0) < 1e-5 ? 1.0 : 1.0 / one;
}
