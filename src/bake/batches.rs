//! The captures of one bake. A batch fills the atlas once, and is captured in units that can be shared out among processes.
//!
//! Every face keeps the place in the atlas that the plan of the whole bake gives it, whichever process captures it and in whatever
//! order. What a face shows depends on nothing else, so the samples are the same bytes however the units are shared out.

use super::capture::{Capture, CaptureKind, Drawn, Model, NO_SLOT, Slots};
use super::levels;
use super::partial::Partial;
use super::project::{Job, Project, Projection};
use super::self_visibility::SelfVisibility;
use super::{BakeReport, Baker};
use crate::asset::Mesh;
use crate::error::Result;
use crate::field::Shortcuts;
use crate::field::quantity::channel_stride;
use crate::field::self_visibility::BYTES;
use crate::gpu::{Buffer, BufferKind, Commands};
use bytemuck::{Pod, Zeroable};
use glam::Vec3;
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// Most estimated seconds of a unit. It is long beside what a submission costs, and as long as processes wait for the last at the end.
const UNIT_SECONDS: f64 = 0.25;
/// Units that each of several processes has to take at least, where there are so many samples.
const UNITS_EACH: f64 = 4.0;
/// Seconds that llvmpipe takes on two cores a triangle that an eye sees, and a texel that is captured and reduced. No result depends on
/// them, only how work is shared out.
#[derive(Clone, Copy)]
pub(super) struct CaptureCost {
    triangle: f64,
    texel: f64,
}

impl CaptureCost {
    /// Where faces are drawn, as measured with the teapot and a torus of 69 696 triangles.
    pub const DRAWN: CaptureCost = CaptureCost { triangle: 1.7e-7, texel: 5.5e-8 };
    /// Where they are computed, as measured with rough balls of 2 028 and 69 312 triangles.
    pub const COMPUTED: CaptureCost = CaptureCost { triangle: 2.8e-8, texel: 8e-9 };
}

/// Share of the triangles of a closed mesh that are drawn, since chunks that show their backs are left out.
const FACING_SHARE: f64 = 0.5;

/// What the faces of a sample are reduced to.
#[derive(Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(super) enum Reduction {
    /// SH coefficients, in floats.
    Project { bands: usize, projection: Projection },
    /// A map of self-visibility, in bytes.
    SelfVisibility,
    /// The bytes of a transfer vector, and then a map of self-visibility.
    Vertex { bands: usize },
}

impl Reduction {
    /// Bands and kind of its projection, if it has one.
    fn projection(self) -> Option<(usize, Projection)> {
        match self {
            Reduction::Project { bands, projection } => Some((bands, projection)),
            Reduction::Vertex { bands } => Some((bands, Projection::Transfer)),
            Reduction::SelfVisibility => None,
        }
    }

    fn has_maps(self) -> bool {
        matches!(self, Reduction::SelfVisibility | Reduction::Vertex { .. })
    }

    /// What faces hold.
    fn captured(self) -> CaptureKind {
        match self {
            Reduction::Project { projection, .. } => CaptureKind::of_field(projection == Projection::Radiance),
            _ => CaptureKind::Distance,
        }
    }

    /// Bytes of a reduced sample.
    pub fn sample_bytes(self) -> usize {
        let floats = self.projection().map_or(0, |(bands, kind)| kind.channels() * channel_stride(bands));
        4 * floats + if self.has_maps() { BYTES } else { 0 }
    }
}

/// A pass that reduces faces, with its samples of one batch.
pub(super) struct Reduce<P> {
    pub pass: P,
    /// Reduced samples on the device.
    pub samples: Buffer,
    /// The reduced samples on their way to the host.
    pub results: Buffer,
    /// Bytes of a reduced sample.
    pub sample_bytes: usize,
}

impl<P> Reduce<P> {
    fn new(baker: &Baker, pass: P, sample_bytes: usize, capacity: u32) -> Result<Self> {
        let (device, bytes) = (baker.device(), u64::from(capacity) * sample_bytes as u64);
        let samples = Buffer::new(device, "batch samples", BufferKind::Device, bytes)?;
        let results = Buffer::new(device, "batch results", BufferKind::Readback, bytes)?;
        Ok(Reduce { pass, samples, results, sample_bytes })
    }

