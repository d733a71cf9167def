//! The source tree, its pages and scripts.

#[path = "../common/mod.rs"]
mod common;
mod expect;
mod features;
mod layers;
mod pages;

fn root() -> &'static std::path::Path {
    std::path::Path::new(env!("CARGO_MANIFEST_DIR"))
}
