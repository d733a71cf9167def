//! What a bake leaves out without changing the field, and what a cancelled bake has done already.

mod common;

use common::generate;
use common::{gpu, report};
use glam::DVec3;
use shadow_fields::asset::Mesh;
use shadow_fields::bake::cache::Cache;
use shadow_fields::bake::partial::Partial;
use shadow_fields::bake::triangles::unit_positions;
use shadow_fields::bake::{self, Baker, SceneNeeds, capture};
use shadow_fields::field::{FieldHeader, FieldKind, Lookup, ShadowField, Shortcuts, Storage};
use shadow_fields::scene::Scene;
use shadow_fields::scene_buffers::SceneBuffers;
use shadow_fields::sh::basis::Y00;
use shadow_fields::sh::cube;
use std::cell::RefCell;
use std::panic::{AssertUnwindSafe, catch_unwind};

fn header(mesh: &Mesh, lattice: &str, shortcuts: Shortcuts) -> FieldHeader {
    let lattice = lattice.parse().unwrap();
    let options = bake::Options { lattice, storage: Storage::F32, face_px: 32, shortcuts, ..Default::default() };
    bake::header(mesh, FieldKind::Occlusion, &options)
}

/// Every sample is captured.
const CAPTURED: Shortcuts = Shortcuts { symmetry: false, faces: true, inside: true };

fn floats(field: &ShadowField) -> Vec<f32> {
    field.payload.chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect()
}

#[test]
fn a_cancelled_bake_goes_on() {
    let Some(gpu) = gpu() else { return };
    let mesh = generate::torus(1.0, 0.3, 24, 12);
    let baker = Baker::new(&gpu.device, &gpu.library);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("ring.part");
    let header = header(&mesh, "cube:12x8", CAPTURED);
    let whole = floats(&baker.field(&mesh, header.clone(), &|_, _| ()).unwrap().0);

    let cancelled = RefCell::new(0);
    let cancel = |done, all| {
        *cancelled.borrow_mut() = done;
        assert!(2 * done < all, "cancelled by the test");
    };
    let partial = Partial::eager(path.clone());
    let outcome = catch_unwind(AssertUnwindSafe(|| {
        let _ = baker.field_from(&partial, &mesh, header.clone(), &cancel);
    }));
    assert!(outcome.is_err() && path.exists(), "what was done is kept");
    let first = RefCell::new(Vec::new());
    let partial = Partial::eager(path.clone());
    let told = |done, _| first.borrow_mut().push(done);
    let (again, _) = baker.field_from(&partial, &mesh, header.clone(), &told).unwrap();
    report(&format!("cancelled after {}, then {:?}", cancelled.borrow(), first.borrow()));
    assert!(first.borrow()[0] > *cancelled.borrow(), "it goes on from there");
    // Faces lie elsewhere in the atlas of what was left, where a silhouette through a texel's centre may round to its other side.
    let apart: Vec<f32> = floats(&again).iter().zip(&whole).map(|(a, b)| (a - b).abs()).collect();
    let (differing, worst) = (apart.iter().filter(|d| **d > 0.0).count(), apart.iter().fold(0.0_f32, |m, d| m.max(*d)));
    report(&format!("{differing} of {} differ, by {worst:.1e} at most", apart.len()));
    assert!(40 * differing < apart.len() && worst < 0.02, "{differing} of {} differ, by {worst:e}", apart.len());
    assert!(!path.exists(), "nothing is left behind");
    // What is no such file is as good as none.
    std::fs::write(&path, b"nonsense").unwrap();
    let partial = Partial::eager(path);
    let (again, _) = baker.field_from(&partial, &mesh, header, &|_, _| ()).unwrap();
    assert_eq!(floats(&again), whole);
}

