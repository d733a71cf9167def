//! Work for many machines: bakes and pictures cut into slices, which need no meeting place but a shared folder.
//!
//! ```text
//! plan -> PLAN.json: slices, and all that decides their bytes
//! run one slice, on any machine, in any order, any number of times -> results/AB/ABCD....slice
//! collect: results -> the files of a cache, and pictures
//! ```
//!
//! A result is named by the hash of what decides it, holds a hash of its content, and is replaced whole. So a slice may
//! be killed, repeated, or run twice at once; what is there and intact is right. What starts slices is an engine, see
//! [`engines`].
#![allow(missing_docs)] // fields and variants whose names say it

pub mod engines;
pub mod local;
pub mod plan;
pub mod results;

pub use plan::{Film, Input, Plan, Slice};

/// A number of things: `1 slice`, `2 slices`.
pub fn counted(count: usize, what: &str) -> String {
    format!("{count} {what}{}", if count == 1 { "" } else { "s" })
}
