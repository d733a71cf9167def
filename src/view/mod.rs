//! The state and the drawing of `shadow-fields view`.
//!
//! [`Editor`] owns the scene, the camera and the clock, and needs no device. The window turns events into a
//! [`Command`], passes it to [`Editor::apply`], and acts on the returned [`Effect`]: merge again, bake a field, write a
//! picture. Tests run all of it without a display.

mod change;
pub mod command;
mod compare;
pub mod edit;
pub mod editor;
mod figures;
mod follow;
mod graph;
pub mod history;
pub mod input;
mod messages;
mod notes;
mod open;
pub mod orbit_camera;
pub mod outline;
mod overlay;
pub mod panel;
pub mod pick;
mod picture;
mod preview;
mod refine;
pub mod reload;
mod save;
pub mod scenes;
pub mod status;
pub mod task;
mod ui;
pub mod viewer;

pub use command::{Changed, Command, Effect};
pub use editor::Editor;
pub use input::{Event, Input};
pub use picture::FrameTarget;
pub use viewer::{Previewed, Setup, Viewer};
