//! Every Vulkan call that can fail does so once, for want of memory or with the device lost: no panic, hang or leak,
//! one line with the right exit code, outputs whole or absent, and the next run in the same process is as if nothing
//! had happened.
//!
//! A seeded twentieth of the calls fails, or one in as many as the variable FAULTS_SHARE says: in an hour, all of them.

#[macro_use]
mod layer;
mod calls;
mod census;
mod claimed;
mod claims;
#[path = "../common/mod.rs"]
mod common;
mod special;
mod sweep;
#[cfg(feature = "view")]
mod window;

use shadow_fields::{Error, Result, app};
use std::path::Path;
use std::sync::{Mutex, MutexGuard, PoisonError};
use sweep::Job;

const SCENE: &str = r#"
output = { width = 12, height = 8 }
environment = { gradient = { radiance = [0.3, 0.35, 0.4] } }
camera = { eye = [0, 1, 4], target = [0, 0, 0] }
mesh = [
    { name = "floor", plane = { size_m = 4, cells = 2 } },
    { name = "ball", sphere = { radius_m = 0.6, subdivisions = 1 } },
]
entity = [
    { mesh = "floor", position = [0, -0.6, 0] },
    { mesh = "ball" },
    { mesh = "ball", position = [1.2, 1, 0], scale = 0.3, emission = [30, 24, 12], motion = [
        { spin = { period_s = 3 } },
        { bob = { amplitude_m = 0.2, period_s = 1 } },
    ] },
]
"#;

/// Dented, so that its field is captured.
const MESH: &str = "v 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 0 1 0 0 0 1\nv 0.2 0.2 1 1 1 1\nv 0.2 0.2 0.3 1 1 1\n\
    f 1 2 4\nf 2 3 4\nf 3 1 4\nf 2 1 5\nf 3 2 5\nf 1 3 5\n";

/// Few samples of few texels.
const SMALL: &str = "--lattice cube:2x3 --face-px 4 --quality draft";

/// Runs the program in the folder, as from the command line; names of files there begin with @.
fn run(folder: &Path, line: &str) -> Result<()> {
    let word = |word: &str| word.strip_prefix('@').map_or(word.into(), |name| folder.join(name).into_os_string());
    let words = format!("shadow-fields {line} --quiet --cache-dir @cache");
    layer::without_stdout(|| app::run_on(words.split_whitespace().map(word)))
}

/// A picture of a scene whose fields are baked for it, with all that can be written beside it.
fn picture(folder: &Path) -> Result<()> {
    let outputs = "-o @p.png --exr @p.exr --vertices @v.csv --antialias outlines";
    run(folder, &format!("render @scene.toml --variant storage --shading vertex {outputs} {SMALL}"))
}

/// The same by pixels, whose pipelines take the driver more than half of a run.
fn pixels(folder: &Path) -> Result<()> {
    run(folder, &format!("render @scene.toml --variant storage -o @x.png {SMALL}"))
}

/// An animation of two light forms, its fields out of the cache.
fn animation(folder: &Path) -> Result<()> {
    run(folder, &format!("render @scene.toml --variant texel-packed -o @a.png --frames 3 --lights sh {SMALL}"))
}

fn bake(folder: &Path) -> Result<()> {
    run(folder, &format!("bake @mesh.obj -o @f.sf --radiance 2,1,1 {SMALL}"))
}

/// Where only some calls fail, the others do in a job before.
const JOBS: &[Job] = &[
    Job { name: "picture", run: picture, outputs: &["p.png", "p.exr", "v.csv"], cold: &["cache/fields"], only: None },
    Job { name: "pixels", run: pixels, outputs: &["x.png"], cold: &[], only: Some(&["Graphics", "ShaderModule"]) },
    Job { name: "animation", run: animation, outputs: &["a.png"], cold: &[], only: None },
    Job { name: "bake", run: bake, outputs: &["f.sf"], cold: &[], only: None },
    #[cfg(feature = "view")]
    Job { name: "window", run: window::run, outputs: &["w.raw"], cold: &[], only: None },
];

/// A folder with inputs, held by one test at a time: the layer is the whole process's.
struct Place {
    folder: tempfile::TempDir,
    _turn: MutexGuard<'static, ()>,
}

impl Place {
    /// `None` where there is no device.
    fn new() -> Option<Self> {
        static TURN: Mutex<()> = Mutex::new(());
        let turn = TURN.lock().unwrap_or_else(PoisonError::into_inner);
        layer::keep_drivers();
        // Pipelines are made on all cores; on one the calls come in the same order each time. It may have been set before.
        let _ = rayon::ThreadPoolBuilder::new().num_threads(1).build_global();
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("scene.toml"), SCENE).unwrap();
        std::fs::write(folder.path().join("mesh.obj"), MESH).unwrap();
        match run(folder.path(), "devices") {
            Ok(()) => Some(Place { folder, _turn: turn }),
            Err(Error::Unsupported(error)) => {
                common::skip(&error);
                None
            }
            Err(error) => panic!("{error}"),
        }
    }

    fn path(&self) -> &Path {
        self.folder.path()
    }
}

#[test]
fn faults_in_some_of_all_calls_are_survived() {
    let share = std::env::var("FAULTS_SHARE").map_or(20, |text| text.parse().expect("a number"));
    let Some(place) = Place::new() else { return };
    let count: usize = JOBS.iter().map(|job| job.sweep(place.path(), share)).sum();
    assert!(count > 20, "hardly anything failed: {count}");
}
