//! Samples that are turned from others instead of captured: what counts as a symmetry, that turning is exact, and what a faceted
//! body's field loses by it.

mod common;

use common::generate;
use common::{gpu, report};
use fastrand::Rng;
use glam::{DVec3, Vec3};
use shadow_fields::asset::Mesh;
use shadow_fields::bake::surface::Surface;
use shadow_fields::bake::symmetric_samples::{self, CoefficientTurn};
use shadow_fields::bake::symmetry::{Symmetry, cube_group};
use shadow_fields::bake::triangles::unit_positions;
use shadow_fields::bake::{self, Baker};
use shadow_fields::field::{FieldKind, Lookup, ShadowField, Shortcuts, Storage};
use shadow_fields::sh::basis::{MAX_COEFFICIENTS, evaluate};
use shadow_fields::sh::lobe::cap;

fn found(mesh: &Mesh) -> Symmetry {
    Symmetry::of(mesh, &Surface::new(&unit_positions(mesh), &mesh.triangles), true)
}

/// A solid of revolution about +y with `pieces` around: a cone on a cylinder, like a chessman.
fn chessman(pieces: u32) -> Mesh {
    let profile = [(0.0, -1.0), (0.6, -1.0), (0.5, -0.6), (0.25, -0.4), (0.2, 0.3), (0.4, 0.5), (0.0, 1.0)];
    let at = |k: u32, (radius, height): (f32, f32)| {
        let angle = std::f32::consts::TAU * k as f32 / pieces as f32;
        Vec3::new(radius * angle.cos(), height, radius * angle.sin())
    };
    let rings = profile.len() as u32 - 2;
    let mut positions = vec![at(0, profile[0]), at(0, profile[profile.len() - 1])];
    positions.extend(profile[1..=rings as usize].iter().flat_map(|p| (0..pieces).map(|k| at(k, *p))));
    let vertex = |ring: u32, k: u32| 2 + ring * pieces + k % pieces;
    let mut triangles = Vec::new();
    for k in 0..pieces {
        triangles.push([0, vertex(0, k), vertex(0, k + 1)]);
        triangles.push([1, vertex(rings - 1, k + 1), vertex(rings - 1, k)]);
        for ring in 0..rings - 1 {
            triangles.push([vertex(ring, k), vertex(ring + 1, k), vertex(ring + 1, k + 1)]);
            triangles.push([vertex(ring, k), vertex(ring + 1, k + 1), vertex(ring, k + 1)]);
        }
    }
    Mesh::new("chessman", positions, Vec::new(), None, triangles).unwrap()
}

#[test]
fn turning_coefficients_turns_the_function_mirrors_too() {
    let mut rng = Rng::with_seed(5);
    let group = cube_group();
    assert_eq!(group.len(), 48);
    for bands in [2, 4, 7] {
        for turn in &group {
            let w = DVec3::new(rng.f64() - 0.5, rng.f64() - 0.5, rng.f64() - 0.5).normalize();
            let coefficients: [f64; MAX_COEFFICIENTS] = std::array::from_fn(|_| rng.f64() - 0.5);
            let (mut turned, mut at, mut there) =
                ([0.0; MAX_COEFFICIENTS], [0.0; MAX_COEFFICIENTS], [0.0; MAX_COEFFICIENTS]);
            CoefficientTurn::new(bands, *turn).apply(&coefficients, &mut turned);
            evaluate(bands, w, &mut at);
            evaluate(bands, *turn * w, &mut there);
            let sum = |a: &[f64], b: &[f64]| a.iter().zip(b).take(bands * bands).map(|(a, b)| a * b).sum::<f64>();
            assert!((sum(&coefficients, &at) - sum(&turned, &there)).abs() < 1e-12, "{bands} bands, {turn}");
        }
    }
}

