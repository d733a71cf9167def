//! "silhouette" against its twin in f64.

use super::CheckRow;
use crate::asset::{Mesh, generate};
use crate::bake::Baker;
use crate::bake::silhouette::{SilhouetteOptions, bake_silhouette, silhouette_twin};
use crate::error::Result;
use crate::field::silhouette::Side;

/// Share of texels that may differ from the twin's by more than two of 255 steps: a device may cover a pixel on an
/// outline that the twin does not, which moves the outline by a pixel for the few texels nearest to it.
pub const OFF_SHARE: f64 = 0.01;

/// How far all distances together may be off the twin's: single texels are rounded to a 127th of the reach, their sum
/// is not.
pub const OFF_SCALE: f64 = 3e-3;

/// The same of maps of halves. Their views have half the pixels, and a pixel on the plane that cuts the halves may be
/// on either side of it.
pub const OFF_SHARE_HALVES: f64 = 0.02;

/// Differences to the twin.
#[derive(Clone, Copy, Debug, Default)]
pub struct Apart {
    /// Share of the texels of whole objects that are off by more than two steps in distance, or in depth near the
    /// outline, where depth is not a matter of which of two outline points is nearer.
    pub whole: f64,
    /// The same of texels of halves; 0 where there are none.
    pub halves: f64,
    /// How far the sum of all distances is off.
    pub scale: f64,
}

/// Bakes a small field of `mesh` and compares all of its texels.
pub fn compare(baker: &Baker, mesh: &Mesh) -> Result<Apart> {
    let options = SilhouetteOptions { cells: 2, map_px: 32, view_px: 128, levels: false };
    let (field, _) = bake_silhouette(baker, mesh, options, &|_, _| ())?;
    let sides = if field.has_halves() { &Side::ALL[..] } else { &Side::ALL[..1] };
    let mut shares = [0.0; 2];
    let mut sums = [0_u32; 2];
    for &side in sides {
        let mut off = 0_u32;
        let mut texels = 0_u32;
        let px = field.header.edge_px(side) as u32;
        for (map, frame) in field.frames.iter().enumerate() {
            let twin = silhouette_twin(mesh, (frame, side), px, options.view_px * px / options.map_px);
            for (found, twin) in field.texels(map, side).chunks_exact(2).zip(&twin) {
                let steps = |i: usize| (i32::from(found[i].cast_signed()) - i32::from(twin[i].cast_signed())).abs();
                let near = twin[0].cast_signed().unsigned_abs() < 16;
                off += u32::from(steps(0) > 2 || (near && steps(1) > 4));
                texels += 1;
                for (sum, byte) in sums.iter_mut().zip([found[0], twin[0]]) {
                    *sum += u32::from(byte.cast_signed().unsigned_abs());
                }
            }
        }
        let share = &mut shares[usize::from(side != Side::Whole)];
        *share = f64::max(*share, f64::from(off) / f64::from(texels));
    }
    let [found, wanted] = sums.map(f64::from);
    Ok(Apart { whole: shares[0], halves: shares[1], scale: (found / wanted - 1.0).abs() })
}

pub fn rows(baker: &Baker, add: &mut dyn FnMut(CheckRow)) -> Result<()> {
    // The last lies beside the middle of its sphere in every view.
    let ring = generate::torus(1.0, 0.3, 24, 12);
    let places = ring.positions.iter().map(|p| *p * (1.0 + 0.4 * p.x + 0.3 * p.y + 0.2 * p.z)).collect();
    let bent = Mesh::new("bent torus", places, ring.normals.clone(), None, ring.triangles.clone())?;
    for mesh in [ring, generate::sphere(0.5, 2), bent] {
        let apart = compare(baker, &mesh)?;
        let texels = "share of texels off by more than two steps";
        add(CheckRow::new("silhouette", mesh.name.clone(), texels, apart.whole, OFF_SHARE));
        if !mesh.is_convex() {
            add(CheckRow::new("silhouette", format!("{}, halves", mesh.name), texels, apart.halves, OFF_SHARE_HALVES));
        }
        add(CheckRow::new("silhouette", mesh.name, "of all distances together", apart.scale, OFF_SCALE));
    }
    Ok(())
}
