// IEC 61966-2-1, white at 1.
//
// x^(1/2.4) is s^(5/6) for s = sqrt(x). The polynomial in s is wrong by at most 3.3e-4, a twelfth of a step of 8 bits
// (Remez, from the end of the straight piece to 1). llvmpipe computes it in about half of the time of `pow`.
vec3 srgb_from_linear(vec3 linear) {
    vec3 s = sqrt(linear);
    vec3 curve = -0.0401096 + s * (1.5179504 + s * (-1.4027355 + s * (2.0315754 + s * (-1.6236616 + s * 0.5173047))));
    return mix(curve, 12.92 * linear, lessThanEqual(linear, vec3(0.0031308)));
}
