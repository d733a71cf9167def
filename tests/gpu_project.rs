//! Projection and assembly on the device against their twins in f64.

mod common;

use common::{Gpu, gpu, pot, report, texel_index};
use fastrand::Rng;
use glam::Vec3;
use shadow_fields::asset::{Mesh, generate};
use shadow_fields::bake::assemble::{self, Assemble, Sources};
use shadow_fields::bake::capture::{Capture, Model, NO_SLOT, Slots};
use shadow_fields::bake::project::{self, Job, Project, Projection};
use shadow_fields::field::quantity::channel_stride;
use shadow_fields::field::{Lattice, Storage};
use shadow_fields::gpu::{Access, Buffer, Commands};
use std::f64::consts::PI;

/// Sums of 25 000 f32 terms in shares of 64; measured below 2e-6.
const F32: f64 = 1e-5;
/// Half an ulp of f16 is 4.9e-4 relative; below 6e-5 its steps are 6e-8.
const F16: f64 = 2e-3;

const SENTINEL: f32 = f32::NAN;

/// Captured faces on the device and on the host.
struct Content {
    name: &'static str,
    capture: Capture,
    model: Model,
    eyes: Vec<Vec3>,
    plan: Vec<Slots>,
    cull: bool,
    texels: Vec<[f32; 3]>,
}

impl Content {
    fn new(gpu: &Gpu, name: &'static str, mesh: &Mesh, eyes: &[Vec3], face_px: u32, radiance: bool) -> Self {
        let model = Model::new(&gpu.device, mesh, radiance).unwrap();
        let capture = Capture::new(&gpu.device, &gpu.library, face_px, radiance).unwrap();
        let plan = capture.plan(&model, eyes);
        assert_eq!(plan.len(), eyes.len());
        let cull = name != "all around";
        let texels = if radiance {
            let atlas: Vec<[f32; 4]> = gpu.atlas(&capture, &model, eyes, &plan, cull);
            atlas.iter().map(|t| [t[0], t[1], t[2]]).collect()
        } else {
            let atlas: Vec<u8> = gpu.atlas(&capture, &model, eyes, &plan, cull);
            atlas.iter().map(|t| [f32::from(*t) / 255.0, 0.0, 0.0]).collect()
        };
        Content { name, capture, model, eyes: eyes.to_vec(), plan, cull, texels }
    }

    fn texel(&self, eye: usize, face: usize, x: usize, y: usize, projection: Projection) -> [f32; 3] {
        match self.plan[eye][face] {
            // What is not in the atlas shows the background.
            NO_SLOT if projection == Projection::Radiance => [0.0; 3],
            NO_SLOT => [1.0, 0.0, 0.0],
            slot => self.texels[texel_index(&self.capture, slot, x, y)],
        }
    }
}

/// Jobs in another order than their targets, at different scales and normals.
fn jobs(content: &Content) -> Vec<Job> {
    let count = content.plan.len() as u32;
    content
        .plan
        .iter()
        .enumerate()
        .map(|(i, slots)| {
            let normal = [Vec3::new(0.48, -0.6, 0.64), Vec3::new(-0.8, 0.0, 0.6), Vec3::Y][i % 3];
            Job {
                normal: normal.extend(0.0).to_array(),
                slots: *slots,
                target: count - 1 - i as u32,
                scale: [1.0, 0.37, 2.5][i % 3],
            }
        })
        .collect()
}

/// One capture and projection; every float of the samples, what was not written being [`SENTINEL`].
fn run(gpu: &Gpu, content: &Content, project: &Project, jobs: &[Job]) -> Vec<f32> {
    let stride = project.projection.channels() * channel_stride(project.bands);
    let samples = Buffer::with_data(&gpu.device, "samples", &vec![SENTINEL; jobs.len() * stride]).unwrap();
    let mut job_buffer = Project::job_buffer(&gpu.device, jobs.len() as u32).unwrap();
    job_buffer.write(0, jobs);
    let texels = project.texel_view().unwrap();
    let Content { capture, model, eyes, plan, cull, .. } = content;
    let mut commands = Commands::new(&gpu.device, "project test").unwrap();
    commands.image_barrier(&capture.atlas, None, Access::ColorWrite);
    if let Some(depth) = capture.depth() {
        commands.image_barrier(depth, None, Access::DepthWrite);
    }
    commands.pass("capture", |c| capture.record(c, model, eyes, plan, *cull)).unwrap();
    commands.image_barrier(&capture.atlas, Some(Access::ColorWrite), Access::ComputeSampled);
    let count = jobs.len() as u32;
    commands.pass("project", |c| project.record(c, &capture.atlas, &job_buffer, &texels, &samples, count)).unwrap();
    commands.submit().unwrap();
    samples.download(jobs.len() * stride).unwrap()
}

