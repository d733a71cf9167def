//! "silhouette" against its twin in f64.

use super::CheckRow;
use crate::asset::{Mesh, generate};
use crate::bake::Baker;
use crate::bake::silhouette::{SilhouetteOptions, bake_silhouette, silhouette_twin};
use crate::error::Result;

/// Share of texels that may differ from the twin's by more than two of 255 steps: a device may cover a pixel on an outline that
/// the twin does not, which moves the outline by a pixel for the few texels nearest to it.
pub const OFF_SHARE: f64 = 0.01;

/// Bakes a small field of `mesh`: the share of its texels that are off by more than two steps in distance, or in depth near the
/// outline, where depth is not a matter of which of two outline points is nearer.
///
/// # Errors
/// As [`bake_silhouette`].
pub fn compare(baker: &Baker, mesh: &Mesh) -> Result<f64> {
    let options = SilhouetteOptions { cells: 2, map_px: 16, view_px: 64 };
    let (field, _) = bake_silhouette((baker.device(), baker.library()), mesh, options, &|_, _| ())?;
    let (mut off, mut texels) = (0, 0);
    for (map, frame) in field.frames().iter().enumerate() {
        let twin = silhouette_twin(mesh, frame, options.map_px, options.view_px);
        let found = field.payload()[map * field.header.map_bytes() + 16..].chunks_exact(2);
        for (found, twin) in found.zip(&twin) {
            let steps = |i: usize| (i32::from(found[i].cast_signed()) - i32::from(twin[i].cast_signed())).abs();
            let near = twin[0].cast_signed().unsigned_abs() < 16;
            off += usize::from(steps(0) > 2 || (near && steps(1) > 4));
            texels += 1;
        }
    }
    Ok(f64::from(off as u32) / f64::from(texels))
}

/// The comparisons of `check`.
///
/// # Errors
/// As [`compare`].
pub fn rows(baker: &Baker, add: &mut dyn FnMut(CheckRow)) -> Result<()> {
    for mesh in [generate::torus(1.0, 0.3, 24, 12), generate::sphere(0.5, 2)] {
        let share = compare(baker, &mesh)?;
        add(CheckRow::new("silhouette", mesh.name, "share of texels off by more than two steps", share, OFF_SHARE));
    }
    Ok(())
}
