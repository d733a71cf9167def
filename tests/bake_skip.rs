//! What a bake leaves out: triangles that are too small to be seen from afar, and what a cancelled bake has done already.

mod common;

use common::{gpu, report};
use glam::{DVec3, Vec3};
use shadow_fields::asset::{Mesh, generate};
use shadow_fields::bake::cache::Cache;
use shadow_fields::bake::capture::unit_positions;
use shadow_fields::bake::inside::nearest_on_triangle;
use shadow_fields::bake::partial::Partial;
use shadow_fields::bake::{self, Baker, capture, simplify};
use shadow_fields::field::{FieldHeader, FieldKind, Lookup, ShadowField, Storage};
use shadow_fields::gpu::{Buffer, BufferKind};
use shadow_fields::lists::skip::Skip;
use shadow_fields::scene::Scene;
use shadow_fields::scene_buffers::Store;
use shadow_fields::sh::basis::Y00;
use shadow_fields::sh::cube;
use std::cell::RefCell;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// A ring with waves on it: closed, and of more triangles than a far eye needs.
fn waves() -> Mesh {
    let ring = generate::torus(1.0, 0.4, 200, 100);
    let positions = ring.positions.iter().zip(&ring.normals);
    let moved = positions.map(|(p, n)| *p + *n * (0.02 * (9.0 * p.x).sin() * (11.0 * p.z).cos())).collect();
    Mesh::new("waves", moved, Vec::new(), None, ring.triangles.clone()).unwrap()
}

fn corners(positions: &[Vec3], triangles: &[[u32; 3]]) -> Vec<[DVec3; 3]> {
    triangles.iter().map(|t| t.map(|i| positions[i as usize].as_dvec3())).collect()
}

fn distance(surface: &[[DVec3; 3]], p: DVec3) -> f64 {
    surface.iter().map(|t| nearest_on_triangle(t.map(|c| c - p)).length()).fold(f64::INFINITY, f64::min)
}

#[test]
fn levels_keep_their_error_and_eyes_their_share_of_a_texel() {
    let mesh = waves();
    let positions = unit_positions(&mesh);
    let full = corners(&positions, &mesh.triangles);
    let mut rng = fastrand::Rng::with_seed(9);
    let mut eyes: Vec<Vec3> = Vec::new();
    while eyes.len() < 400 {
        let p = 9.0 * Vec3::new(rng.f32() - 0.5, rng.f32() - 0.5, rng.f32() - 0.5);
        eyes.push(p * rng.f32());
    }
    let face_px = 64;
    let levels = simplify::levels(&positions, &mesh.triangles, &eyes, face_px);
    let sizes: Vec<usize> = levels.iter().map(|level| level.triangles.len()).collect();
    report(&format!("{} triangles, levels {sizes:?}", mesh.triangles.len()));
    assert!(!levels.is_empty() && 3 * sizes[0] < mesh.triangles.len() && sizes.is_sorted());
    for level in &levels {
        let coarse = corners(&level.positions, &level.triangles);
        assert!(level.closed, "a closed mesh stays closed: back faces are culled");
        let mut worst = 0.0_f64;
        for (from, to) in [(&full, &coarse), (&coarse, &full)] {
            for _ in 0..300 {
                let [a, b, c] = from[rng.usize(0..from.len())];
                let (u, v) = (rng.f64(), rng.f64());
                let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
                worst = worst.max(distance(to, a + u * (b - a) + v * (c - a)));
            }
        }
        report(&format!("{} triangles: off by {worst:.5} of {:.5}", level.triangles.len(), level.error));
        // Between the points that were tried a surface may bulge a little more.
        assert!(worst <= 1.1 * level.error);
    }
    let chosen = simplify::choose(&levels, &eyes, face_px);
    for (eye, level) in eyes.iter().zip(&chosen).take(100) {
        if let Some(level) = level {
            let seen = distance(&full, eye.as_dvec3());
            assert!(levels[*level].error <= simplify::allowed(seen, face_px) * 1.0001, "{eye} is {seen} off");
        }
    }
    let count = chosen.iter().filter(|level| level.is_some()).count();
    assert!(count > 20 && count < eyes.len(), "{count} of {} eyes", eyes.len());
}

fn header(mesh: &Mesh, lattice: &str) -> FieldHeader {
    let options =
        bake::Options { lattice: lattice.parse().unwrap(), storage: Storage::F32, face_px: 32, ..Default::default() };
    bake::header(mesh, FieldKind::Occlusion, &options)
}

fn floats(store: &Buffer, header: &FieldHeader) -> Vec<f32> {
    store.download_range(0..header.payload_bytes()).unwrap()
}

#[test]
fn far_samples_from_simplified_meshes_are_nearly_the_same() {
    let Some(gpu) = gpu() else { return };
    let mesh = waves();
    let mut baker = Baker::new(&gpu.device, &gpu.library);
    baker.orbit = false;
    let mut both = Vec::new();
    for simplify in [true, false] {
        baker.simplify = simplify;
        let mut header = header(&mesh, "cube:3x3,inner=1.5,outer=8");
        let store = Buffer::new(&gpu.device, "field", BufferKind::Device, header.payload_bytes()).unwrap();
        let found = baker.field(&mesh, &mut header, (&store, 0), &|_, _| ()).unwrap();
        report(&format!("{:?}", found.levels));
        assert_eq!(simplify, found.levels.iter().any(|l| l.triangles < mesh.triangles.len() && l.samples > 0));
        both.push(floats(&store, &header));
    }
    let scale = both[1].iter().fold(0.0_f32, |m, x| m.max(x.abs()));
    let worst = both[0].iter().zip(&both[1]).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    let squares = |v: &mut dyn Iterator<Item = f32>| v.map(|x| f64::from(x * x)).sum::<f64>().sqrt();
    let relative =
        squares(&mut both[0].iter().zip(&both[1]).map(|(a, b)| a - b)) / squares(&mut both[1].iter().copied());
    report(&format!("off by {worst} of {scale}, relative root mean square {relative:.5}"));
    // Against the closed form of a cap, a face of 32 texels has itself an error of 0.01 relative RMS.
    assert!(relative < 1e-2 && relative > 0.0, "{relative}");
}

