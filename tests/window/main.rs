//! The window: its inside, which draws into an image, and the whole on a virtual display.
#![cfg(feature = "view")]

#[path = "../common/cli.rs"]
mod cli;
#[path = "../common/mod.rs"]
mod common;
#[cfg(target_os = "linux")]
mod desktop;
#[path = "../common/display.rs"]
mod display;
#[cfg(target_os = "linux")]
mod ends;
mod headless;
#[path = "../common/model.rs"]
mod model;
mod open;
#[path = "../common/room.rs"]
mod room;
mod stand;
#[cfg(target_os = "linux")]
mod viewing;
