//! Passes on the device against their twins, and what frames leave out.

mod bake_levels;
mod bake_skip;
mod bounce;
mod capture;
#[path = "../common/mod.rs"]
mod common;
mod draw;
mod field;
mod flight;
mod gloss;
mod hidden;
mod lamps;
mod light;
mod merge;
mod renderer;
mod self_visibility;
mod sharp;
mod sharp_motion;
mod sheet;
mod silhouette;
mod skip;
mod stability;
#[path = "../common/stage.rs"]
mod stage;
mod transparent;
mod validation;
