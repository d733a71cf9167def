//! "capture" against rays cast through the centres of its texels.

use super::CheckRow;
use crate::asset::{Mesh, generate};
use crate::bake::Baker;
pub use crate::bake::capture::Way;
use crate::bake::capture::{self, Capture, Model, NO_SLOT, Slots};
use crate::bake::triangles::unit_positions;
use crate::error::Result;
use crate::field::FieldKind;
use crate::gpu::{Access, Commands, Device};
use crate::sh::cube::FACE_COUNT;
use bytemuck::Pod;
use glam::{DVec3, Vec3};
use std::sync::Arc;

/// Share of texels whose centres may lie so near an edge that device and rays disagree: 1e-3 where corners snap to
/// 1/256 of a texel, and in proportion to that step on other devices (Vulkan asks for 1/16).
pub fn differing_limit(device: &Device) -> f64 {
    1e-3 * snapping(device)
}

/// How far corners move before rasterisation, in 1/256 of a pixel.
pub(super) fn snapping(device: &Device) -> f64 {
    256.0 * device.snap_px().max(1.0 / 256.0)
}

/// Colours interpolated in f32, relative: a few roundings, of which those near a silhouette are the largest.
const COLOR: f64 = 1e-4;

/// Captures the faces of a batch and brings the atlas to the host: one `T` a texel.
pub fn atlas<T: Pod>(device: &Arc<Device>, capture: &Capture, eyes: &[Vec3], slots: &[Slots]) -> Result<Vec<T>> {
    let drawn = capture.choose(eyes, slots)?;
    let mut commands = Commands::new(device, "capture to host")?;
    capture.record(&mut commands, &drawn, Access::TransferRead)?;
    commands.submit()?;
    capture.atlas.download()
}

/// Place of texel (x, y) of a slot in what [`atlas`] returns.
pub fn texel_index(capture: &Capture, slot: u32, x: usize, y: usize) -> usize {
    let columns = capture.columns as usize;
    let px = capture.face_px as usize;
    let column = slot as usize % columns;
    let row = slot as usize / columns;
    (row * px + y) * columns * px + column * px + x
}

/// Captures of a mesh in faces of `face_px`. Backs of triangles are left out of a closed mesh where `cull` is set.
pub fn capture_of(
    baker: &Baker,
    mesh: &Mesh,
    (face_px, kind, cull): (u32, FieldKind, bool),
    way: Way,
) -> Result<Capture> {
    let device = baker.device();
    let mut model = Model::new(device, mesh, kind)?;
    model.closed &= cull;
    Capture::new(device, baker.library(), model, face_px, kind, way)
}

/// The slots of all eyes, which fit into one atlas.
pub fn only_batch(capture: &Capture, eyes: &[Vec3]) -> Vec<Slots> {
    let mut batches = capture.plan(eyes);
    assert_eq!(batches.len(), 1, "all eyes fit one atlas");
    batches.remove(0)
}

/// The texels of every eye's faces in rows; `None` where a face was not drawn.
pub fn faces<T: Pod>(
    baker: &Baker,
    mesh: &Mesh,
    eyes: &[Vec3],
    settings: (u32, FieldKind, bool),
    way: Way,
) -> Result<Vec<[Option<Vec<T>>; FACE_COUNT]>> {
    let capture = capture_of(baker, mesh, settings, way)?;
    let batch = only_batch(&capture, eyes);
    let atlas: Vec<T> = atlas(baker.device(), &capture, eyes, &batch)?;
    let px = capture.face_px as usize;
    let face = |slot: u32| {
        let texels = (0..px * px).map(|i| atlas[texel_index(&capture, slot, i % px, i / px)]);
        (slot != NO_SLOT).then(|| texels.collect())
    };
    Ok(batch.iter().map(|slots| slots.map(face)).collect())
}

/// How captured coverage and rays agree.
#[derive(Clone, Copy, Debug, Default)]
pub struct Coverage {
    /// Texels of all drawn faces.
    pub texels: usize,
    /// Texels of them that the object covers.
    pub covered: usize,
    /// Texels on which the two disagree.
    pub differing: usize,
    /// Differing texels away from every edge of the object: must be 0.
    pub off_edge: usize,
    /// Faces that were not drawn.
    pub left_out: usize,
    /// Faces that were not drawn although rays meet the object in them: must be 0.
    pub left_out_wrongly: usize,
}

impl Coverage {
    /// Share of differing texels; infinite where anything is wrong that no rounding explains, or nothing was seen.
    pub fn error(&self) -> f64 {
        let wrong = self.off_edge + self.left_out_wrongly > 0;
        let nothing = self.covered <= self.texels / 50 || self.covered == self.texels;
        if wrong || nothing { f64::INFINITY } else { self.differing as f64 / self.texels as f64 }
    }
}

/// Whether a texel, or one that touches it, differs from it, or it lies on the face's rim, where neighbours are
/// unknown.
fn is_edge(covered: &[bool], px: usize, x: usize, y: usize) -> bool {
    if x == 0 || y == 0 || x + 1 == px || y + 1 == px {
        return true;
    }
    let around = (y - 1..=y + 1).flat_map(|v| (x - 1..=x + 1).map(move |u| covered[v * px + u]));
    let count = around.filter(|c| *c).count();
    (1..9).contains(&count)
}

