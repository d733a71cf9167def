// The lists of all clusters: entries at binding 1, clusters at binding 2. They are the same for a whole workgroup.
// Software devices read a storage block lane by lane; texel reads are cheaper there.
#include "readable.glsl"
READ_UINT(1, Entries, entries, entry_at)
#if TEXEL
layout(binding = 2) uniform utextureBuffer clusters;
#include "generated/cluster_at.glsl"
#else
layout(std430, binding = 2) readonly buffer Clusters { Cluster clusters[]; };
Cluster cluster_at(uint i) {
    return clusters[i];
}
#endif
