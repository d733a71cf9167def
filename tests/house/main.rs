//! The source tree, its pages and scripts.

mod expect;
mod features;
mod layers;
mod pages;

fn root() -> &'static std::path::Path {
    std::path::Path::new(env!("CARGO_MANIFEST_DIR"))
}
