// Roots, quotients and angles whose bits are the same on every device: see src/render/repeatable.rs, which has the same functions.

precise float inverse_root(float x) {
    precise float h = 0.5 * x;
    precise float y = uintBitsToFloat(0x5f3759dfu - (floatBitsToUint(x) >> 1));
    y = y * (1.5 - h * y * y);
    y = y * (1.5 - h * y * y);
    y = y * (1.5 - h * y * y);
    return y;
}

precise float root(float x) {
    precise float at = max(x, 1e-30);
    precise float y = at * inverse_root(at);
    return at > 1e-30 ? y : 0.0;
}

precise float inverse(float x) {
    precise float r = inverse_root(x);
    precise float y = r * r;
    y = y * (2.0 - x * y);
    return y;
}

precise float sum_of_products(vec3 a, vec3 b) {
    precise float sum = a.x * b.x + a.y * b.y + a.z * b.z;
    return sum;
}

// Angles from 0 to pi: x the cosine, y the sine.
precise vec2 angle_of_sine(float sine) {
    precise float square = (1.0 - sine) * (1.0 + sine);
    return vec2(root(square), sine);
}

precise vec2 angle_of_cosine(float cosine) {
    precise float c = clamp(cosine, -1.0, 1.0);
    precise float square = (1.0 - c) * (1.0 + c);
    return vec2(c, root(square));
}

precise vec2 plus(vec2 a, vec2 b) {
    precise float sine = a.y * b.x + a.x * b.y;
    precise float cosine = a.x * b.x - a.y * b.y;
    precise float both = a.x + b.x; // 2 cos((a + b) / 2) cos((a - b) / 2)
    return both < 0.0 ? vec2(-1.0, 0.0) : vec2(cosine, max(sine, 0.0));
}

precise float cosine_less(vec2 a, vec2 b) {
    precise float cosine = a.x * b.x + a.y * b.y;
    return a.x >= b.x ? 1.0 : cosine;
}
