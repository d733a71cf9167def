//! What `shadow-fields view` shows and what can be done with it, without a window or a device: commands in, state out.
//!
//! [`Editor`] owns the scene, the camera and the clock. The window turns events into a [`Command`], hands it to
//! [`Editor::apply`], and does what the returned [`Effect`] says: merge again, bake a field, write a picture. Everything here
//! runs in tests without a display.

mod change;
pub mod command;
#[cfg(feature = "view")]
mod compare;
pub mod edit;
pub mod editor;
#[cfg(feature = "view")]
mod follow;
#[cfg(feature = "view")]
mod graph;
pub mod history;
pub mod input;
#[cfg(feature = "view")]
mod notes;
pub mod orbit_camera;
pub mod outline;
#[cfg(feature = "view")]
pub mod panel;
pub mod pick;
#[cfg(feature = "view")]
mod picture;
pub mod reference;
pub mod reload;
mod save;
pub mod task;
#[cfg(feature = "view")]
pub mod viewer;

pub use command::{Changed, Command, Effect, Request, Step};
pub use editor::Editor;
pub use input::{Event, Input};
#[cfg(feature = "view")]
pub use picture::FrameTarget;
#[cfg(feature = "view")]
pub use viewer::{Setup, Viewer};