    /// The samples of the first targets, on the host.
    fn read(&self, count: usize) -> Vec<u8> {
        self.results.read(0, count * self.sample_bytes)
    }
}

/// What all captures of one bake share.
pub(super) struct Captures<'c> {
    pub mesh: &'c Mesh,
    pub reduction: Reduction,
    pub face_px: u32,
    pub shortcuts: Shortcuts,
    /// Whether levels of detail are drawn.
    pub levels: bool,
    pub partial: &'c Partial,
}

/// A sample to capture: the place of its eye, and how its faces are reduced. Once it is planned, the job holds the places of the faces.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
pub(super) struct CaptureTarget {
    /// The place of the eye, in r.
    pub eye: Vec3,
    pub job: Job,
}

/// Targets that are captured together, and the estimate of what they take.
pub(super) struct Unit {
    pub first: u32,
    pub count: u32,
    pub seconds: f64,
}

impl Unit {
    pub fn targets(&self) -> Range<usize> {
        self.first as usize..(self.first + self.count) as usize
    }
}

/// What every batch works with.
pub(super) struct Batches {
    pub capture: Capture,
    pub project: Option<Reduce<Project>>,
    pub self_visibility: Option<Reduce<SelfVisibility>>,
    pub model: Model,
    pub jobs: Buffer,
    /// Whether backs of closed meshes are left out. Only an eye inside the solid would see them.
    pub culls: bool,
    /// Estimated seconds that a triangle around an eye takes.
    triangle_seconds: f64,
    /// Estimated seconds that a face takes without its triangles.
    face_seconds: f64,
}

/// Samples whose faces fit into one atlas, and what is drawn into these.
pub(super) struct Batch {
    pub drawn: Drawn,
    /// Number of samples.
    pub count: usize,
}

fn facing_share(mesh: &Mesh) -> f64 {
    if mesh.is_closed() { FACING_SHARE } else { 1.0 }
}

/// Estimated seconds of captures on a software device: of `eyes` that see the mesh in `faces` of `face_px`.
pub(super) fn estimated_seconds(
    cost: CaptureCost,
    (mesh, levels): (&Mesh, bool),
    eyes: u64,
    faces: u64,
    face_px: u32,
) -> f64 {
    let triangles = levels::estimated_triangles(mesh, levels) * facing_share(mesh) * eyes as f64;
    triangles * cost.triangle + faces as f64 * f64::from(face_px).powi(2) * cost.texel
}

/// Faces of a sample that are in the atlas.
fn face_count(slots: &Slots) -> u32 {
    slots.iter().filter(|slot| **slot != NO_SLOT).count() as u32
}

impl Batches {
    /// The resources of a bake.
    ///
    /// # Errors
    /// As [`Capture::new`]; `Device` when memory ran out.
    pub fn new(baker: &Baker, captures: &Captures<'_>) -> Result<Self> {
        let kind = captures.reduction.captured();
        let (device, library) = (baker.device(), baker.library());
        let mut capture = Capture::new(device, library, captures.face_px, kind)?;
        capture.skips = captures.shortcuts.faces;
        let model = match captures.levels {
            true => Model::with_levels(device, captures.mesh, baker.leveled(captures.mesh)?)?,
            false => Model::new(device, captures.mesh, kind == CaptureKind::Radiance)?,
        };
        let is_drawn = device.info.is_software() && !capture.computes(&model);
        let cost = if is_drawn { CaptureCost::DRAWN } else { CaptureCost::COMPUTED };
        let Captures { reduction, face_px, .. } = *captures;
        let (columns, capacity) = (capture.columns, capture.capacity());
        let maps_bytes = if reduction.has_maps() { BYTES } else { 0 };
        let project = reduction.projection().map(|(bands, projection)| {
            let pass = Project::new(device, library, bands, projection, face_px, columns)?;
            Reduce::new(baker, pass, reduction.sample_bytes() - maps_bytes, capacity)
        });
        let self_visibility = reduction
            .has_maps()
            .then(|| Reduce::new(baker, SelfVisibility::new(device, library, face_px, columns)?, maps_bytes, capacity));
        Ok(Batches {
            project: project.transpose()?,
            self_visibility: self_visibility.transpose()?,
            model,
            jobs: Project::job_buffer(device, capacity)?,
            culls: captures.shortcuts.inside,
            triangle_seconds: cost.triangle * facing_share(captures.mesh),
            face_seconds: estimated_seconds(cost, (captures.mesh, captures.levels), 0, 1, face_px),
            capture,
        })
    }

