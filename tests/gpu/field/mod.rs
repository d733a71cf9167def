//! Baked fields: against closed forms and rays, and through the cache.

mod cache;

use crate::common::{Gpu, cap, generate, gpu, relative_rms};
use fastrand::Rng;
use glam::DVec3;
use shadow_fields::asset::Mesh;
use shadow_fields::bake::surface::{Surface, inside, pushed_out};
use shadow_fields::bake::triangles::unit_positions;
use shadow_fields::bake::{self, TRANSFER_OFFSET, capture, project};
use shadow_fields::field::{FieldKind, ShadowField, Storage};
use shadow_fields::sh::quadrature::random_direction;
use std::cell::RefCell;

fn quiet(_: u32, _: u32) {}

/// A small field for tests that are not about accuracy.
fn small(lattice: &str, storage: Storage, bands: usize) -> bake::Options {
    bake::Options { bands, storage, lattice: lattice.parse().unwrap(), face_px: 32, ..Default::default() }
}

/// A baked field, whose progress is told up to the end.
fn bake_field(gpu: &Gpu, mesh: &Mesh, kind: FieldKind, options: &bake::Options) -> ShadowField {
    let told = RefCell::new(Vec::new());
    let progress = |done, all| told.borrow_mut().push((done, all));
    let (field, report) = gpu.baker().field(mesh, bake::header(mesh, kind, options), &progress).unwrap();
    let header = &field.header;
    let told = told.into_inner();
    assert_eq!(told.last(), Some(&(header.captured_samples, header.captured_samples)));
    assert!(told.windows(2).all(|pair| pair[0].0 < pair[1].0), "{told:?}");
    assert_eq!(report.samples + report.filled, header.lattice.sample_count());
    for sample in 0..header.lattice.stored_count() {
        for number in 0..header.sample_stride() {
            let value = field.stored(sample, 0, number);
            assert!(value.is_finite(), "{}: sample {sample}, number {number} is {value}", header.mesh);
        }
    }
    field
}

#[test]
fn sphere_has_its_closed_form() {
    let Some(gpu) = gpu() else { return };
    let mesh = generate::sphere(2.5, 4);
    let field = bake_field(&gpu, &mesh, FieldKind::Occlusion, &bake::Options::default());
    assert_eq!(field.header.filled_samples, 0, "all shells lie outside");
    // Receivers log-uniform in distance from 1.05 r to 8 r, uniform in direction.
    let mut rng = Rng::with_seed(5);
    let errors = (0..1000).map(|_| {
        let p = random_direction(&mut rng) * 1.05 * (8.0_f64 / 1.05).powf(rng.f64());
        let mut found = [0.0; 16];
        field.lookup(p, 0, &mut found);
        let wanted = cap(4, -p.normalize(), p.length().recip().asin());
        relative_rms(found.into_iter().zip(wanted))
    });
    let errors: Vec<f64> = errors.collect();
    let mean = errors.iter().sum::<f64>() / errors.len() as f64;
    let largest = errors.iter().copied().fold(0.0, f64::max);
    // The bounds are those of an earlier lattice, 6 shells in equal steps of the logarithm: mean 0.032, largest 0.11.
    // The default has more shells, interpolates b / (1 - c), and stays below them.
    assert!(mean < 0.035 && largest < 0.12, "{mean} {largest}");
}

fn torus() -> Mesh {
    generate::torus(1.0, 0.35, 32, 16)
}

#[test]
fn samples_in_the_tube_are_filled_from_outside() {
    let Some(gpu) = gpu() else { return };
    let mesh = torus();
    let field = bake_field(&gpu, &mesh, FieldKind::Occlusion, &small("cube:10x5", Storage::F32, 4));
    let header = &field.header;
    let lattice = header.lattice;
    let positions: Vec<DVec3> = (0..lattice.sample_count()).map(|i| lattice.position(i)).collect();
    let unit = unit_positions(&mesh);
    let surface = Surface::new(&unit, &mesh.triangles);
    let marks = inside(&surface, &positions);
    // Closed form: in the tube where the distance from the ring's circle is below its radius, in units of 1.35.
    let from_circle = |p: DVec3| (DVec3::new(p.x, 0.0, p.z).length() - 1.0 / 1.35).hypot(p.y) * 1.35;
    for (p, mark) in positions.iter().zip(&marks) {
        let depth = 0.35 - from_circle(*p);
        // The mesh's facets lie up to 2 % inside the tube.
        assert!(depth.abs() < 0.02 || *mark == (depth > 0.0), "{p} is {depth} inside, marked {mark}");
    }
    let count = marks.iter().filter(|m| **m).count() as u32;
    assert!(count > 0 && header.filled_samples == count, "{} of {count}", header.filled_samples);

    // Each of them is captured just off the surface instead, outside.
    let eyes = pushed_out(&surface, &positions, &marks);
    let planes = lattice.sources();
    let own = |direction: u32| planes.iter().position(|s| *s == [direction]).unwrap() as u32;
    let directions = lattice.direction_count() as usize;
    let inside_samples = (0..positions.len()).filter(|s| marks[*s]);
    for (turn, sample) in inside_samples.enumerate() {
        let eye = eyes[sample].expect("a torus has no parts that run into each other");
        let off = from_circle(eye) - 0.35;
        assert!(off > -0.02 && off < 2.0 * f64::from(TRANSFER_OFFSET), "{eye} is {off} off the tube");
        if turn % 16 > 0 {
            continue;
        }
        // What it holds is what rays see from there.
        let px = field.header.face_px;
        let faces: Vec<_> = (0..6).map(|f| capture::twin(&unit, &mesh.triangles, eye, f, px)).collect();
        let texel = |face: usize, x: usize, y: usize| {
            let covered = faces[face][y * px as usize + x].is_some();
            [if covered { 0.0 } else { 1.0 }, 0.0, 0.0]
        };
        let scale = lattice.scale(lattice.distance(eye).max(lattice.inner)) as f32;
        let wanted = project::twin(4, FieldKind::Occlusion, px as usize, scale, texel);
        let stored =
            (sample / directions) as u32 * lattice.stored_direction_count() + own((sample % directions) as u32);
        for (k, wanted) in wanted.iter().enumerate() {
            let found = field.stored(stored, 0, k);
            // Two of 1 536 texels may lie on an edge.
            let off = (found - wanted).abs();
            assert!(off < 0.01 * (1.0 + wanted.abs()), "sample {sample}, {k}: {found}, not {wanted}");
        }
    }
}
