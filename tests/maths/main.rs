//! Mathematics on the processor: spherical harmonics, lattices, lists of clusters, rays.

mod boxes;
mod chain;
#[path = "../common/mod.rs"]
mod common;
mod gather;
mod lattice;
mod sh;
mod truth;
