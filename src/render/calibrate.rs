//! Which variant of the merge is fastest on a device: measured once on a small made-up scene and kept in the cache folder.

use super::merge::{Inputs, Merge, Readable, rotation_stride};
use super::variant::{Form, Skip, VARIANTS, Variant, uniform_entities};
use crate::error::Result;
use crate::field::quantity::{Storage, channel_stride};
use crate::field::{Lattice, Lookup};
use crate::gpu::{Buffer, BufferKind, Commands, Device};
use crate::layout::{CLUSTER_VERTICES, Cluster, Entity, NONE, Step};
use crate::shaders::Library;
use ash::vk;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;
use std::sync::Arc;

/// What was measured on a device.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Calibration {
    /// Driver in its own words; another driver is measured anew.
    pub driver: String,
    /// Version of this program; its shaders differ from another's.
    pub program: String,
    /// Name of the fastest variant.
    pub fastest: String,
    /// Milliseconds of the made-up scene, by variant.
    pub milliseconds: Vec<(String, f64)>,
}

/// Vertices of the made-up scene: some hundred workgroups, so that every core has work.
const VERTICES: u32 = 16_384;
/// Occluders that each vertex meets.
const OCCLUDERS: u32 = 8;
/// Timed runs of each variant, interleaved; the least counts, since noise only adds.
const RUNS: usize = 5;

fn path(device: &Device) -> Option<PathBuf> {
    Some(device.cache_dir.as_ref()?.join(format!("calibration-{}.json", device.info.uuid)))
}

/// The device's fastest variant: from the cache folder, else measured and kept there. Without a cache folder nothing is
/// measured and the device gets [`Variant::sane_default`].
///
/// # Errors
/// As [`measure`].
pub fn fastest(device: &Arc<Device>, library: &Library) -> Result<Variant> {
    let Some(path) = path(device) else { return Ok(Variant::sane_default(device)) };
    let known = std::fs::read(&path).ok().and_then(|bytes| serde_json::from_slice::<Calibration>(&bytes).ok());
    let known = known.filter(|c| c.driver == device.info.driver && c.program == env!("CARGO_PKG_VERSION"));
    if let Some(variant) = known.and_then(|c| Variant::named(&c.fastest).ok()) {
        return Ok(variant);
    }
    let calibration = measure(device, library)?;
    for (name, milliseconds) in &calibration.milliseconds {
        log::info!("calibration: {name} {milliseconds:.3} ms");
    }
    let bytes = serde_json::to_vec_pretty(&calibration).expect("a calibration is plain data");
    if let Err(error) = crate::files::replace(&path, &bytes) {
        log::warn!("{}: the calibration was not kept: {error}", path.display());
    }
    Variant::named(&calibration.fastest)
}

