//! Levels of detail in captures: how many triangles fewer are drawn, and what a field is off by then.

use crate::common::{Gpu, generate, gpu, relative_rms};
use glam::Vec3;
use shadow_fields::asset::Mesh;
use shadow_fields::bake::silhouette::{SilhouetteOptions, bake_silhouette};
use shadow_fields::bake::surfaces::GroupPlan;
use shadow_fields::bake::{self, BakeReport, Wanted};
use shadow_fields::field::{FieldKind, Storage};
use std::sync::Arc;

/// Most that levels may move coefficients, relative RMS: what faces of 64 texels round a binary cap's by.
const OFF: f64 = 0.003;

/// A closed surface with bumps of many sizes, down to those of its vertices, as of a scanned model.
fn scanned(subdivisions: u32) -> Mesh {
    let ball = generate::sphere(1.0, subdivisions);
    let bump = |p: &Vec3| {
        let wave = |f: f32| (f * p.x + f).sin() * (f * p.y + 0.7 * f).sin() * (f * p.z + 2.1 * f).sin();
        let waves = [(3.0, 0.25), (7.0, 0.08), (17.0, 0.02), (41.0, 0.004), (97.0, 0.0008)];
        let sum: f32 = waves.map(|(f, a)| a * wave(f)).iter().sum();
        *p * Vec3::new(1.0, 1.4, 0.8) * (1.0 + sum)
    };
    let positions = ball.positions.iter().map(bump).collect();
    Mesh::new("scanned", positions, Vec::new(), None, ball.triangles.clone()).unwrap()
}

fn options(levels: bool) -> bake::Options {
    bake::Options { lattice: "cube:9x3".parse().unwrap(), storage: Storage::F32, levels, ..Default::default() }
}

fn field(gpu: &Gpu, mesh: &Mesh, levels: bool) -> (Vec<f32>, BakeReport, f64) {
    let header = bake::header(mesh, FieldKind::Occlusion, &options(levels));
    let (field, report) = gpu.baker().field(mesh, header, &|_, _| ()).unwrap();
    (bytemuck::pod_collect_to_vec(&field.payload), report, field.header.level_texels)
}

#[test]
fn fields_are_those_of_the_whole_mesh() {
    let Some(gpu) = gpu() else { return };
    for (mesh, least) in [(scanned(5), 1.8), (generate::torus(1.0, 0.4, 160, 80), 2.5)] {
        let ((found, with, texels), (wanted, without, none)) = (field(&gpu, &mesh, true), field(&gpu, &mesh, false));
        let off = relative_rms(found.into_iter().zip(wanted));
        let times = without.triangles as f64 / with.triangles as f64;
        assert!(texels > 0.0 && none == 0.0);
        assert!(times > least, "{}: only {times:.2} times fewer triangles", mesh.name);
        assert!(off < OFF, "{}: {off}", mesh.name);
    }
}

#[test]
fn small_meshes_have_no_levels() {
    let Some(gpu) = gpu() else { return };
    let mesh = generate::torus(1.0, 0.4, 48, 24);
    let ((found, with, texels), (wanted, without, _)) = (field(&gpu, &mesh, true), field(&gpu, &mesh, false));
    assert!(found == wanted && with.triangles == without.triangles && texels == 0.0);
}

#[test]
fn outlines_are_those_of_the_whole_mesh() {
    let Some(gpu) = gpu() else { return };
    let mesh = scanned(4);
    let bake = |levels| {
        let options = SilhouetteOptions { cells: 2, levels, ..Default::default() };
        bake_silhouette(&gpu.baker(), &mesh, options, &|_, _| ()).unwrap().0
    };
    let (found, wanted) = (bake(true), bake(false));
    assert!(found.header.level_pixels > 0.0 && wanted.header.level_pixels == 0.0);
    let steps = |(a, b): (&u8, &u8)| (i32::from(a.cast_signed()) - i32::from(b.cast_signed())).abs();
    let all = found.payload.len();
    let differing = found.payload.iter().zip(&wanted.payload).filter(|pair| steps(*pair) > 4).count();
    assert!(100 * differing < all, "{differing} of {all}");
}

/// Both come of the same rays, and are the same bytes as when each is baked by itself.
#[test]
fn transfer_and_self_visibility_do_not_depend_on_each_other() {
    let mesh = Arc::new(generate::torus(1.0, 0.4, 24, 12));
    let options = bake::Options::default();
    let bake = |wanted| GroupPlan::alone(&mesh, &options, wanted).bake(&|_, _| ()).0.remove(0);
    let both = bake(Wanted::BOTH);
    let transfer = bake(Wanted::TRANSFER);
    let maps = bake(Wanted { transfer: false, self_visibility: true });
    assert!(both.transfer == transfer.transfer && both.self_visibility == maps.self_visibility);
    assert!(transfer.self_visibility.is_none() && maps.transfer.is_none());
}
