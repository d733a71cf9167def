//! A made-up merge of known size, for timing: a floor of vertices under turned occluders and a sky, every vertex
//! meeting every occluder, fields of one shape filled with a constant.

use crate::error::{Error, Result};
use crate::field::Lattice;
use crate::field::quantity::{Storage, channel_stride};
use crate::gpu::{Bind, Buffer, BufferKind, Commands, Device};
use crate::layout::{
    CLUSTER_FORMAT, CLUSTER_VERTICES, Cluster, DeviceEntity, ENTRY_FORMAT, ListEntry, NONE, QUAD_FORMAT,
};
use crate::lists::skip::Skip;
use crate::merge::variant::{MergePermutation, Reads, Variant, uniform_entities};
use crate::merge::{Merge, MergeInputs};
use crate::sh::rotation::turns;
use crate::shaders::Library;
use glam::{DQuat, DVec3};
use std::sync::Arc;

/// Bands of transfer and fields.
const BANDS: usize = 4;

pub struct Workload {
    /// Vertices that are lit.
    pub vertex_count: u32,
    /// Occluders that each of them meets.
    pub occluder_count: u32,
    lattice: Lattice,
    entity_limit: u32,
    entities: Buffer,
    entries: Buffer,
    clusters: Buffer,
    fields: Buffer,
    transfers: Buffer,
    vertices: Buffer,
    sky: Buffer,
    radiosity: Buffer,
}

impl Workload {
    /// `vertex_count` vertices (rounded up to whole clusters) on a square floor of 8 x 8 m under `occluder_count`
    /// occluders of 1 m radius with fields of default shape, f16 and 4 bands.
    pub fn new(device: &Arc<Device>, vertex_count: u32, occluder_count: u32) -> Result<Self> {
        let vertex_count = vertex_count.next_multiple_of(CLUSTER_VERTICES);
        let lattice = Lattice { inner: 1.0, ..Lattice::default() };
        let shift = lattice.packed();
        let (slope, offset) = lattice.radial_map();
        let entity_limit = uniform_entities(device);
        let count = (1 + occluder_count).max(entity_limit) as usize;
        let mut entities = vec![DeviceEntity::default(); count];
        for (i, entity) in entities.iter_mut().enumerate().take(1 + occluder_count as usize) {
            // Golden-angle spiral over the floor, so that all faces and shells of the fields are read. Entity 0 is the
            // floor.
            let angle = 2.4 * i as f64;
            let at = i as f64 / f64::from(occluder_count.max(1));
            let rotation = DQuat::from_axis_angle(DVec3::new(0.48, 0.6, 0.64), 0.7 + angle);
            let [a, b, c, d, e, f] = turns(if i == 0 { DQuat::IDENTITY } else { rotation }).map(|x| x as f32);
            let radius = 3.5 * at.sqrt();
            let height = if i == 0 { 0.0 } else { 1.5 };
            *entity = DeviceEntity {
                centre: [(radius * angle.cos()) as f32, height, (radius * angle.sin()) as f32, 1.0],
                alpha_beta: [a, b, c, d],
                gamma: [e, f],
                albedo: [0.3; 3],
                scale: 1.0,
                shift,
                radial: [slope as f32, offset as f32, lattice.inner as f32, lattice.outer as f32],
                ..Default::default()
            };
        }
        // Clusters are tiles of 8 x 8 vertices, as a mesh's are.
        let tiles = f64::from(vertex_count / CLUSTER_VERTICES).sqrt().ceil() as u32;
        let edge = CLUSTER_VERTICES.isqrt();
        let place = |tile: u32, inside: u32| 8.0 * (tile * edge + inside) as f32 / (tiles * edge) as f32 - 4.0;
        let vertices: Vec<[f32; 4]> = (0..vertex_count)
            .flat_map(|v| {
                let tile = v / CLUSTER_VERTICES;
                let inside = v % CLUSTER_VERTICES;
                let x = place(tile % tiles, inside % edge);
                let z = place(tile / tiles, inside / edge);
                [[x, 0.0, z, 0.0], [0.0, 1.0, 0.0, 0.0]]
            })
            .collect();
        let list: Vec<u32> =
            (1..=occluder_count).map(|entity| ListEntry::Occlude { entity, light: None }.pack()).collect();
        let cluster = |i: u32| Cluster {
            vertex_first: i * CLUSTER_VERTICES,
            vertex_count: CLUSTER_VERTICES,
            transfer_first: NONE,
            radiosity_first: i * CLUSTER_VERTICES,
            entry_count: occluder_count,
            ..Default::default()
        };
        let clusters: Vec<Cluster> = (0..vertex_count / CLUSTER_VERTICES).map(cluster).collect();
        let quads = lattice.stored_count() as usize * channel_stride(BANDS) / 4;
        // Small enough that the running product neither grows without end nor becomes denormal.
        const HALF: u16 = 0x2000;
        let fields = vec![[HALF; 4]; quads];
        Ok(Workload {
            vertex_count,
            occluder_count,
            lattice,
            entity_limit,
            entities: Buffer::with_data(device, "workload entities", &entities)?,
            entries: Buffer::with_data(device, "workload entries", &list)?,
            clusters: Buffer::with_data(device, "workload clusters", &clusters)?,
            fields: Buffer::with_data(device, "workload fields", &fields)?,
            transfers: Buffer::with_data(device, "workload transfers", &[0.0_f32; 4])?,
            vertices: Buffer::with_data(device, "workload vertices", &vertices)?,
            sky: Buffer::with_data(device, "workload sky", &[1.0_f32; 3 * BANDS * BANDS])?,
            radiosity: Buffer::new(device, "workload radiosity", BufferKind::Device, 16 * u64::from(vertex_count))?,
        })
    }

