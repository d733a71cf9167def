//! Baked fields: against closed forms, against each other, and through the cache.

mod cache;

use crate::common::{Gpu, generate, gpu, parse};
use fastrand::Rng;
use glam::{DVec3, Vec3};
use half::f16;
use shadow_fields::asset::Mesh;
use shadow_fields::bake::cache::Cache;
use shadow_fields::bake::project;
use shadow_fields::bake::surface::{Surface, inside, pushed_out};
use shadow_fields::bake::triangles::unit_positions;
use shadow_fields::bake::{self, SceneNeeds, TRANSFER_OFFSET, capture};
use shadow_fields::field::{FieldKind, ShadowField, Storage};
use shadow_fields::scene_buffers::SceneBuffers;
use shadow_fields::sh::lobe;
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

fn norm(values: impl IntoIterator<Item = f64>) -> f64 {
    values.into_iter().map(|v| v * v).sum::<f64>().sqrt()
}

fn difference(a: &[f64], b: &[f64]) -> f64 {
    norm(a.iter().zip(b).map(|(a, b)| a - b))
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
        let wanted = lobe::cap(4, -p.normalize(), p.length().recip().asin());
        difference(&found, &wanted) / norm(wanted)
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
    let own: Vec<u32> = {
        let planes = lattice.sources();
        let find = |d: u32| planes.iter().position(|s| *s == [d]).unwrap() as u32;
        (0..lattice.direction_count()).map(find).collect()
    };
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
        let faces: Vec<Vec<bool>> = (0..6).map(|f| capture::twin(&unit, &mesh.triangles, eye, f, px)).collect();
        let texel = |face: usize, x: usize, y: usize| {
            let covered: bool = faces[face][y * px as usize + x];
            [if covered { 0.0 } else { 1.0 }, 0.0, 0.0]
        };
        let scale = lattice.scale(lattice.distance(eye).max(lattice.inner)) as f32;
        let wanted = project::twin(4, FieldKind::Occlusion, px as usize, scale, texel);
        let stored = (sample / directions) as u32 * lattice.stored_direction_count() + own[sample % directions];
        for (k, wanted) in wanted.iter().enumerate() {
            let found = field.stored(stored, 0, k);
            // Two of 1 536 texels may lie on an edge.
            assert!(
                (found - wanted).abs() < 0.01 * (1.0 + wanted.abs()),
                "sample {sample}, {k}: {found}, not {wanted}"
            );
        }
    }
}

#[test]
fn one_colour_shines_where_it_blocks() {
    let Some(gpu) = gpu() else { return };
    let color = Vec3::new(0.5, 2.0, 7.0);
    for mesh in [torus(), generate::teapot(2)] {
        let colors = Some(vec![color; mesh.positions.len()]);
        let name = mesh.name.clone();
        let triangles = mesh.triangles.clone();
        let bright = Mesh::new(name, mesh.positions.clone(), mesh.normals.clone(), colors, triangles).unwrap();
        let options = small("cube:5x3", Storage::F32, 4);
        let blocked = bake_field(&gpu, &mesh, FieldKind::Occlusion, &options);
        let radiance = bake_field(&gpu, &bright, FieldKind::Radiance, &options);
        assert_eq!(radiance.header.radiance_scale, 7.0);
        let px = f64::from(radiance.header.face_px);
        let mut odd = 0;
        for sample in 0..blocked.header.lattice.stored_count() {
            let b: Vec<f64> = (0..16).map(|k| blocked.stored(sample, 0, k)).collect();
            for channel in 0..3 {
                let scale = f64::from(color[channel]);
                let wanted: Vec<f64> = b.iter().map(|b| scale * b).collect();
                let found: Vec<f64> = (0..16).map(|k| radiance.stored(sample, channel, k)).collect();
                let error = difference(&found, &wanted);
                if error <= 1e-3 * norm(wanted) {
                    continue;
                }
                // The two were captured at different places of an atlas: a texel whose centre an edge runs through may
                // fall to either side. Sixteen functions of such a direction make up sqrt(16 / 4 pi).
                odd += 1;
                let texel = 4.0 / (px * px) * (4.0 / std::f64::consts::PI).sqrt() * scale;
                assert!(error <= 2.0 * texel, "{}: sample {sample} channel {channel}: {error}", mesh.name);
            }
        }
        // Of a radiance field corners move to a grid of 1/256 of a texel. Where the blocked part is computed and not
        // drawn its corners do not, and then 63 channels of the teapot's samples differ by a texel.
        let most = if gpu.device.info.is_software() { 20 } else { 3 };
        assert!(
            100 * odd <= most * blocked.header.lattice.stored_count(),
            "{}: {odd} channels of samples differ",
            mesh.name
        );
    }
}