/// Captures coverage and casts the rays.
pub fn coverage(baker: &Baker, mesh: &Mesh, eyes: &[Vec3], face_px: u32, way: Way) -> Result<Coverage> {
    let positions = unit_positions(mesh);
    let mut out = Coverage::default();
    for (eye, faces) in eyes.iter().zip(faces::<u8>(baker, mesh, eyes, (face_px, FieldKind::Occlusion, true), way)?) {
        for (face, texels) in faces.iter().enumerate() {
            let met = capture::twin(&positions, &mesh.triangles, eye.as_dvec3(), face, face_px);
            let wanted: Vec<bool> = met.iter().map(Option::is_some).collect();
            let Some(texels) = texels else {
                out.left_out += 1;
                out.left_out_wrongly += usize::from(wanted.iter().any(|c| *c));
                continue;
            };
            let px = face_px as usize;
            for (i, (texel, wanted_here)) in texels.iter().zip(&wanted).enumerate() {
                // 0 is the object, 255 the background; nothing between them is written.
                let agrees = *texel == if *wanted_here { 0 } else { 255 };
                let explained = matches!(texel, 0 | 255) && is_edge(&wanted, px, i % px, i / px);
                out.differing += usize::from(!agrees);
                out.off_edge += usize::from(!agrees && !explained);
            }
            out.texels += texels.len();
            out.covered += texels.iter().filter(|t| **t == 0).count();
        }
    }
    Ok(out)
}

/// Share of the texels whose captured colour is farther from that of the nearest thing that a ray meets than a few
/// roundings and a snapped corner explain: some devices interpolate between corners where they were, others between
/// corners where they snapped to. Infinite where nothing was seen.
pub fn colors(baker: &Baker, mesh: &Mesh, eyes: &[Vec3], face_px: u32) -> Result<f64> {
    let step = snapping(baker.device()) / 256.0;
    let positions = unit_positions(mesh);
    let white = vec![Vec3::ONE; positions.len()];
    let colors = mesh.colors.as_ref().unwrap_or(&white);
    let mut texels = 0;
    let mut differing = 0;
    let mut lit = 0;
    for (eye, faces) in
        eyes.iter().zip(faces::<[f32; 4]>(baker, mesh, eyes, (face_px, FieldKind::Radiance, true), Way::Drawn)?)
    {
        for (face, found) in faces.iter().enumerate() {
            let color = |(corners, weights): ([u32; 3], [f64; 3])| {
                let corners = corners.map(|i| colors[i as usize].as_dvec3());
                corners.iter().zip(weights).map(|(color, weight)| *color * weight).sum::<DVec3>()
            };
            let met = capture::twin(&positions, &mesh.triangles, eye.as_dvec3(), face, face_px);
            let expected: Vec<DVec3> = met.into_iter().map(|met| met.map_or(DVec3::ZERO, color)).collect();
            for (i, wanted) in expected.iter().enumerate() {
                let found = found.as_ref().map_or([0.0; 3], |texels| [texels[i][0], texels[i][1], texels[i][2]]);
                let found = Vec3::from_array(found).as_dvec3();
                let snapped = step * largest_difference(&expected, i, face_px as usize);
                // Written so that what is no number differs.
                let agrees = (found - *wanted).length() <= COLOR * (1.0 + wanted.length()) + snapped;
                differing += usize::from(!agrees);
                lit += usize::from(wanted.length() > 0.0);
                texels += 1;
            }
        }
    }
    Ok(if lit == 0 { f64::INFINITY } else { f64::from(differing as u32) / texels as f64 })
}

/// The largest difference between the colour of a texel and those of its neighbours in its row and column.
fn largest_difference(colors: &[DVec3], texel: usize, width: usize) -> f64 {
    let x = texel % width;
    let sides = [
        (x > 0).then(|| texel - 1),
        (x + 1 < width).then(|| texel + 1),
        texel.checked_sub(width),
        (texel + width < colors.len()).then(|| texel + width),
    ];
    sides.into_iter().flatten().map(|side| (colors[side] - colors[texel]).length()).fold(0.0, f64::max)
}

/// Eyes all around: on the axes, at odd angles, near and far.
pub fn eyes_outside() -> Vec<Vec3> {
    vec![
        Vec3::new(1.02, 0.0, 0.0),
        Vec3::new(0.0, -1.3, 0.01),
        Vec3::new(0.7, 0.8, -0.4),
        Vec3::new(-2.0, 1.1, 0.6),
        Vec3::new(0.3, 0.2, 7.9),
    ]
}

pub fn rows(baker: &Baker, add: &mut dyn FnMut(CheckRow)) -> Result<()> {
    let measure = "share of texels";
    let limit = differing_limit(baker.device());
    let rings = generate::torus_two_colour(0.5, 0.15, 32, 16);
    for (way, word) in [(Way::Drawn, "drawn"), (Way::Computed, "computed")] {
        for mesh in [generate::sphere(0.5, 3), generate::torus(1.0, 0.3, 32, 16)] {
            let found = coverage(baker, &mesh, &eyes_outside(), 32, way)?;
            add(CheckRow::new("capture", format!("coverage, {}, {word}", mesh.name), measure, found.error(), limit));
        }
    }
    let found = colors(baker, &rings, &eyes_outside(), 32)?;
    // Silhouettes and the seams where two colours meet count here too.
    add(CheckRow::new("capture", format!("radiance, {}", rings.name), measure, found, 2.0 * limit));
    Ok(())
}
