//! What is read, kept and generated on the CPU: meshes, scenes, fields, pictures.

mod bad_data;
mod bad_input;
#[path = "../common/mod.rs"]
mod common;
mod environment;
mod field_file;
mod flip;
mod lookups;
mod mesh;
mod picture;
mod scene;
