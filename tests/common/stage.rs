//! Small scenes on the shared device: what the tests of merge and draw have in common.

#![allow(dead_code)] // every test binary uses its own part

use super::common::{Gpu, gpu, parse};
use glam::{Quat, Vec3};
use shadow_fields::bake::Baker;
use shadow_fields::bake::cache::Cache;
use shadow_fields::frame::{self, Frame};
use shadow_fields::scene::{Placement, Scene};
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

/// The device with a baker and a cache of fields that lives as long as the test binary.
pub struct Stage {
    baker: Baker,
    cache: Cache,
    /// Last, so that the validation layer is asked once everything else is gone.
    pub gpu: Gpu,
}

/// Waits for this test's turn with the device; `None` when the test is to be skipped.
pub fn stage() -> Option<Stage> {
    // Emptied first: fields of an earlier build would hide what this one bakes.
    static FIELDS: OnceLock<PathBuf> = OnceLock::new();
    let fields = FIELDS.get_or_init(|| {
        let name = format!("fields-{}", env!("CARGO_CRATE_NAME"));
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
        let _ = std::fs::remove_dir_all(&folder);
        folder
    });
    let gpu = gpu()?;
    Some(Stage { baker: Baker::new(&gpu.device, &gpu.library), cache: Cache::new(Some(fields)), gpu })
}

/// Few samples of few texels in f32: quick, and all that a comparison with a twin needs. The variant is pinned.
pub fn small() -> frame::Options {
    shadow_fields::check::merge::options()
}

impl Stage {
    /// A scene on the device, its fields baked.
    pub fn frame(&self, scene: &Scene, options: frame::Options) -> Frame {
        self.frame_on(&self.baker, scene, options)
    }

    /// The same on the device of another baker, by the fields that are baked already.
    pub fn frame_on(&self, baker: &Baker, scene: &Scene, options: frame::Options) -> Frame {
        Frame::new(baker, &self.cache, scene, options, &|_, _, _| ()).unwrap()
    }

    /// Radiosity of every entity's vertices in turn, red, green and blue.
    pub fn light(&self, frame: &mut Frame, placements: &[Placement]) -> Vec<Vec<[f32; 3]>> {
        frame.render(placements, None).unwrap();
        (0..placements.len()).map(|entity| frame.radiosity(entity).unwrap()).collect()
    }
}

/// A scene from the text of its meshes, entities and sky; a camera is added.
pub fn scene(text: &str) -> Scene {
    parse(&format!("{text}\n[camera]\neye = [0, 0, 5]\ntarget = [0, 0, 0]\n"))
}

/// An object upright at a place in its own size.
pub fn at(x: f32, y: f32, z: f32) -> Placement {
    Placement { position: Vec3::new(x, y, z), rotation: Quat::IDENTITY, scale: 1.0 }
}

/// Largest of all differences, and the largest magnitude of `b`.
pub fn difference(a: &[[f32; 3]], b: &[[f32; 3]]) -> (f32, f32) {
    assert_eq!(a.len(), b.len(), "vertices");
    let pairs = || a.iter().flatten().zip(b.iter().flatten());
    assert!(pairs().all(|(a, b)| a.is_finite() && b.is_finite()), "a radiosity is not finite");
    (pairs().fold(0.0, |m, (a, b)| m.max((a - b).abs())), pairs().fold(0.0, |m, (_, b)| m.max(b.abs())))
}