#[test]
fn symmetries_are_found_and_only_those() {
    let counts = |mesh: &Mesh| {
        let s = found(mesh);
        report(&format!("{}: {}", mesh.name, s.describe()));
        let exact = s.operations.iter().filter(|o| o.deviation < 1e-5).count();
        (exact, s.revolution.map(|r| r.is_some()), s.sphere.is_some())
    };
    // The icosahedron shares 24 of the cube's 48 turns and mirrors, its identity among them.
    assert_eq!(counts(&generate::sphere(2.0, 4)), (23, [true; 3], true));
    assert_eq!(counts(&generate::cuboid(Vec3::ONE, 2)), (47, [false; 3], false));
    assert_eq!(counts(&generate::cuboid(Vec3::new(1.0, 2.0, 3.0), 2)), (7, [false; 3], false));
    assert_eq!(counts(&generate::torus(1.0, 0.3, 48, 24)), (15, [false, true, false], false));
    // Two colours leave the mirrors that keep them apart.
    assert_eq!(counts(&generate::torus_two_colour(1.0, 0.3, 48, 24)), (3, [false; 3], false));
    assert_eq!(counts(&chessman(50)), (3, [false, true, false], false));
    assert_eq!(counts(&chessman(49)).1, [false, true, false]);
    // One dent and it is over.
    let ring = generate::torus(1.0, 0.3, 48, 24);
    let mut dented = ring.positions.clone();
    dented[123] *= 0.9;
    assert_eq!(counts(&Mesh::new("dented", dented, Vec::new(), None, ring.triangles).unwrap()), (0, [false; 3], false));
    // A ball with a hole is none.
    let ball = generate::sphere(2.0, 4);
    let holed = Mesh::new("holed", ball.positions, Vec::new(), None, ball.triangles[1..].to_vec()).unwrap();
    assert!(!counts(&holed).2);
    // A turned torus has an axis, but none of the lattice's.
    let ring = generate::torus(1.0, 0.3, 48, 24);
    let turn = glam::Quat::from_axis_angle(Vec3::new(1.0, 2.0, 3.0).normalize(), 0.7);
    let turned = ring.positions.iter().map(|p| turn * *p).collect();
    let turned = Mesh::new("turned", turned, Vec::new(), None, ring.triangles).unwrap();
    assert_eq!(counts(&turned).1, [false; 3]);
    // The depth of a sphere's facets, and of the sides of a ring.
    let sphere = found(&generate::sphere(1.0, 4)).sphere.unwrap();
    assert!((5e-4..2e-3).contains(&sphere), "{sphere}");
    let sides = found(&chessman(50)).revolution[1].unwrap();
    let sagitta = 0.6 * (1.0 - (std::f64::consts::PI / 50.0).cos());
    assert!((0.8..1.3).contains(&(sides / sagitta)), "{sides} against {sagitta}");
}

#[test]
fn turned_samples_lead_to_captured_samples_that_lie_where_they_should() {
    for mesh in [generate::sphere(1.0, 3), generate::torus(1.0, 0.3, 48, 24), chessman(50)] {
        let surface = Surface::new(&unit_positions(&mesh), &mesh.triangles);
        let symmetry = found(&mesh);
        for lattice in ["cube:6x8", "cube:3x5", "cube:3x4,edges", "latlon:3x6x8"] {
            let lattice: bake::Options = bake::Options { lattice: lattice.parse().unwrap(), ..Default::default() };
            let lattice = lattice.lattice;
            let turned =
                symmetric_samples::plan(&lattice, &symmetry, 64, |s| surface.distance(lattice.position(s))).turned;
            let mut count = 0;
            for (sample, made) in turned.iter().enumerate() {
                let Some(made) = made else { continue };
                count += 1;
                assert!(turned[made.of as usize].is_none(), "{sample} is made of one that is not captured");
                let expected = lattice.position(sample as u32);
                assert!((made.turn * lattice.position(made.of)).distance(expected) < 1e-9, "{sample}: {made:?}");
                let limit = symmetric_samples::allowed(surface.distance(expected), 64);
                assert!(made.deviation <= limit, "{sample}: {} over {limit}", made.deviation);
            }
            report(&format!("{}, {lattice}: {count} of {}", mesh.name, turned.len()));
            assert!(2 * count > turned.len());
        }
    }
}

/// The field of a mesh, and how many samples were turned.
fn field(mesh: &Mesh, kind: FieldKind, lattice: &str, symmetry: bool) -> Option<(ShadowField, u32)> {
    let gpu = gpu()?;
    let options = bake::Options {
        lattice: lattice.parse().unwrap(),
        storage: Storage::F32,
        shortcuts: Shortcuts { symmetry, ..Default::default() },
        ..Default::default()
    };
    let baker = Baker::new(&gpu.device, &gpu.library);
    let (field, found) = baker.field(mesh, bake::header(mesh, kind, &options), &|_, _| ()).unwrap();
    let header = &field.header;
    assert_eq!(header.captured_samples + found.turned, header.lattice.sample_count(), "no sample is blind here");
    Some((field, found.turned))
}

