//! "silhouette" against its twin in f64.

use super::CheckRow;
use crate::asset::{Mesh, generate};
use crate::bake::Baker;
use crate::bake::silhouette::{SilhouetteOptions, bake_silhouette, silhouette_twin};
use crate::error::Result;

/// Share of texels that may differ from the twin's by more than two of 255 steps: a device may cover a pixel on an outline that
/// the twin does not, which moves the outline by a pixel for the few texels nearest to it.
pub const OFF_SHARE: f64 = 0.01;

/// How far all distances together may be off the twin's: single texels are rounded to a 127th of the reach, their sum is not.
pub const OFF_SCALE: f64 = 3e-3;

/// Bakes a small field of `mesh`: the share of its texels that are off by more than two steps in distance, or in depth near the
/// outline, where depth is not a matter of which of two outline points is nearer; and how far the sum of all distances is off.
///
/// # Errors
/// As [`bake_silhouette`].
pub fn compare(baker: &Baker, mesh: &Mesh) -> Result<[f64; 2]> {
    let options = SilhouetteOptions { cells: 2, map_px: 16, view_px: 64 };
    let (field, _) = bake_silhouette((baker.device(), baker.library()), mesh, options, &|_, _| ())?;
    let (mut off, mut texels, mut sums) = (0, 0, [0_u32; 2]);
    for (map, frame) in field.frames().iter().enumerate() {
        let twin = silhouette_twin(mesh, frame, options.map_px, options.view_px);
        let found = field.payload()[map * field.header.map_bytes() + 16..].chunks_exact(2);
        for (found, twin) in found.zip(&twin) {
            let steps = |i: usize| (i32::from(found[i].cast_signed()) - i32::from(twin[i].cast_signed())).abs();
            let near = twin[0].cast_signed().unsigned_abs() < 16;
            off += usize::from(steps(0) > 2 || (near && steps(1) > 4));
            texels += 1;
            for (sum, byte) in sums.iter_mut().zip([found[0], twin[0]]) {
                *sum += u32::from(byte.cast_signed().unsigned_abs());
            }
        }
    }
    let [found, wanted] = sums.map(f64::from);
    Ok([f64::from(off as u32) / f64::from(texels), (found / wanted - 1.0).abs()])
}

/// The comparisons of `check`.
///
/// # Errors
/// As [`compare`].
pub fn rows(baker: &Baker, add: &mut dyn FnMut(CheckRow)) -> Result<()> {
    // The last lies beside the middle of its sphere in every view.
    let ring = generate::torus(1.0, 0.3, 24, 12);
    let places = ring.positions.iter().map(|p| *p * (1.0 + 0.4 * p.x + 0.3 * p.y + 0.2 * p.z)).collect();
    let bent = Mesh::new("bent torus", places, ring.normals.clone(), None, ring.triangles.clone())?;
    for mesh in [ring, generate::sphere(0.5, 2), bent] {
        let [share, scale] = compare(baker, &mesh)?;
        let what = mesh.name.clone();
        add(CheckRow::new("silhouette", what, "share of texels off by more than two steps", share, OFF_SHARE));
        add(CheckRow::new("silhouette", mesh.name, "of all distances together", scale, OFF_SCALE));
    }
    Ok(())
}