#[test]
fn the_same_mesh_under_two_names_is_baked_once() {
    let Some(gpu) = gpu() else { return };
    let meshes = |names: [&str; 2], sides: [u32; 2]| {
        let mesh = |(name, sides): (&str, u32)| {
            let size = format!("major_m = 1.0, minor_m = 0.3, segments = 12, sides = {sides}");
            let entity = format!("[[entity]]\nmesh = \"{name}\"\n");
            format!("[[mesh]]\nname = \"{name}\"\ntorus = {{ {size} }}\n{entity}")
        };
        let text: String = names.into_iter().zip(sides).map(mesh).collect();
        let rest = "[environment]\nuniform = [1, 1, 1]\n[camera]\neye = [0, 0, 5]\ntarget = [0, 0, 0]\n";
        Scene::parse(&format!("{text}{rest}"), "test.toml".as_ref(), &shadow_fields::asset::embedded::read).unwrap()
    };
    let baker = Baker::new(&gpu.device, &gpu.library);
    let options = bake::Options { lattice: "cube:3x3".parse().unwrap(), face_px: 16, ..Default::default() };
    let buffers = |scene: &Scene| {
        let needs = SceneNeeds::of(scene, &options, shadow_fields::scene::Lights::Sh);
        let baked = bake::ensure(&baker, &Cache::new(None), scene, &needs, &|_, _, _| ()).unwrap();
        assert_eq!(baked.meshes.len(), 2);
        SceneBuffers::new(&gpu.device, scene, &options, baked).unwrap()
    };
    let (same, other) = (buffers(&meshes(["a", "b"], [8, 8])), buffers(&meshes(["a", "b"], [8, 10])));
    let names = |buffers: &SceneBuffers| buffers.baked.iter().map(|b| b.what.clone()).collect::<Vec<_>>();
    report(&format!("{:?} and {:?}", names(&same), names(&other)));
    assert_eq!(names(&same), ["a shadow", "a transfer"]);
    assert_eq!(names(&other), ["a shadow", "a transfer", "b shadow", "b transfer"]);
    assert!(same.fields.size_bytes < other.fields.size_bytes);
    let [a, b] = [0, 1].map(|i| same.meshes[i].blocked.as_ref().unwrap());
    assert!(a.bytes == b.bytes && a.header.growth == b.header.growth && b.header.growth >= 1.0);
    assert_eq!(same.meshes[0].transfer_first, same.meshes[1].transfer_first);
}

#[test]
fn faces_and_backs_that_are_left_out_change_nothing() {
    let Some(gpu) = gpu() else { return };
    let mesh = generate::torus(1.0, 0.3, 48, 24);
    let bake = |faces: bool| {
        let header = header(&mesh, "cube:4x3", Shortcuts { faces, ..CAPTURED });
        let (field, found) = Baker::new(&gpu.device, &gpu.library).field(&mesh, header, &|_, _| ()).unwrap();
        (found.faces, field.header.captured_samples, floats(&field))
    };
    let (some, all) = (bake(true), bake(false));
    report(&format!("{} of {} faces drawn", some.0, all.0));
    assert!(all.0 == 6 * all.1 && some.1 == all.1 && 4 * some.0 < 3 * all.0);
    assert!(some.2 == all.2, "the same to the bit");
}

/// Just off a solid's surface a lookup lies between samples outside and inside. Those captured off the nearest surface leave it near
/// what is seen there; those captured where they stand see all dark, and darken it.
#[test]
fn samples_inside_a_solid_are_captured_off_its_surface() {
    let Some(gpu) = gpu() else { return };
    let mesh = generate::torus(1.0, 0.3, 48, 24);
    let positions = unit_positions(&mesh);
    let bake = |inside: bool| {
        let header = header(&mesh, "cube:12x8", Shortcuts { inside, ..CAPTURED });
        let (field, found) = Baker::new(&gpu.device, &gpu.library).field(&mesh, header, &|_, _| ()).unwrap();
        (found.filled, field)
    };
    let ((some, with), (none, without)) = (bake(true), bake(false));
    assert!(some > 100 && none == 0, "{some} and {none} samples inside");
    let weights = cube::solid_angle(16);
    let (mut errors, mut count) = ([0.0; 2], 0.0);
    for turn in 0..12 {
        // Off the tube by a tenth of its radius, all round it.
        let (around, along) = (0.5 * f64::from(turn), 2.1 * f64::from(turn));
        let radius = 1.0 + 0.33 * around.cos();
        let p = DVec3::new(radius * along.cos(), 0.33 * around.sin(), radius * along.sin()) / 1.3;
        let mut seen = 0.0;
        for face in 0..6 {
            let covered = capture::twin(&positions, &mesh.triangles, p, face, 16);
            let texels = covered.iter().enumerate().filter(|(_, covered)| **covered);
            seen += texels.map(|(i, _)| weights[i]).sum::<f64>() * Y00;
        }
        for (error, field) in errors.iter_mut().zip([&with, &without]) {
            let mut found = [0.0; 16];
            field.lookup(p, Lookup::Trilinear, 0, &mut found);
            *error += (found[0] - seen).powi(2);
        }
        count += 1.0;
    }
    let [with, without] = errors.map(|sum| (sum / count).sqrt());
    report(&format!("{some} samples inside; off by {with:.3}, where they stand {without:.3}"));
    assert!(2.0 * with < without, "{with} and {without}");
}
