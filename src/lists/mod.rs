//! Cluster lists: which entities concern which cluster of 64 vertices, and which clusters have to be merged again.

pub mod far;
pub mod gather;
pub mod incremental;
pub mod scene_bounds;
pub mod scope;
pub mod sight;
pub mod skip;
pub mod tree;
