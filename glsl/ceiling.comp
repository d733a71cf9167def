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
    // Sixteen independent results, so that latency is hidden.
    vec4 sums[4] = vec4[](vec4(index), vec4(0.25), vec4(0.5), vec4(0.75));
    uint at = index * 747796405u;
    uint round = 0;
    do {
#if KIND == 0
        [[unroll]] for (uint k = 0; k < READS; k++) {
            sums[k % 4] = sums[k % 4] * 0.999 + 0.001;
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
