// A texture where a pixel covers more of it along one way than across: the mean of places along that way, each at the
// level that suits the width across.
const float MOST_TAPS = 8.0;
// How many levels finer: bilinear sampling blurs by two texels.
const float FINER = 0.5;

vec4 textured(sampler2D picture, vec2 uv) {
    vec2 size = vec2(textureSize(picture, 0));
    vec2 along_x = dFdx(uv), along_y = dFdy(uv);
    vec2 x = size * along_x, y = size * along_y; // texels
    float square = max(max(dot(x, x), dot(y, y)), 1.0);
    float area = max(abs(x.x * y.y - x.y * y.x), 1.0);
    float taps = clamp(ceil(square / area - 0.5), 1.0, MOST_TAPS);
    float level = 0.5 * log2(square) - log2(taps) - FINER;
    vec2 way = (dot(x, x) > dot(y, y) ? along_x : along_y) / taps;
    vec2 first = uv - 0.5 * (taps - 1.0) * way;
    // Lanes leave this loop one by one; on llvmpipe its sums are those of a loop of all taps, to the bit.
    vec4 sum = vec4(0.0);
    float i = 0.0;
    do {
        sum += textureLod(picture, first + i * way, level);
        i++;
    } while (i < taps);
    return sum / taps;
}