    /// Gives every face of every target its place in the atlas, batch after batch, and cuts the batches into units for so many
    /// processes. Returns the targets that are captured: those whose factor is 0 are left out if they are projected and nothing else.
    pub fn plan(&self, targets: &[CaptureTarget], jobs: usize) -> (Vec<CaptureTarget>, Vec<Unit>) {
        let eyes: Vec<Vec3> = targets.iter().map(|target| target.eye).collect();
        let (mut planned, mut units) = (Vec::with_capacity(targets.len()), Vec::new());
        let mut first = 0;
        let outlooks = self.capture.look(&self.model, &eyes);
        while first < targets.len() {
            let slots = self.capture.places(&outlooks[first..]);
            let mut unit = Unit { first: planned.len() as u32, count: 0, seconds: 0.0 };
            for ((target, slots), outlook) in targets[first..].iter().zip(&slots).zip(&outlooks[first..]) {
                if target.job.scale == 0.0 && self.self_visibility.is_none() {
                    continue;
                }
                planned.push(CaptureTarget { job: Job { slots: *slots, ..target.job }, ..*target });
                unit.count += 1;
                unit.seconds +=
                    self.triangle_seconds * outlook.triangles as f64 + self.face_seconds * f64::from(face_count(slots));
            }
            units.extend((unit.count > 0).then_some(unit));
            first += slots.len();
        }
        let seconds: f64 = units.iter().map(|unit| unit.seconds).sum();
        let most = if jobs > 1 { UNIT_SECONDS.min(seconds / (UNITS_EACH * jobs as f64)) } else { UNIT_SECONDS };
        let cut = units.iter().flat_map(|batch| {
            let parts = (batch.seconds / most).ceil().clamp(1.0, f64::from(batch.count)) as u32;
            let at = move |part: u32| (u64::from(batch.count) * u64::from(part) / u64::from(parts)) as u32;
            (0..parts).map(move |part| Unit {
                first: batch.first + at(part),
                count: at(part + 1) - at(part),
                seconds: batch.seconds / f64::from(parts),
            })
        });
        (planned, cut.collect())
    }

    /// Captures planned targets of one batch and returns their reduced samples, one after another.
    ///
    /// # Errors
    /// What recording and submitting return.
    pub fn run_unit(&mut self, targets: &[CaptureTarget], report: &mut BakeReport) -> Result<Vec<u8>> {
        let numbered = targets.iter().enumerate();
        let jobs: Vec<Job> = numbered.map(|(i, target)| Job { target: i as u32, ..target.job }).collect();
        self.jobs.write(0, &jobs);
        let eyes: Vec<Vec3> = targets.iter().map(|target| target.eye).collect();
        let slots: Vec<Slots> = targets.iter().map(|target| target.job.slots).collect();
        let drawn = self.capture.choose(&self.model, &eyes, &slots, self.culls)?;
        let batch = Batch { drawn, count: targets.len() };
        let texels = self.project.as_ref().map(|project| project.pass.texel_view()).transpose()?;
        let mut commands = Commands::new(self.jobs.device(), "bake batch")?;
        super::record_batch(&mut commands, self, &batch, texels.as_ref())?;
        report.add(&commands.submit()?);
        report.faces += slots.iter().map(face_count).sum::<u32>();
        report.triangles += batch.drawn.triangles();
        let count = targets.len();
        let floats = self.project.as_ref().map_or(Vec::new(), |project| project.read(count));
        let maps = self.self_visibility.as_ref().map_or(Vec::new(), |maps| maps.read(count));
        if floats.is_empty() || maps.is_empty() {
            return Ok([floats, maps].concat());
        }
        let pairs = floats.chunks_exact(floats.len() / count).zip(maps.chunks_exact(maps.len() / count));
        Ok(pairs.flat_map(|(floats, map)| [floats, map].concat()).collect())
    }

    /// Most targets that one unit may hold.
    pub fn capacity(&self) -> u32 {
        self.capture.capacity()
    }
}