#[test]
fn a_cancelled_bake_goes_on() {
    let Some(gpu) = gpu() else { return };
    let mesh = generate::torus(1.0, 0.3, 24, 12);
    let mut baker = Baker::new(&gpu.device, &gpu.library);
    baker.orbit = false;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("ring.part");
    let mut expected = header(&mesh, "cube:12x8");
    let store = Buffer::new(&gpu.device, "field", BufferKind::Device, expected.payload_bytes()).unwrap();
    baker.field(&mesh, &mut expected, (&store, 0), &|_, _| ()).unwrap();
    let whole = floats(&store, &expected);

    let mut again = header(&mesh, "cube:12x8");
    let store = Buffer::new(&gpu.device, "field", BufferKind::Device, again.payload_bytes()).unwrap();
    let cancelled = RefCell::new(0);
    let cancel = |done, all| {
        *cancelled.borrow_mut() = done;
        assert!(2 * done < all, "cancelled by the test");
    };
    let partial = Partial::eager(path.clone());
    let outcome = catch_unwind(AssertUnwindSafe(|| {
        let _ = baker.field_from(&partial, &mesh, &mut again, (&store, 0), &cancel);
    }));
    assert!(outcome.is_err() && path.exists(), "what was done is kept");
    let first = RefCell::new(Vec::new());
    let mut again = header(&mesh, "cube:12x8");
    let partial = Partial::eager(path.clone());
    baker.field_from(&partial, &mesh, &mut again, (&store, 0), &|done, _| first.borrow_mut().push(done)).unwrap();
    report(&format!("cancelled after {}, then {:?}", cancelled.borrow(), first.borrow()));
    assert!(first.borrow()[0] > *cancelled.borrow(), "it goes on from there");
    // Faces lie elsewhere in the atlas of what was left, where a silhouette through a texel's centre may round to its other side.
    let apart: Vec<f32> = floats(&store, &again).iter().zip(&whole).map(|(a, b)| (a - b).abs()).collect();
    let (differing, worst) = (apart.iter().filter(|d| **d > 0.0).count(), apart.iter().fold(0.0_f32, |m, d| m.max(*d)));
    report(&format!("{differing} of {} differ, by {worst:.1e} at most", apart.len()));
    assert!(40 * differing < apart.len() && worst < 0.02, "{differing} of {} differ, by {worst:e}", apart.len());
    assert!(!path.exists(), "nothing is left behind");
    // What is no such file is as good as none.
    std::fs::write(&path, b"nonsense").unwrap();
    let partial = Partial::eager(path);
    baker.field_from(&partial, &mesh, &mut again, (&store, 0), &|_, _| ()).unwrap();
    assert_eq!(floats(&store, &again), whole);
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
    let store =
        |scene: &Scene| Store::new(&baker, &Cache::new(None), scene, &options, Skip::ALL, &|_, _, _| ()).unwrap();
    let (same, other) = (store(&meshes(["a", "b"], [8, 8])), store(&meshes(["a", "b"], [8, 10])));
    let names = |store: &Store| store.baked.iter().map(|b| b.what.clone()).collect::<Vec<_>>();
    report(&format!("{:?} and {:?}", names(&same), names(&other)));
    assert_eq!(names(&same), ["a shadow", "a transfer"]);
    assert_eq!(names(&other), ["a shadow", "b shadow", "a transfer", "b transfer"]);
    assert!(same.fields.size_bytes < other.fields.size_bytes);
    let [a, b] = [0, 1].map(|i| same.geometries[i].blocked.as_ref().unwrap());
    assert!(a.bytes == b.bytes && a.header.growth == b.header.growth && b.header.growth >= 1.0);
    assert_eq!(same.geometries[0].transfer_first, same.geometries[1].transfer_first);
}

#[test]
fn faces_and_backs_that_are_left_out_change_nothing() {
    let Some(gpu) = gpu() else { return };
    let mesh = generate::torus(1.0, 0.3, 48, 24);
    let bake = |faces: bool| {
        let mut baker = Baker::new(&gpu.device, &gpu.library);
        (baker.faces, baker.orbit) = (faces, false);
        let mut header = header(&mesh, "cube:4x3");
        let store = Buffer::new(&gpu.device, "field", BufferKind::Device, header.payload_bytes()).unwrap();
        let found = baker.field(&mesh, &mut header, (&store, 0), &|_, _| ()).unwrap();
        (found.faces, header.captured_samples, floats(&store, &header))
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
        let mut baker = Baker::new(&gpu.device, &gpu.library);
        (baker.inside, baker.orbit) = (inside, false);
        let mut header = header(&mesh, "cube:12x8");
        let store = Buffer::new(&gpu.device, "field", BufferKind::Device, header.payload_bytes()).unwrap();
        let found = baker.field(&mesh, &mut header, (&store, 0), &|_, _| ()).unwrap();
        let payload = store.download_range(0..header.payload_bytes()).unwrap();
        (found.filled, ShadowField { header, payload })
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
            let covered = capture::reference(&positions, &mesh.triangles, p, face, 16);
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
