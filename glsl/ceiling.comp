#version 460
#extension GL_EXT_control_flow_attributes : require
// Measures a device's peak rates, one kind of work per compilation. KIND 0: multiply-adds, 1 texels of four halves, 2
// texels of 16 bytes and 3 reads of 8 bytes from a storage block.
layout(local_size_x = 64) in;
layout(std430, binding = 1) buffer Out { vec4 results[]; };

#if KIND == 1
layout(binding = 0) uniform textureBuffer source;
#define READ(i) texelFetch(source, int(i))
#elif KIND == 2
layout(binding = 0) uniform utextureBuffer source;
#define READ(i) vec4(texelFetch(source, int(i)))
#elif KIND == 3
layout(std430, binding = 0) readonly buffer Source { uvec2 source[]; };
#define READ(i) vec4(source[i].xyxy)
#endif

void main() {
    uint index = gl_GlobalInvocationID.x;
    // Sixteen independent results, so that latency is hidden. None is equal to another or known when compiled, so that
    // each is computed.
    vec4 start = vec4(index, index + 1, index + 2, index + 3);
    vec4 sums[4] = vec4[](start, 0.25 * start, 0.5 * start, 0.75 * start);
    vec4 factor = 1.0 / (2.0 + start);
    uint at = index * 747796405u;
    uint round = 0;
    do {
#if KIND == 0
        [[unroll]] for (uint k = 0; k < READS; k++) {
            sums[k % 4] = sums[k % 4] * factor + start;
        }
#else
        // Runs of four texels at scattered addresses, as in a lookup's corners.
        [[unroll]] for (uint k = 0; k < READS / 4; k++) {
            at = at * 1664525u + 1013904223u;
            uint first = (at >> 8) & (MASK ^ 3u);
            sums[0] += READ(first);
            sums[1] += READ(first + 1);
            sums[2] += READ(first + 2);
            sums[3] += READ(first + 3);
        }
#endif
    } while (++round < ROUNDS);
    results[index] = sums[0] + sums[1] + sums[2] + sums[3];
}
