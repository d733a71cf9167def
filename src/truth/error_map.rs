//! The error of every lit vertex, and a frame that shows it in false colour.

use super::EntityRadiosity;
use crate::asset::false_color::{BACKGROUND, ColorScale, NEUTRAL, Scheme};
use crate::asset::picture;
use crate::error::Result;
use crate::frame::Frame;
use crate::scene::Placement;
use serde::Serialize;
use std::path::Path;

#[derive(Clone, Debug, Serialize)]
pub struct ErrorPicture {
    pub picture: String,
    /// Mapping from errors to colours.
    pub scale: ColorScale,
    /// Root mean square over all lit vertices, relative to that of the reference.
    pub rms: f64,
    /// The reference's own relative standard error.
    pub reference_error: f64,
}

/// Errors of the lit vertices of a frame against a reference.
#[derive(Clone, Debug)]
pub struct ErrorMap {
    /// By entity, one error per vertex in units of the reference's root mean square over vertices and channels: the
    /// mean over channels of the signed difference.
    pub errors: Vec<(usize, Vec<f64>)>,
}

impl ErrorMap {
    /// Compares radiosity by entity (linear RGB per vertex) with a reference for the same entities, such as
    /// [`super::picture`]'s.
    pub fn new(found: &[EntityRadiosity], reference: &[EntityRadiosity]) -> Self {
        let squares = || reference.iter().flat_map(|(_, v)| v.iter().flatten()).map(|c| f64::from(*c).powi(2));
        let unit = (squares().sum::<f64>() / squares().count().max(1) as f64).sqrt().max(f64::MIN_POSITIVE);
        let of = |found: &[f32; 3], wanted: &[f32; 3]| {
            let apart: [f64; 3] = std::array::from_fn(|c| (f64::from(found[c]) - f64::from(wanted[c])) / unit);
            apart.iter().sum::<f64>() / 3.0
        };
        let entity = |((entity, found), (other, wanted)): (&EntityRadiosity, &EntityRadiosity)| {
            assert_eq!((entity, found.len()), (other, wanted.len()), "entity and vertices");
            (*entity, found.iter().zip(wanted).map(|(f, w)| of(f, w)).collect())
        };
        ErrorMap { errors: found.iter().zip(reference).map(entity).collect() }
    }

    /// Root mean square over vertices, in the unit of `errors`.
    pub fn rms(&self) -> f64 {
        let all = || self.errors.iter().flat_map(|(_, errors)| errors);
        (all().map(|e| e * e).sum::<f64>() / all().count().max(1) as f64).sqrt()
    }

    /// The colour scale that fits these errors: see [`ColorScale::fitting`].
    pub fn scale(&self) -> ColorScale {
        ColorScale::fitting(Scheme::Signed, self.errors.iter().flat_map(|(_, errors)| errors.iter().copied()))
    }

    /// A colour per vertex by entity, for [`Frame::set_comparison`].
    pub fn colors(&self, scale: &ColorScale) -> Vec<EntityRadiosity> {
        self.errors.iter().map(|(entity, errors)| (*entity, errors.iter().map(|e| scale.color(*e)).collect())).collect()
    }

    /// Draws the errors and writes the picture with its scale bar. Entities that are not lit are grey, and emission is not
    /// drawn. `limit` replaces the fitting limit of the scale; the title states the reference's own standard error.
    pub fn write(
        &self,
        path: &Path,
        frame: &mut Frame,
        placements: &[Placement],
        limit: Option<f64>,
        reference_error: f64,
    ) -> Result<ErrorPicture> {
        let fitting = self.scale();
        let scale = ColorScale { limit: limit.unwrap_or(fitting.limit), ..fitting };
        frame.set_comparison(0, &self.colors(&scale), NEUTRAL)?;
        frame.draw_comparison(placements, BACKGROUND)?;
        let title = format!(
            "error of radiosity / RMS radiosity by rays from vertices; blue: too dark, red: too bright; RMS {:.4}, of the rays \
             themselves {reference_error:.4}",
            self.rms()
        );
        let [width, _] = frame.size();
        let (drawn, rows) = scale.with_bar(&frame.picture(), width as usize, &title);
        picture::write_png(path, width, rows as u32, &drawn, 0.0)?;
        let picture = path.display().to_string();
        Ok(ErrorPicture { picture, scale, rms: self.rms(), reference_error })
    }
}

/// Radiosity of a frame's vertices by receiving entity, to compare with [`super::picture`].
pub fn radiosity(frame: &Frame) -> Result<Vec<EntityRadiosity>> {
    let receives = |entity: &usize| frame.scene().entities[*entity].receives;
    let entities = (0..frame.scene().entities.len()).filter(receives);
    entities.map(|entity| Ok((entity, frame.radiosity(entity)?))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_in_units_of_the_reference() {
        let reference = vec![(2, vec![[3.0, 3.0, 3.0], [4.0, 4.0, 4.0], [0.0; 3]])];
        let found = vec![(2, vec![[3.0, 3.0, 3.0], [4.5, 4.0, 3.5], [0.0, 0.0, -3.0]])];
        let unit = (25.0_f64 / 3.0).sqrt();
        let map = ErrorMap::new(&found, &reference);
        assert_eq!(map.errors[0].0, 2);
        let wanted = [0.0, 0.0, -1.0 / unit];
        assert!(map.errors[0].1.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-12), "{map:?}");
        let colors = map.colors(&map.scale());
        assert_eq!(colors[0].1.len(), 3);
        assert_ne!(colors[0].1[0], colors[0].1[2]);
    }
}
