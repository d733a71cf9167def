//! The mathematics of spherical harmonics and cube faces, in f64.

mod basis;
mod cube;
mod lobe;
mod polygon;
mod product;
mod rotation;
