// All clusters, at CLUSTER_BINDING. They are the same for a whole workgroup. Software devices read a storage block lane by
// lane; texel reads are cheaper there.
#if TEXEL
layout(binding = CLUSTER_BINDING) uniform utextureBuffer clusters;
#include "generated/cluster_at.glsl"
#else
layout(std430, binding = CLUSTER_BINDING) readonly buffer Clusters { Cluster clusters[]; };
Cluster cluster_at(uint i) {
    return clusters[i];
}
#endif
