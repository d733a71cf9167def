//! The viewer's state for the overlay's panels and notes, and their common style.

use super::task::TaskProgress;
use crate::gpu::Timing;
use crate::scene::Lights;
use egui::Color32;
use std::collections::VecDeque;

/// Size of the smallest text, points: pixels at a scale of 1.
pub(super) const LEAST_TEXT: f32 = 12.0;
/// Margin around panels, points.
pub(super) const MARGIN: f32 = 8.0;
/// Colour of warnings.
pub(super) const WARNING: Color32 = Color32::from_rgb(255, 190, 90);
pub(super) const ERROR: Color32 = Color32::from_rgb(255, 120, 110);
/// Number of frames whose times are kept for the graph.
pub(super) const HISTORY: usize = 120;

/// The error that the colours show.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ErrorScale {
    /// Root mean square of the error, relative to that of the reference.
    pub rms: f64,
    /// Error at the ends of the colour scale, in the same unit.
    pub limit: f64,
}

/// The viewer's state that the overlay shows besides the editor's.
pub struct Status<'s> {
    pub device: &'s str,
    pub driver: &'s str,
    /// Width and height of the picture, pixels.
    pub size: [u32; 2],
    /// Whether the picture is refined; `None` where it never is.
    pub refined: Option<bool>,
    /// Times of the passes of the last frames, oldest first.
    pub timings: &'s VecDeque<Vec<Timing>>,
    /// Number of clusters that the last frame merged, and of all clusters; `None` before the first frame of a scene.
    pub merged: Option<(usize, usize)>,
    /// Number of lit vertices.
    pub vertices: usize,
    pub lights: Lights,
    /// Merge variant in use; `None` before the first frame of a scene.
    pub variant: Option<&'s str>,
    pub bake: Option<TaskProgress>,
    pub rays: Option<TaskProgress>,
    /// Reference: rays per vertex, relative standard error, and whether it is up to date.
    pub reference: Option<(u32, f64, bool)>,
    /// Error, and whether it is up to date.
    pub error: Option<(ErrorScale, bool)>,
    /// The compiler's messages.
    pub shader_error: Option<&'s str>,
    /// Messages for the user, oldest first.
    pub messages: Vec<&'s str>,
}

/// A number with spaces between groups of three digits: 12 345.
pub(super) fn grouped(number: u64) -> String {
    let digits = number.to_string();
    let mut out = String::new();
    for (index, digit) in digits.chars().enumerate() {
        if index > 0 && (digits.len() - index).is_multiple_of(3) {
            out.push(' ');
        }
        out.push(digit);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_read_in_threes() {
        assert_eq!(["0", "999", "1 000", "12 345 678"], [0, 999, 1000, 12_345_678].map(grouped)[..]);
    }
}
