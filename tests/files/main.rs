//! What is read, kept and generated on the CPU: meshes, scenes, fields, pictures.

#[path = "../common/mod.rs"]
mod common;
mod field_file;
mod flip;
#[path = "../common/generate.rs"]
mod generate;
mod mesh;
mod picture;
mod properties;
mod scene;