/// The largest error in units of the tolerance.
fn compare(gpu: &Gpu, content: &Content, bands: usize, projection: Projection) -> f64 {
    let capture = &content.capture;
    let new = || Project::new(&gpu.device, &gpu.library, bands, projection, capture.face_px, capture.columns).unwrap();
    let (project, jobs) = (new(), jobs(content));
    let found = run(gpu, content, &project, &jobs);
    let again = run(gpu, content, &project, &jobs);
    let bits = |floats: &[f32]| floats.iter().map(|f| f.to_bits()).collect::<Vec<_>>();
    let place = format!("{}, {bands} bands, {projection:?}, {} px", content.name, capture.face_px);
    assert_eq!(bits(&found), bits(&again), "{place}: the second run differs");
    let stride = projection.channels() * channel_stride(bands);
    let mut worst = 0.0_f64;
    for (eye, job) in jobs.iter().enumerate() {
        let normal = Vec3::from_slice(&job.normal[..3]);
        let texel = |face, x, y| content.texel(eye, face, x, y, projection);
        let wanted = project::reference(bands, projection, capture.face_px as usize, normal, job.scale, texel);
        let first = job.target as usize * stride;
        // What all of the object hides has no transfer left, at scale 1.
        let empty = content.name == "all around" && projection == Projection::Transfer;
        assert!(empty || wanted.iter().any(|w| w.abs() > 0.01), "{place}: nothing to compare");
        for (k, (found, wanted)) in found[first..first + stride].iter().zip(&wanted).enumerate() {
            let error = (f64::from(*found) - wanted).abs();
            assert!(error <= F32 * (1.0 + wanted.abs()), "{place}: eye {eye}, number {k}: {found}, not {wanted}");
            worst = worst.max(error / (1.0 + wanted.abs()));
        }
    }
    worst
}

fn painted_pot() -> Mesh {
    let pot = pot(3);
    let colors = pot.normals.iter().map(|n| (*n + Vec3::ONE) * Vec3::new(0.5, 1.0, 3.0)).collect();
    Mesh::new("painted pot", pot.positions, pot.normals, Some(colors), pot.triangles).unwrap()
}

const EYES: [Vec3; 3] = [Vec3::new(0.9, 0.6, -0.5), Vec3::new(-0.4, 1.3, 2.0), Vec3::new(0.2, -0.1, -1.6)];

fn projections(bands: usize) {
    let Some(gpu) = gpu() else { return };
    let (pot, painted) = (pot(3), painted_pot());
    let closed = generate::cuboid(Vec3::ONE, 1);
    let mut worst = 0.0_f64;
    for face_px in [8, 32, 64] {
        let black = Content::new(&gpu, "teapot", &pot, &EYES, face_px, false);
        // From inside a solid, unculled, every texel is black; from far away all but a few are white.
        let inside = [Vec3::new(0.1, 0.05, -0.2)];
        let constant = Content::new(&gpu, "all around", &closed, &inside, face_px, false);
        for projection in [Projection::Blocked, Projection::Transfer] {
            worst = worst.max(compare(&gpu, &black, bands, projection));
            worst = worst.max(compare(&gpu, &constant, bands, projection));
        }
        let bright = Content::new(&gpu, "painted teapot", &painted, &EYES, face_px, true);
        worst = worst.max(compare(&gpu, &bright, bands, Projection::Radiance));
    }
    report(&format!("{bands} bands: largest error {worst:.2e}"));
}

#[test]
fn projections_to_2_bands() {
    projections(2);
}

#[test]
fn projections_to_3_bands() {
    projections(3);
}

#[test]
fn projections_to_4_bands() {
    projections(4);
}

#[test]
fn projections_to_5_bands() {
    projections(5);
}

#[test]
fn projections_to_6_bands() {
    projections(6);
}

#[test]
fn projections_to_7_bands() {
    projections(7);
}

/// Closed form: all blocked is sqrt(4 pi) in the constant band and nothing else; nothing blocked is nothing.
#[test]
fn constant_content_has_its_closed_form() {
    let Some(gpu) = gpu() else { return };
    let closed = generate::cuboid(Vec3::ONE, 1);
    let content = Content::new(&gpu, "all around", &closed, &[Vec3::ZERO], 32, false);
    let project = Project::new(&gpu.device, &gpu.library, 4, Projection::Blocked, 32, content.capture.columns).unwrap();
    let mut jobs = jobs(&content);
    jobs[0].scale = 1.0;
    let blocked = run(&gpu, &content, &project, &jobs);
    assert!((f64::from(blocked[0]) - (4.0 * PI).sqrt()).abs() < 1e-5, "{}", blocked[0]);
    // Bands 1 and 3 vanish by symmetry, band 2 up to the midpoint rule's error on 32 texels.
    assert!(blocked[1..].iter().all(|b| b.abs() < 1e-3), "{blocked:?}");
    jobs[0].slots = [NO_SLOT; 6];
    assert!(run(&gpu, &content, &project, &jobs).iter().all(|b| *b == 0.0));
}

