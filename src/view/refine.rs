//! When the window refines its picture: a software device takes too long for four samples a pixel, and for pixels that
//! evaluate lights, while things move. Once nothing has moved for a moment the picture is drawn so, and also in motion
//! where that is fast enough.

use super::viewer::Viewer;
use crate::error::Result;
use crate::gpu::Timing;
use std::time::{Duration, Instant};

/// Time without a change after which the picture is refined. It is longer than the interval between events of a drag.
const REST: Duration = Duration::from_millis(150);
/// Longest time of a refined frame while things move, ms.
const LONGEST_MS: f64 = 33.0;

/// Times of the last frames, ms.
#[derive(Default)]
pub(super) struct Pace {
    light: f64,
    refined_draw: Option<f64>,
}

impl Pace {
    /// Takes in the passes of a frame.
    pub fn note(&mut self, passes: &[Timing], refined: bool) {
        let of = |name: &str| {
            passes.iter().filter(|timing| timing.pass == name).map(|timing| timing.milliseconds).sum::<f64>()
        };
        if passes.iter().any(|timing| timing.pass == "merge") {
            self.light =
                passes.iter().map(|timing| timing.milliseconds).sum::<f64>() - of("draw") - of("smooth") - of("show");
        }
        if refined && passes.iter().any(|timing| timing.pass == "draw") {
            self.refined_draw = Some(of("draw"));
        }
    }

    /// Whether frames can be refined while things move.
    fn allows(&self) -> bool {
        self.refined_draw.is_some_and(|draw| draw + self.light <= LONGEST_MS)
    }
}

impl Viewer {
    /// Decides whether the next picture is refined; `moves` if it differs from the last in more than the overlay.
    /// Returns whether it has to be drawn for that, and whether its vertices have to be lit.
    pub(super) fn refine(&mut self, moves: bool) -> Result<[bool; 2]> {
        let due = self.refine_at.take();
        let Some(frame) = &self.frame else { return Ok([false; 2]) };
        let was = frame.is_refined();
        let is_due = due.is_some_and(|at| at <= Instant::now());
        // Beside a reference, and where the error is shown, both are of vertices.
        let can = self.setup.refines && !self.editor.error && !self.editor.reference;
        let refines = can && if moves { self.pace.allows() } else { was || is_due };
        if can && !refines {
            self.refine_at = due.filter(|_| !moves).or_else(|| Some(Instant::now() + REST));
        }
        if refines == was {
            return Ok([false; 2]);
        }
        // The overlay of this frame does not say so yet.
        self.repaint_at = Some(Instant::now());
        // The times of the frames under way are not of the new kind.
        self.settle()?;
        let Some(frame) = &mut self.frame else { return Ok([false; 2]) };
        Ok([true, frame.refine(refines)?])
    }

    /// Whether the picture is refined.
    pub fn is_refined(&self) -> bool {
        self.frame.as_ref().is_some_and(|frame| frame.is_refined())
    }
}
