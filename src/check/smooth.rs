//! "smooth" against its twin: pictures whose outlines are smoothed, on the device and in f64.

use super::{CheckRow, draw};
use crate::bake::Baker;
use crate::draw::Antialias;
use crate::error::Result;

pub fn rows(baker: &Baker, add: &mut dyn FnMut(CheckRow)) -> Result<()> {
    draw::compare(baker, "smooth", Antialias::Outlines, add)
}
