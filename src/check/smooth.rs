//! "smooth" against its twin: pictures whose outlines are smoothed, on the device and in f64.

use super::{CheckRow, draw};
use crate::bake::Baker;
use crate::draw::Antialias;
use crate::error::Result;

/// The comparisons of `check`.
///
/// # Errors
/// As [`crate::frame::Frame::new`] and [`crate::frame::Frame::render`].
pub fn rows(baker: &Baker, add: &mut dyn FnMut(CheckRow)) -> Result<()> {
    draw::compare(baker, "smooth", Antialias::Outlines, add)
}
