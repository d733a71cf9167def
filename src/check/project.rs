//! "project" against its twin, which projects the same captured texels in f64.

use super::CheckRow;
use super::capture::{Way, atlas, capture_of, only_batch, texel_index};
use crate::asset::{Mesh, generate};
use crate::bake::Baker;
use crate::bake::capture::{Capture, Drawn, NO_SLOT, Slots};
use crate::bake::project::{self, Project, SampleFaces};
use crate::error::Result;
use crate::field::FieldKind;
use crate::field::quantity::channel_stride;
use crate::gpu::{Access, Buffer, Commands};
use glam::Vec3;

/// Sums of 25 000 f32 terms in shares of 64, relative to 1 + the sum; measured below 2e-6 on llvmpipe.
pub const F32: f64 = 1e-5;

/// Content of samples before they are written.
const SENTINEL: f32 = f32::NAN;

/// Captured faces on the device and on the host.
struct Content<'b> {
    baker: &'b Baker,
    capture: Capture,
    batch: Vec<Slots>,
    drawn: Drawn,
    texels: Vec<[f32; 3]>,
}

impl<'b> Content<'b> {
    fn new(baker: &'b Baker, mesh: &Mesh, eyes: &[Vec3], settings: (u32, FieldKind, bool)) -> Result<Self> {
        let capture = capture_of(baker, mesh, settings, Way::usual(baker.device()))?;
        let batch = only_batch(&capture, eyes);
        let texels = if settings.1 == FieldKind::Radiance {
            let atlas: Vec<[f32; 4]> = atlas(baker.device(), &capture, eyes, &batch)?;
            atlas.iter().map(|t| [t[0], t[1], t[2]]).collect()
        } else {
            let atlas: Vec<u8> = atlas(baker.device(), &capture, eyes, &batch)?;
            atlas.iter().map(|t| [f32::from(*t) / 255.0, 0.0, 0.0]).collect()
        };
        let drawn = capture.choose(eyes, &batch)?;
        Ok(Content { baker, capture, batch, drawn, texels })
    }

    /// The captured value of a texel.
    fn texel(&self, eye: usize, face: usize, x: usize, y: usize) -> [f32; 3] {
        match self.batch[eye][face] {
            // Faces outside the atlas show the background.
            NO_SLOT if self.capture.kind == FieldKind::Radiance => [0.0; 3],
            NO_SLOT => [1.0, 0.0, 0.0],
            slot => self.texels[texel_index(&self.capture, slot, x, y)],
        }
    }

    /// One capture and projection; every float of the coefficients, what was not written being no number.
    fn run(&self, project: &Project, samples: &[SampleFaces]) -> Result<Vec<f32>> {
        let device = self.baker.device();
        let stride = project.kind.channels() * channel_stride(project.bands);
        let coefficients = Buffer::with_data(device, "coefficients", &vec![SENTINEL; samples.len() * stride])?;
        let count = samples.len() as u32;
        let uploaded = Buffer::with_data(device, "samples with faces", samples)?;
        let mut commands = Commands::new(device, "check of captured faces")?;
        self.capture.record(&mut commands, &self.drawn, Access::ComputeSampled)?;
        let atlas = &self.capture.atlas;
        commands.pass("project", |c| project.record(c, atlas, &uploaded, &coefficients, count))?;
        commands.submit()?;
        coefficients.download(samples.len() * stride)
    }
}

/// The largest error relative to 1 + what is wanted, and the largest magnitude of what is wanted. Infinite where a
/// second run differs.
fn compare(content: &Content<'_>, bands: usize) -> Result<(f64, f64)> {
    let Capture { kind, face_px, .. } = content.capture;
    let project = Project::new(content.baker.device(), content.baker.library(), bands, &content.capture)?;
    // Samples have different scales.
    let sample = |(eye, &slots): (usize, &Slots)| SampleFaces { slots, scale: [1.0, 0.37, 2.5][eye % 3] };
    let samples: Vec<SampleFaces> = content.batch.iter().enumerate().map(sample).collect();
    let found = content.run(&project, &samples)?;
    let again = content.run(&project, &samples)?;
    let bits = |floats: &[f32]| floats.iter().map(|f| f.to_bits()).collect::<Vec<_>>();
    let stride = kind.channels() * channel_stride(bands);
    let mut worst = 0.0_f64;
    let mut largest = 0.0_f64;
    for (eye, sample) in samples.iter().enumerate() {
        let texel = |face, x, y| content.texel(eye, face, x, y);
        let wanted = project::twin(bands, kind, face_px as usize, sample.scale, texel);
        let first = eye * stride;
        for (found, wanted) in found[first..first + stride].iter().zip(&wanted) {
            let error = (f64::from(*found) - wanted).abs() / (1.0 + wanted.abs());
            worst = if error.is_nan() { f64::INFINITY } else { worst.max(error) };
            largest = largest.max(wanted.abs());
        }
    }
    let repeatable = bits(&found) == bits(&again);
    Ok((if repeatable { worst } else { f64::INFINITY }, largest))
}

/// Eyes near an object.
const EYES: [Vec3; 3] = [Vec3::new(0.9, 0.6, -0.5), Vec3::new(-0.4, 1.3, 2.0), Vec3::new(0.2, -0.1, -1.6)];

pub fn rows(baker: &Baker, add: &mut dyn FnMut(CheckRow)) -> Result<()> {
    let black = Content::new(baker, &generate::torus(1.0, 0.3, 32, 16), &EYES, (32, FieldKind::Occlusion, true))?;
    let bright =
        Content::new(baker, &generate::torus_two_colour(0.5, 0.15, 32, 16), &EYES, (32, FieldKind::Radiance, true))?;
    for bands in 2..=7 {
        for content in [&black, &bright] {
            let (worst, largest) = compare(content, bands)?;
            let worst = if largest > 0.01 { worst } else { f64::INFINITY };
            let what = format!("{}, {bands} bands", format!("{:?}", content.capture.kind).to_lowercase());
            add(CheckRow::new("project", what, "of 1 + coefficient", worst, F32));
        }
    }
    // Faces of this size stand in several rows of the atlas.
    let eyes: Vec<Vec3> = EYES.iter().flat_map(|eye| [*eye, -*eye, 1.5 * *eye, -1.5 * *eye]).collect();
    let large = Content::new(baker, &generate::torus(1.0, 0.3, 32, 16), &eyes, (128, FieldKind::Occlusion, true))?;
    let rows = large.batch.iter().flatten().any(|slot| *slot != NO_SLOT && *slot >= large.capture.columns);
    let (worst, _) = compare(&large, 4)?;
    let worst = if rows { worst } else { f64::INFINITY };
    add(CheckRow::new("project", "occlusion, 4 bands, 128 px", "of 1 + coefficient", worst, F32));
    Ok(())
}
