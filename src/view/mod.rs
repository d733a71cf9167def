//! The state and the drawing of `shadow-fields view`.
//!
//! [`Editor`] owns the scene, the camera and the clock, and needs no device. The window turns events into a
//! [`Command`], passes it to [`Editor::apply`], and acts on the returned [`Effect`]: merge again, bake a field, write a
//! picture. Tests run all of it without a display.

mod change;
pub mod command;
#[cfg(feature = "view")]
mod compare;
pub mod edit;
pub mod editor;
#[cfg(feature = "view")]
mod figures;
#[cfg(feature = "view")]
mod follow;
#[cfg(feature = "view")]
mod graph;
pub mod history;
pub mod input;
#[cfg(feature = "view")]
mod messages;
#[cfg(feature = "view")]
mod notes;
#[cfg(feature = "view")]
mod open;
pub mod orbit_camera;
pub mod outline;
#[cfg(feature = "view")]
mod overlay;
#[cfg(feature = "view")]
pub mod panel;
pub mod pick;
#[cfg(feature = "view")]
mod picture;
#[cfg(feature = "view")]
mod preview;
#[cfg(feature = "view")]
mod refine;
pub mod reload;
mod save;
pub mod scenes;
#[cfg(feature = "view")]
pub mod status;
pub mod task;
#[cfg(feature = "view")]
mod ui;
#[cfg(feature = "view")]
pub mod viewer;

pub use command::{Changed, Command, Effect};
pub use editor::Editor;
pub use input::{Event, Input};
#[cfg(feature = "view")]
pub use picture::FrameTarget;
#[cfg(feature = "view")]
pub use viewer::{Previewed, Setup, Viewer};