/// In the buffer of all fields each stands at its own place, as if it had been baked alone.
#[test]
fn a_field_lands_at_its_place_in_a_scene() {
    let Some(gpu) = gpu() else { return };
    let options = small("cube:3x3", Storage::F16, 4);
    let mesh =
        |name: &str, shape: &str| format!("[[mesh]]\nname = \"{name}\"\n{shape}\n[[entity]]\nmesh = \"{name}\"\n");
    let text = [
        "[environment]\nuniform = [1, 1, 1]\n[camera]\neye = [0, 0, 5]\ntarget = [0, 0, 0]\n".to_owned(),
        mesh("ball", "sphere = { radius_m = 1.0, subdivisions = 2 }"),
        mesh("ring", "torus = { major_m = 1.0, minor_m = 0.35, segments = 32, sides = 16 }"),
    ];
    let scene = parse(&text.concat());
    let needs = SceneNeeds::of(&scene, &options, shadow_fields::scene::Lights::Sh);
    let baked = bake::ensure(&gpu.baker(), &Cache::new(None), &scene, &needs, &|_, _, _| ()).unwrap();
    let buffers = SceneBuffers::new(&gpu.device, &scene, &options, baked).unwrap();
    let mut ends = Vec::new();
    for (mesh, device_mesh) in scene.meshes.iter().zip(&buffers.meshes) {
        let slot = device_mesh.blocked.as_ref().unwrap();
        let alone = bake_field(&gpu, mesh, FieldKind::Occlusion, &options);
        assert!(buffers.field(slot).unwrap() == alone, "{}: the same field", mesh.name);
        assert!(
            slot.bytes.start.is_multiple_of(256) && slot.bytes.end - slot.bytes.start == alone.header.payload_bytes()
        );
        ends.push(slot.bytes.clone());
    }
    assert!(ends[0].start == 0 && ends[0].end <= ends[1].start && ends[1].end <= buffers.fields.size_bytes);
}

/// A stored half is what rounding makes of the exact number, not merely near it: to the nearest, or towards zero, as
/// the device rounds; numbers below the least normal half may be stored as zero. Two shaders compute the number, so
/// that one of a thousand may fall to the other side. (Halves that are scaled by 0.9996 are all within one step of the
/// right ones, and most are wrong.)
#[test]
fn stored_halves_are_rounded_from_the_exact_numbers() {
    let Some(gpu) = gpu() else { return };
    let plain = torus();
    let colors = plain.positions.iter().map(|p| Vec3::new(3.0, 1.0 + p.x.abs(), 0.7)).collect();
    let bright =
        Mesh::new("bright", plain.positions.clone(), Vec::new(), Some(colors), plain.triangles.clone()).unwrap();
    for (mesh, kind) in [(plain, FieldKind::Occlusion), (bright, FieldKind::Radiance)] {
        let [exact, halves] = [Storage::F32, Storage::F16]
            .map(|storage| bake_field(&gpu, &mesh, kind, &small("cube:4x3", storage, 4)).payload);
        let exact = exact.chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap()));
        let halves = halves.chunks_exact(2).map(|b| f16::from_le_bytes(b.try_into().unwrap()));
        let (mut count, mut off_nearest, mut off_zero) = (0, 0, 0);
        for (exact, half) in exact.zip(halves).filter(|(exact, _)| exact.abs() >= f16::MIN_POSITIVE.to_f32()) {
            let nearest = f16::from_f32(exact);
            let beyond = nearest.to_f32().abs() > exact.abs();
            let towards_zero = if beyond { f16::from_bits(nearest.to_bits() - 1) } else { nearest };
            assert!(half.to_bits().abs_diff(nearest.to_bits()) <= 1, "{half} of {exact}");
            count += 1;
            off_nearest += usize::from(half != nearest);
            off_zero += usize::from(half != towards_zero);
        }
        assert!(count > 2000 && 1000 * off_nearest.min(off_zero) <= count, "{off_nearest} and {off_zero} of {count}");
    }
}