    pub fn pairs(&self) -> u64 {
        u64::from(self.vertex_count) * u64::from(self.occluder_count)
    }

    /// Bytes of the one field that all occluders share.
    pub fn field_bytes(&self) -> u64 {
        self.fields.size_bytes
    }

    pub fn permutation(&self, variant: Variant) -> MergePermutation {
        MergePermutation {
            gloss: false,
            variant,
            bands: BANDS,
            storage: Storage::F16,
            lattice: self.lattice,
            skip: Skip::NONE,
            lights: false,
            sheets: false,
            volume: false,
            entity_limit: self.entity_limit,
        }
    }

    fn inputs(&self, variant: Variant) -> Result<MergeInputs<'_>> {
        let read = |buffer, format| Bind::read(variant.reads == Reads::Texels, buffer, format);
        Ok(MergeInputs {
            through: None,
            entities: read(&self.entities, QUAD_FORMAT)?,
            entries: read(&self.entries, ENTRY_FORMAT)?,
            clusters: read(&self.clusters, CLUSTER_FORMAT)?,
            fields: read(&self.fields, self.permutation(variant).field_format())?,
            transfers: read(&self.transfers, QUAD_FORMAT)?,
            vertices: read(&self.vertices, QUAD_FORMAT)?,
            sky: read(&self.sky, QUAD_FORMAT)?,
        })
    }

    /// Milliseconds of every variant's merges, in turns, after one of each that compiles; `None` of a variant that the
    /// driver refuses to compile.
    pub fn time(&self, library: &Library, variants: &[Variant], runs: u32) -> Result<Vec<Option<Vec<f64>>>> {
        let device = self.radiosity.device();
        let mut merges = Vec::new();
        for &variant in variants {
            let merge = match Merge::new(device, library, self.permutation(variant)) {
                Err(error @ (Error::Failed(_) | Error::Shader(_))) => {
                    log::warn!("{} is not timed: {error}", variant.name);
                    None
                }
                other => Some((other?, self.inputs(variant)?, Vec::new())),
            };
            merges.push(merge);
        }
        for run in 0..=runs {
            for (merge, inputs, times) in merges.iter_mut().flatten() {
                let mut commands = Commands::new(device, "workload")?;
                let clusters = self.vertex_count / CLUSTER_VERTICES;
                commands.pass("merge", |commands| merge.record(commands, inputs, &self.radiosity, clusters))?;
                let milliseconds = commands.submit()?[0].milliseconds;
                if run > 0 {
                    times.push(milliseconds);
                }
            }
        }
        Ok(merges.into_iter().map(|merge| merge.map(|(_, _, times)| times)).collect())
    }
}