#[test]
fn turned_fields_are_those_that_were_captured_whole() {
    let two = generate::torus_two_colour(1.0, 0.3, 48, 24);
    let cases = [
        // Exact symmetries: what is left is which of two texels a corner between them falls to.
        (generate::torus(1.0, 0.3, 48, 24), FieldKind::Occlusion, 1e-3),
        (two, FieldKind::Radiance, 2e-3),
        // Facets seen as up to a quarter of a texel: 0.0034 where faces are drawn, 0.0040 where they are computed.
        (chessman(50), FieldKind::Occlusion, 5e-3),
    ];
    let lattices = ["cube:5x4,outer=8", "cube:5x2,edges,outer=8"];
    for ((mesh, kind, most), text) in cases.iter().flat_map(|case| lattices.map(|text| (case, text))) {
        let (kind, most) = (*kind, *most);
        let Some((turned, count)) = field(mesh, kind, text, true) else { return };
        let (whole, same) = field(mesh, kind, text, false).unwrap();
        let lattice = whole.header.lattice;
        let shared = (0..lattice.direction_count()).filter(|&d| lattice.first_of(d) != d).count() as u32;
        assert_eq!(
            same,
            lattice.shells * shared,
            "{lattice}: what faces share is captured once, and no symmetry is used"
        );
        assert!(count > same && whole.header.symmetry == "off" && turned.header.symmetry != "none");
        let values = |field: &ShadowField| -> Vec<f64> {
            field.payload.chunks_exact(4).map(|b| f64::from(f32::from_le_bytes(b.try_into().unwrap()))).collect()
        };
        let (a, b) = (values(&turned), values(&whole));
        let off = a.iter().zip(&b).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
        let relative = (off / b.iter().map(|b| b * b).sum::<f64>()).sqrt();
        report(&format!("{}: {count} turned, relative root mean square {relative:.6}", mesh.name));
        assert!(relative < most, "{}: {relative}", mesh.name);
    }
}

#[test]
fn a_turned_sphere_is_as_near_to_the_closed_form_as_a_captured_one() {
    let mesh = generate::sphere(1.0, 4);
    let mut errors = Vec::new();
    for (text, symmetry) in [("cube:12x6", true), ("cube:12x6", false), ("cube:12x6,edges", true)] {
        let Some((field, turned)) = field(&mesh, FieldKind::Occlusion, text, symmetry) else { return };
        let lattice = field.header.lattice;
        let error = |near: f64, far: f64| {
            let mut rng = Rng::with_seed(2);
            let (mut off, mut all) = (0.0, 0.0);
            for _ in 0..400 {
                let direction = DVec3::new(rng.f64() - 0.5, rng.f64() - 0.5, rng.f64() - 0.5).normalize();
                let d = near + (far - near) * rng.f64();
                let mut stored = [0.0; MAX_COEFFICIENTS];
                field.lookup(d * direction, Lookup::Trilinear, 0, &mut stored);
                let expected = cap(4, -direction, (1.0 / d).asin());
                off += stored.iter().zip(&expected).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
                all += expected.iter().map(|b| b * b).sum::<f64>();
            }
            (off / all).sqrt()
        };
        errors.push([error(1.1, 2.0), error(2.5, 8.0)]);
        report(&format!(
            "{turned} of {} turned, against caps {:.5?}",
            lattice.sample_count(),
            errors[errors.len() - 1]
        ));
    }
    // Near by symmetries are exact; far off, the mean over a shell takes the place of what single texels round. Most of the error
    // is that of interpolation.
    for (turned, captured) in errors[0].iter().zip(errors[1]) {
        assert!((turned / captured - 1.0).abs() < 0.01, "{errors:?}");
    }
    // Seven steps along a row instead of six, in as many bytes: by the square of the step where directions decide.
    assert!(errors[2][0] < 0.9 * errors[0][0], "{errors:?}");
}

#[test]
fn transfer_of_symmetric_vertices_is_turned() {
    let Some(gpu) = gpu() else { return };
    let mesh = generate::torus(1.0, 0.4, 24, 12);
    let baker = Baker::new(&gpu.device, &gpu.library);
    let transfer = |symmetry: bool| {
        let shortcuts = Shortcuts { symmetry, ..Default::default() };
        baker.transfer(&mesh, &bake::Options { face_px: 32, shortcuts, ..Default::default() }, &|_, _| ()).unwrap()
    };
    let ((turned, about), (whole, none)) = (transfer(true), transfer(false));
    let off = turned.iter().zip(&whole).map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>();
    let relative = (off / whole.iter().map(|b| f64::from(b * b)).sum::<f64>()).sqrt();
    report(&format!("{} of {} turned, off by {relative:.6}", about.turned, mesh.positions.len()));
    assert!(none.turned == 0 && 10 * about.turned as usize > 8 * mesh.positions.len());
    // Faces of 32 texels make a binary cap's coefficients wrong by 0.0093 themselves.
    assert!(relative < 5e-3, "{relative}");
}
