//! Decides which samples of a field are captured and from where, and how the others are made of them.

use super::TRANSFER_OFFSET;
use super::assemble::Sources;
use super::batches::CaptureTarget;
use super::project::Job;
use super::surface::{self, Surface};
use super::symmetric_samples::{self, SymmetricPlan};
use super::symmetry::Symmetry;
use super::triangles::distinct;
use super::triangles::unit_positions;
use crate::asset::Mesh;
use crate::error::Result;
use crate::field::{FieldHeader, FieldKind};
use glam::DVec3;

/// The samples of one field.
pub(super) struct FieldSamples {
    /// Samples that are captured, with the eye of each.
    pub targets: Vec<CaptureTarget>,
    /// Which samples are turned from which captured ones.
    pub plan: SymmetricPlan,
    /// The captured samples that each stored sample is assembled from.
    pub sources: Sources,
}

impl FieldSamples {
    /// Plans the samples of the field that `header` describes, and says in the header which symmetries the mesh has and how many
    /// samples lie inside the solid.
    ///
    /// # Errors
    /// `Input` when no sample can see the object.
    pub fn new(mesh: &Mesh, header: &mut FieldHeader) -> Result<Self> {
        let lattice = header.lattice;
        let positions: Vec<DVec3> = (0..lattice.sample_count()).map(|i| lattice.position(i)).collect();
        let surface = Surface::new(&unit_positions(mesh), &distinct(mesh));
        let mut inside =
            if header.shortcuts.inside { surface::inside(&surface, &positions) } else { vec![false; positions.len()] };
        let pushed = surface::pushed_out(&surface, &positions, &inside);
        let mut unseen: Vec<bool> = inside.iter().zip(&pushed).map(|(inside, eye)| *inside && eye.is_none()).collect();
        let plan = symmetry_plan(mesh, header, &surface, &inside);
        for (sample, captured) in
            plan.turned.iter().enumerate().filter_map(|(sample, turned)| Some((sample, turned.as_ref()?.of as usize)))
        {
            inside[sample] = inside[captured];
            unseen[sample] = unseen[captured];
        }
        header.filled_samples = inside.iter().filter(|i| **i).count() as u32;
        let sources = Sources::new(&lattice, &inside, &unseen)?;
        let mut targets = Vec::new();
        let captured =
            positions.iter().enumerate().filter(|(sample, _)| !unseen[*sample] && plan.turned[*sample].is_none());
        for (sample, position) in captured {
            let eye = pushed[sample].unwrap_or(*position);
            let scale = lattice.scale(lattice.distance(eye).max(lattice.inner)) as f32;
            let job = Job { normal: [0.0; 4], slots: [0; 6], target: sample as u32, scale };
            targets.push(CaptureTarget { eye: eye.as_vec3(), job });
        }
        Ok(FieldSamples { targets, plan, sources })
    }
}

/// Plans which samples are turned from which others, and names the symmetries in the header.
fn symmetry_plan(mesh: &Mesh, header: &mut FieldHeader, surface: &Surface, inside: &[bool]) -> SymmetricPlan {
    if !header.shortcuts.symmetry {
        header.symmetry = "off".to_owned();
        return SymmetricPlan { turned: symmetric_samples::same(&header.lattice), round: Vec::new() };
    }
    let symmetry = Symmetry::of(mesh, surface, header.kind == FieldKind::Radiance).kept_by(&header.lattice.fit());
    header.symmetry = symmetry.describe();
    let distance = |sample: u32| {
        let position = header.lattice.position(sample);
        match inside[sample as usize] {
            true => f64::from(TRANSFER_OFFSET),
            // A lower bound is enough for samples that are far off.
            false if position.length() > 2.0 => position.length() - 1.0,
            false => surface.distance(position),
        }
    };
    let plan = symmetric_samples::plan(&header.lattice, &symmetry, header.face_px, distance);
    let turned = plan.turned.iter().flatten().count();
    log::info!("{}: symmetries: {}; {turned} of {} samples turned", mesh.name, header.symmetry, inside.len());
    plan
}
