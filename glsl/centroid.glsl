// Inputs with `centroid` are interpolated within their triangle, where a pixel's centre may lie outside. Lavapipe
// (22.3) still multiplies them by the w of the centre. `one` is such an input that is 1 at every vertex: what this
// returns takes that out. Places within pictures are taken at the centre of the pixel instead: from pixel to pixel
// lavapipe puts a centroid elsewhere, even far from edges, so that textures looked torn.
float within_triangle(float one) {
    return abs(one - 1.0) < 1e-5 ? 1.0 : 1.0 / one;
}
