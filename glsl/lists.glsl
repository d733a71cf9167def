// The lists of all clusters: entries at binding 1, clusters at binding 2. They are the same for a whole workgroup. Software devices read a
// storage block lane by lane; texel reads are cheaper there.
#include "readable.glsl"
READ_UINT(1, Entries, entries, entry_at)
#if TEXEL
layout(binding = 2) uniform utextureBuffer clusters;
Cluster cluster_at(uint i) {
    int at = int(i) * 5;
    uvec2 pairs[5];
    [[unroll]] for (int k = 0; k < 5; k++) {
        pairs[k] = texelFetch(clusters, at + k).xy;
    }
    return Cluster(pairs[0].x, pairs[0].y, pairs[1].x, pairs[1].y, pairs[2].x, pairs[2].y, pairs[3].x, pairs[3].y, pairs[4].x,
        pairs[4].y);
}
#else
layout(std430, binding = 2) readonly buffer Clusters { Cluster clusters[]; };
Cluster cluster_at(uint i) {
    return clusters[i];
}
#endif
