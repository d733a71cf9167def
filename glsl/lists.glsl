// The lists of all clusters: entries at binding 1, clusters at binding 2.
#include "readable.glsl"
READ_UINT(1, Entries, entries, entry_at)
#define CLUSTER_BINDING 2
#include "clusters.glsl"
