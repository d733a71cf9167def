//! glTF files: scenes, motion, surfaces, what is refused, and the commands that take them.

mod allowed;
#[path = "../common/cli.rs"]
mod cli;
mod cli_of_gltf;
#[path = "../common/mod.rs"]
mod common;
#[cfg(feature = "decoders")]
mod compressed;
#[path = "../common/model.rs"]
mod model;
mod motion;
mod pieces;
mod poses;
mod refused;
mod scenes;
mod surface;