/// Times every variant on a made-up scene: a sky and some turned occluders with fields of default shape.
///
/// # Errors
/// `Failed` when a shader does not compile, `Device` when the device is lost.
pub fn measure(device: &Arc<Device>, library: &Library) -> Result<Calibration> {
    let lattice = Lattice::default().starting_at(1.0);
    let bands = 4;
    let (slope, offset) = lattice.radial_map();
    let entity = |x: f32| Entity {
        centre: [x, 1.5, 0.3, 1.0],
        to_object_x: [0.36, 0.48, -0.8, 0.0],
        to_object_y: [-0.8, 0.6, 0.0, 0.0],
        to_object_z: [0.48, 0.64, 0.6, 0.0],
        albedo: [0.3, 0.3, 0.3, 1.0],
        radial: [slope as f32, offset as f32, lattice.inner as f32, lattice.outer as f32],
        ..Default::default()
    };
    let mut entities: Vec<Entity> = (0..=OCCLUDERS).map(|i| entity(i as f32 - 4.0)).collect();
    entities[0].centre = [0.0, 0.0, 0.0, 1.0];
    let edge = VERTICES.isqrt();
    let vertices: Vec<[f32; 4]> = (0..VERTICES)
        .flat_map(|v| {
            let place = |i: u32| 8.0 * i as f32 / edge as f32 - 4.0;
            [[place(v % edge), 0.0, place(v / edge), 0.0], [0.0, 1.0, 0.0, 0.0]]
        })
        .collect();
    let limit = uniform_entities(device, bands);
    let padded = |name: &str, bytes: usize| {
        let count = entities.len().max(limit as usize);
        Buffer::new(device, name, BufferKind::Upload, (count * bytes) as u64)
    };
    let mut entity_buffer = padded("calibration entities", size_of::<Entity>())?;
    entity_buffer.write(0, &entities);
    let mut rotations = padded("calibration rotations", 4 * rotation_stride(bands))?;
    rotations.write(0, &vec![0.1_f32; entities.len() * rotation_stride(bands)]);
    let list: Vec<u32> = (1..=OCCLUDERS).map(|entity| Step::Occlude { entity, light: None }.pack()).collect();
    let steps = Buffer::with_data(device, "calibration steps", &list)?;
    let cluster = |i: u32| Cluster {
        vertex_first: i * CLUSTER_VERTICES,
        vertex_count: CLUSTER_VERTICES,
        transfer_first: NONE,
        radiosity_first: i * CLUSTER_VERTICES,
        step_count: OCCLUDERS,
        ..Default::default()
    };
    let list: Vec<Cluster> = (0..VERTICES / CLUSTER_VERTICES).map(cluster).collect();
    let clusters = Buffer::with_data(device, "calibration clusters", &list)?;
    let quads = lattice.stored_count() as usize * channel_stride(bands) / 4;
    // Small enough that the running product neither grows without end nor becomes denormal.
    let fields = Buffer::with_data(device, "calibration fields", &vec![[0x2000_2000_u32; 2]; quads])?;
    let transfers = Buffer::with_data(device, "calibration transfers", &[0.0_f32; 4])?;
    let vertices = Buffer::with_data(device, "calibration vertices", &vertices)?;
    let sky = Buffer::with_data(device, "calibration sky", &vec![[1.0_f32; 4]; bands * bands])?;
    let radiosity = Buffer::new(device, "calibration radiosity", BufferKind::Device, 16 * u64::from(VERTICES))?;
    let floats = vk::Format::R32G32B32A32_SFLOAT;
    let mut contenders = Vec::new();
    for &variant in VARIANTS {
        let form = Form {
            variant,
            bands,
            storage: Storage::F16,
            lattice,
            lookup: Lookup::Trilinear,
            skip: Skip::NONE,
            entity_limit: limit,
        };
        let inputs = Inputs {
            entities: Readable::shared(&entity_buffer, variant)?,
            rotations: Readable::shared(&rotations, variant)?,
            steps: &steps,
            clusters: &clusters,
            fields: Readable::new(&fields, variant, vk::Format::R16G16B16A16_SFLOAT)?,
            transfers: Readable::new(&transfers, variant, floats)?,
            vertices: Readable::new(&vertices, variant, floats)?,
            sky: &sky,
        };
        contenders.push((variant, Merge::new(device, library, form)?, inputs, f64::INFINITY));
    }
    for run in 0..=RUNS {
        for (_, merge, inputs, least) in &mut contenders {
            let mut commands = Commands::new(device, "calibration")?;
            commands
                .pass("merge", |commands| merge.record(commands, inputs, &radiosity, VERTICES / CLUSTER_VERTICES))?;
            let timings = commands.submit()?;
            // The first run compiles.
            if run > 0 {
                *least = least.min(timings[0].milliseconds);
            }
        }
    }
    let best = contenders.iter().min_by(|a, b| a.3.total_cmp(&b.3)).expect("there are variants");
    Ok(Calibration {
        driver: device.info.driver.clone(),
        program: env!("CARGO_PKG_VERSION").into(),
        fastest: best.0.name.into(),
        milliseconds: contenders.iter().map(|(variant, .., least)| (variant.name.into(), *least)).collect(),
    })
}
