//! Options that every subcommand has, and the device that they lead to.

use super::output::{self, Progress};
use crate::bake::{self, Baker, WorkerOptions, cache::Cache};
use crate::draw::{Antialias, Shading};
use crate::error::{Error, Result};
use crate::field::Lookup;
use crate::files;
use crate::frame;
use crate::gpu::{self, Device, Validation};
use crate::lists::gather::Place;
use crate::lists::skip::{EPS, Skip};
use crate::merge::{Variant, calibrate};
use crate::scene::data::check_picture;
use crate::scene::{Lights, Scene};
use crate::shaders::Library;
use clap::Args;
use std::path::PathBuf;
use std::str::FromStr;
use std::sync::Arc;

/// Options of every subcommand.
#[derive(Args, Debug)]
#[command(next_help_heading = "Everywhere")]
pub struct Global {
    /// Vulkan device by index, part of its name, or UUID (see `devices`); default: the first GPU, else a software device
    #[arg(long, global = true, value_name = "INDEX|NAME|UUID")]
    pub device: Option<String>,
    /// Run under the Khronos validation layer; any message makes the run fail
    #[arg(long, global = true, default_value = "off", value_name = "MODE")]
    pub validation: Validation,
    /// Seed of all random numbers
    #[arg(long, global = true, default_value_t = Global::SEED)]
    pub seed: u64,
    /// Print results as JSON
    #[arg(long, global = true)]
    pub json: bool,
    /// Print nothing but errors on stderr
    #[arg(short, long, global = true)]
    pub quiet: bool,
    /// Print more log lines on stderr; give it twice for all
    #[arg(short, long, global = true, action = clap::ArgAction::Count)]
    pub verbose: u8,
    /// Show no progress bars
    #[arg(long, global = true)]
    pub no_progress: bool,
    /// Folder for baked fields, compiled shaders and what the window remembers; default: shadow-fields in the XDG cache folder
    #[arg(long, global = true, value_name = "DIR")]
    pub cache_dir: Option<PathBuf>,
    /// Neither read nor write a cache on disk
    #[arg(long, global = true)]
    pub no_cache: bool,
    /// Folder whose shader files are used instead of the built-in ones of the same name
    #[arg(long, global = true, value_name = "DIR")]
    pub shader_dir: Option<PathBuf>,
    /// Number of processes that share a bake; the result is the same. Default: 1, or one per core if a software device has to draw cube
    /// faces (radiance fields and very large meshes) and this takes an estimated two seconds or more
    #[arg(long, global = true, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=256))]
    pub jobs: Option<u32>,
}

impl Global {
    /// Seed where none is said.
    pub const SEED: u64 = 1;

    /// How worker processes of this program are started; `None` where it does not know its own file.
    pub fn workers(&self) -> Option<WorkerOptions> {
        let program = std::env::current_exe().ok()?;
        Some(WorkerOptions { program, jobs: self.jobs, validation: self.validation })
    }
}

/// The folder of what is kept, which exists; `None` where nothing is to be kept or can be.
pub fn cache_dir(global: &Global) -> Option<PathBuf> {
    let folder = match (global.no_cache, &global.cache_dir) {
        (true, _) => None,
        (false, Some(folder)) => Some(folder.clone()),
        (false, None) => Cache::usual_folder(),
    };
    folder.filter(|folder| match std::fs::create_dir_all(folder) {
        Ok(()) => true,
        Err(error) => {
            log::warn!("{}: the cache folder cannot be made ({error}); nothing is kept", folder.display());
            false
        }
    })
}

/// Options of what lights a scene: the merge and sharp lights.
#[derive(Args, Clone, Copy, Debug)]
#[command(next_help_heading = "Lighting")]
pub struct MergeArguments {
    /// Variant of the merge shader: storage, storage-uniform, texel, texel-packed, texel-shifted or image. They differ in how they read
    /// fields; image interpolates with the sampler, less exactly. Default: the fastest on this device without image, measured once
    #[arg(long, value_name = "NAME", value_parser = Variant::named)]
    pub variant: Option<Variant>,
    /// Work to leave out: all, none, or a list of these with commas:
    ///   horizon  lights and occluders below the horizon of the surface *
    ///   cones    occluders beside the light, as seen from the vertex *
    ///   behind   occluders farther away than the light
    ///   caps     fields of occluders that look small from the vertex, which become points *
    ///   passed   occluders that no ray to a sharp light meets (lists of the host)
    ///   covered  sharp lights that one occluder covers whole (lists of the host)
    ///   unmoved  clusters of vertices for which nothing has changed
    ///   hidden   clusters of vertices that the camera cannot see, while entities move
    /// Skips with * change pictures a little; the others do not change what is shown
    #[arg(long, default_value = "all", value_name = "all|none|LIST", verbatim_doc_comment)]
    pub skip: Skip,
    /// Leave out an entity's light or shadow on a vertex where it is bounded below this share of white; 0 leaves out nothing
    #[arg(long, default_value_t = EPS, value_name = "SHARE", value_parser = eps, allow_negative_numbers = true)]
    pub eps: f32,
    /// How lights of one colour are computed
    #[arg(long, value_enum, default_value = "sharp", value_name = "sh|sharp")]
    pub lights: Lights,
    /// Where sharp lights are evaluated for pictures. Default: pixel with four samples a pixel, vertex with one
    #[arg(long, value_enum, value_name = "vertex|pixel")]
    pub shading: Option<Shading>,
    /// Where the lists of the entities that concern each cluster of vertices are made. Default: device, but host for fewer than 128
    /// entities on a software device
    #[arg(long, value_name = "WHERE")]
    pub lists: Option<Place>,
}

