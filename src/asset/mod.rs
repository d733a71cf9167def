//! What comes from outside: triangle meshes, distant light and pictures.
//!
//! Everything read from a file is checked here, once: the modules below may trust a [`mesh::Mesh`] to be finite, indexed
//! within range and of positive size.

pub mod embedded;
pub mod enclose;
pub mod environment;
pub mod generate;
pub mod mesh;
pub mod obj;
pub mod picture;
pub mod teapot;
pub mod topology;

pub use mesh::Mesh;
