//! Baked transfer vectors.

use super::{difference, norm, quiet};
use crate::common::generate;
use glam::Vec3;
use shadow_fields::asset::Mesh;
use shadow_fields::bake::surfaces::GroupPlan;
use shadow_fields::bake::{self, Wanted};
use shadow_fields::field::quantity::channel_stride;
use shadow_fields::sh::lobe;
use std::sync::Arc;

pub fn bake_transfer(mesh: &Mesh, bands: usize) -> Option<Vec<f32>> {
    let options = bake::Options { bands, ..Default::default() };
    let alone = GroupPlan::alone(&Arc::new(mesh.clone()), &options, Wanted::TRANSFER);
    let (surfaces, report) = alone.bake(&quiet);
    assert_eq!(report.samples as usize, mesh.positions.len());
    let transfer = surfaces[0].transfer.as_ref()?;
    assert_eq!(transfer.len(), mesh.positions.len() * channel_stride(bands));
    assert!(transfer.iter().all(|t| t.is_finite()));
    Some(transfer.to_vec())
}

#[test]
fn transfer_of_a_convex_mesh_is_the_cosine() {
    for mesh in [generate::sphere(0.4, 3), generate::cuboid(Vec3::new(1.0, 0.5, 2.0), 4)] {
        assert!(mesh.is_convex());
        // Where no ray is blocked nothing is kept: the cosine is exact.
        let Some(transfer) = bake_transfer(&mesh, 4) else { continue };
        let errors: Vec<f64> = transfer
            .chunks_exact(16)
            .zip(&mesh.normals)
            .map(|(found, normal)| {
                let found: Vec<f64> = found.iter().map(|f| f64::from(*f)).collect();
                let wanted = lobe::clamped_cosine(4, normal.as_dvec3());
                difference(&found, &wanted) / norm(wanted)
            })
            .collect();
        let mean = errors.iter().sum::<f64>() / errors.len() as f64;
        let largest = errors.iter().copied().fold(0.0, f64::max);
        assert!(mean < 2e-3 && largest < 2e-2, "{}: {mean} {largest}", mesh.name);
    }
}