impl MergeArguments {
    /// A frame of that size, merged as the arguments say.
    pub fn options(&self, bake: bake::Options, size: [u32; 2], antialias: Antialias) -> frame::Options {
        let lookup = Lookup::Trilinear;
        let (variant, skip, eps, lists) = (self.variant, self.skip, self.eps, self.lists);
        let (lights, shading) = (self.lights, self.shading);
        frame::Options { bake, lights, shading, lookup, variant, skip, eps, lists, size, antialias }
    }
}

/// A switch that takes a word.
pub fn on_or_off(text: &str) -> std::result::Result<bool, String> {
    match text {
        "on" => Ok(true),
        "off" => Ok(false),
        _ => Err(format!("expected on or off, got \"{text}\"")),
    }
}

fn eps(text: &str) -> std::result::Result<f32, String> {
    let number = text.parse().ok().filter(|eps| (0.0..=1.0).contains(eps));
    number.ok_or_else(|| format!("expected a number from 0 to 1, got \"{text}\""))
}

/// Three numbers with commas between them.
pub fn three<T: FromStr>(text: &str) -> Option<[T; 3]> {
    let numbers: Option<Vec<T>> = text.split(',').map(|word| word.trim().parse().ok()).collect();
    numbers?.try_into().ok()
}

/// Width and height from `WxH`.
pub fn size(text: &str) -> std::result::Result<[u32; 2], String> {
    let pair = text.split_once('x').and_then(|(w, h)| Some([w.parse().ok()?, h.parse().ok()?]));
    pair.filter(|size| check_picture(*size).is_ok())
        .ok_or_else(|| format!("expected a size like 1280x720, got \"{text}\""))
}

/// An open device with what goes with it.
pub struct Context {
    /// The device.
    pub device: Arc<Device>,
    /// Bakes on it.
    pub baker: Baker,
    /// Baked things on disk.
    pub cache: Cache,
    /// Where bakes show how far they are.
    pub progress: Progress,
    validation: Validation,
}

impl Context {
    /// Opens the device that the options choose.
    ///
    /// # Errors
    /// `Unsupported` when there is none.
    pub fn new(global: &Global) -> Result<Self> {
        Self::with_device(global, Device::new)
    }

    /// As [`Context::new`] with a device that `open` opens.
    ///
    /// # Errors
    /// What `open` returns.
    pub fn with_device(global: &Global, open: impl FnOnce(&gpu::DeviceOptions) -> Result<Arc<Device>>) -> Result<Self> {
        let cache_dir = cache_dir(global);
        for folder in cache_dir.iter().flat_map(|cache| [cache.clone(), cache.join("fields"), cache.join("spirv")]) {
            files::sweep(&folder);
        }
        if let Some(folder) = &global.shader_dir
            && !folder.is_dir()
        {
            return Err(Error::input(folder, "expected a folder of shaders"));
        }
        let device = open(&gpu::DeviceOptions {
            device: global.device.clone(),
            validation: global.validation,
            cache_dir: cache_dir.clone(),
        })?;
        if device.info.is_software() {
            output::note(global, format!("note: {} is a software device", device.info.name));
        }
        let library = Library { shader_dir: global.shader_dir.clone(), cache_dir: cache_dir.clone() };
        let cache = Cache::new(cache_dir.as_deref());
        let baker = global
            .workers()
            .map_or_else(|| Baker::new(&device, &library), |workers| Baker::with_workers(&device, &library, workers));
        Ok(Context { device, baker, cache, progress: Progress::new(global), validation: global.validation })
    }

    /// Prepares a scene for drawing.
    ///
    /// # Errors
    /// As [`frame::Frame::new`].
    pub fn frame(&self, scene: &Scene, options: frame::Options) -> Result<frame::Frame> {
        frame::Frame::new(&self.baker, &self.cache, scene, options, &|what, done, all| {
            self.progress.show(what, done, all);
        })
    }

    /// Finds the fastest variant of the merge on a device where that is not known, for the next time.
    ///
    /// # Errors
    /// `Device` when the device is lost.
    pub fn learn(&self, global: &Global) -> Result<()> {
        let measured = calibrate::learn(&self.device, self.baker.library());
        match measured {
            Ok(Some(calibration)) => output::note(
                global,
                format!("measured once for {}: \"{}\" merges fastest", self.device.info.name, calibration.fastest),
            ),
            // The command has already done its work with another variant; only the next one would gain.
            Err(Error::Failed(error)) => log::warn!("calibration: {error}"),
            Err(error) => return Err(error),
            Ok(None) => {}
        }
        Ok(())
    }

    /// Ends the work on the device: keeps its pipeline cache, and fails when the validation layer had something to say.
    ///
    /// # Errors
    /// `Failed` that quotes the layer.
    pub fn finish(self) -> Result<()> {
        self.device.save_pipeline_cache();
        if self.validation == Validation::Off {
            return Ok(());
        }
        gpu::validation::Messages::into_result(self.device.take_validation_messages())
    }

    /// What a result file says of where it comes from.
    pub fn origin(&self, global: &Global) -> serde_json::Value {
        serde_json::json!({
            "program": concat!("shadow-fields ", env!("CARGO_PKG_VERSION")),
            "revision": env!("SHADOW_FIELDS_REVISION"),
            "device": self.device.info.name,
            "driver": self.device.info.driver,
            "vulkan": self.device.info.api,
            "seed": global.seed,
            "command_line": std::env::args_os().skip(1).map(|a| a.to_string_lossy().into_owned()).collect::<Vec<_>>(),
        })
    }
}
