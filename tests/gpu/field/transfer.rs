//! Baked transfer vectors.

use super::{difference, norm, quiet, torus};
use crate::common::{generate, report};
use glam::{DVec3, Vec3};
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
        report(&format!("transfer of a {}: relative error mean {mean:.5}, max {largest:.4}", mesh.name));
        assert!(mean < 2e-3 && largest < 2e-2, "{}: {mean} {largest}", mesh.name);
    }
}

#[test]
fn the_hole_of_a_torus_is_darker() {
    let mesh = torus();
    let transfer = bake_transfer(&mesh, 4).unwrap();
    let open = lobe::clamped_cosine(4, DVec3::Y)[0];
    let (mut hole, mut rim, mut top) = (Vec::new(), Vec::new(), Vec::new());
    for ((position, normal), t) in mesh.positions.iter().zip(&mesh.normals).zip(transfer.chunks_exact(16)) {
        let outward = Vec3::new(position.x, 0.0, position.z).normalize().dot(*normal);
        let under_uniform_sky = f64::from(t[0]) / open;
        assert!((-1e-3..1.02).contains(&under_uniform_sky), "{under_uniform_sky} of the sky");
        match outward {
            o if o < -0.9 => hole.push(under_uniform_sky),
            o if o > 0.9 => rim.push(under_uniform_sky),
            o if o.abs() < 0.1 => top.push(under_uniform_sky),
            _ => {}
        }
    }
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    let (hole, rim, top) = (mean(&hole), mean(&rim), mean(&top));
    report(&format!("torus under a uniform sky: hole {hole:.3}, top {top:.3}, rim {rim:.3}"));
    // The rim bends away from all of the torus, the top looks past it, the hole looks across at the other side.
    assert!((rim - 1.0).abs() < 0.01 && hole < 0.85 && hole < top && top <= rim + 0.005, "{hole} {top} {rim}");
}