#[test]
fn oversized_faces_are_refused() {
    let Some(gpu) = gpu() else { return };
    // More texels than maxTexelBufferElements, where the device's limit is low enough to try.
    let limit = gpu.device.limits.max_texel_buffer_elements;
    let face_px = f64::from(limit).sqrt() as u32 + 1;
    if face_px > 4096 {
        return report("the device's views hold more texels than are worth a test");
    }
    let refused = Project::new(&gpu.device, &gpu.library, 2, Projection::Blocked, face_px, 3);
    assert_eq!(refused.err().map(|error| error.exit_code()), Some(4));
}

#[test]
fn assembly_against_its_twin() {
    let Some(gpu) = gpu() else { return };
    let mut rng = Rng::with_seed(3);
    for (text, bands, channels) in [("cube:3x4,inner=0.3", 4, 1), ("latlon:2x3x5,inner=0.3", 3, 3), ("cube:1x1", 2, 3)]
    {
        let lattice: Lattice = text.parse().unwrap();
        let inside: Vec<bool> = (0..lattice.sample_count()).map(|i| i > 0 && rng.u32(..10) < 3).collect();
        let sources = Sources::new(&lattice, &inside).unwrap();
        let stride = channels * channel_stride(bands);
        // What lies inside is never to be used: NaN would show.
        let captured: Vec<f32> = inside
            .iter()
            .flat_map(|&inside| (0..stride).map(move |_| inside).collect::<Vec<_>>())
            .map(|inside| if inside { f32::NAN } else { 8.0 * rng.f32() - 4.0 })
            .collect();
        let wanted = assemble::reference(&captured, &sources, stride, 0.7);
        assert_eq!(wanted.len(), lattice.stored_count() as usize * stride);
        for storage in [Storage::F32, Storage::F16] {
            let pass = Assemble::new(&gpu.device, &gpu.library, storage).unwrap();
            let captured = Buffer::with_data(&gpu.device, "captured", &captured).unwrap();
            let offsets = Buffer::with_data(&gpu.device, "offsets", &sources.offsets).unwrap();
            let list = Buffer::with_data(&gpu.device, "list", &sources.list).unwrap();
            // Room before and behind, which must stay as it is.
            let size = wanted.len() * storage.bytes();
            let store = Buffer::with_data(&gpu.device, "store", &vec![0xab_u8; 256 + size + 256]).unwrap();
            let range = 256..256 + size as u64;
            let counts = (lattice.stored_count(), (stride / 4) as u32);
            let mut commands = Commands::new(&gpu.device, "assemble test").unwrap();
            commands
                .pass("assemble", |c| {
                    pass.record(c, [&captured, &offsets, &list], (&store, range.clone()), counts, 0.7)
                })
                .unwrap();
            commands.submit().unwrap();
            let bytes: Vec<u8> = store.download(256 + size + 256).unwrap();
            assert!(bytes[..256].iter().chain(&bytes[256 + size..]).all(|b| *b == 0xab), "{text}: wrote outside");
            let tolerance = if storage == Storage::F32 { F32 } else { F16 };
            for (k, (raw, wanted)) in bytes[256..256 + size].chunks_exact(storage.bytes()).zip(&wanted).enumerate() {
                let found = match storage {
                    Storage::F32 => f64::from(f32::from_le_bytes(raw.try_into().unwrap())),
                    Storage::F16 => half::f16::from_le_bytes(raw.try_into().unwrap()).to_f64(),
                };
                let error = (found - wanted).abs();
                assert!(error <= tolerance * (1.0 + wanted.abs()), "{text} {storage:?} {k}: {found}, not {wanted}");
            }
        }
    }
}

#[test]
fn what_lies_inside_is_filled_from_around() {
    let lattice: Lattice = "cube:4x3,inner=0.3".parse().unwrap();
    let count = lattice.sample_count() as usize;
    let directions = lattice.direction_count();
    // One sample inside: its replacement is the mean of its six neighbours, or five on the first shell.
    for (sample, neighbours) in [(directions + 4, 6), (4, 5), (3 * directions + 13, 5)] {
        let mut inside = vec![false; count];
        inside[sample as usize] = true;
        let sources = Sources::new(&lattice, &inside).unwrap();
        assert!(!sources.list.contains(&sample), "the raw capture is used");
        let own = lattice.sources().iter().position(|s| *s == [sample % directions]).unwrap() as u32;
        let stored = (sample / directions * lattice.stored_direction_count() + own) as usize;
        let list = &sources.list[sources.offsets[stored] as usize..sources.offsets[stored + 1] as usize];
        assert_eq!(list.len(), neighbours, "sample {sample}");
        for other in list {
            let step = lattice.position(*other).distance(lattice.position(sample));
            assert!(step < lattice.position(sample).length().max(6.0), "{other} is no neighbour of {sample}");
        }
    }
    assert_eq!(Sources::new(&lattice, &vec![true; count]).unwrap_err().exit_code(), 4);
    // All but one inside: everything is that one.
    let mut inside = vec![true; count];
    inside[100] = false;
    assert!(Sources::new(&lattice, &inside).unwrap().list.iter().all(|s| *s == 100));
}
