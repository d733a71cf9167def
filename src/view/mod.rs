//! The state and the drawing of `shadow-fields view`.
//!
//! [`Editor`] owns the scene, the camera and the clock, and needs no device. The window turns events into a
//! [`Command`], passes it to [`Editor::apply`], and acts on the returned [`Effect`]: merge again, bake a field, write a
//! picture. Tests run all of it without a display.

pub mod command;
mod compare;
pub mod edit;
pub mod editor;
mod figures;
mod follow;
pub mod input;
pub mod orbit_camera;
mod overlay;
pub mod panel;
pub mod pick;
mod picture;
pub mod scenes;
pub mod task;
pub mod viewer;

pub use command::{Changed, Command, Effect};
pub use editor::Editor;
pub use input::{Event, Input};
pub use picture::FrameTarget;
pub use viewer::{Previewed, Setup, Viewer};
