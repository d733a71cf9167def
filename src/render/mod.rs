//! The passes of a frame, one file each.

pub mod calibrate;
pub mod chain;
pub mod draw;
pub mod gather;
pub mod grid;
pub mod merge;
pub mod moment;
pub mod product;
pub mod reference;
pub mod repeatable;
pub mod scope;
pub mod shelf;
pub mod show;
pub mod sight;
pub mod smooth;
pub mod tree;
pub mod variant;
pub mod workload;

pub use variant::Variant;
