//! Options that every subcommand has, and the device that they lead to.

use super::output::{self, Progress};
use crate::bake::{Baker, cache::Cache};
use crate::error::{Error, Result};
use crate::files;
use crate::frame;
use crate::gpu::{self, Device, Validation};
use crate::merge::calibrate;
use crate::scene::Scene;
use crate::shaders::Library;
use clap::Args;
use std::path::PathBuf;
use std::sync::Arc;

/// Options of every subcommand.
#[derive(Args, Debug)]
#[command(next_help_heading = "Everywhere")]
pub struct Global {
    /// Vulkan device by index, part of its name, or UUID (see `devices`); default: the first GPU, else a software
    /// device
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
    /// Show no progress, neither bars nor the lines that stand for them where stderr is no terminal
    #[arg(long, global = true)]
    pub no_progress: bool,
    /// Folder for baked fields, compiled shaders and what the window remembers; default: shadow-fields in the XDG cache
    /// folder
    #[arg(long, global = true, value_name = "DIR")]
    pub cache_dir: Option<PathBuf>,
    /// Neither read nor write a cache on disk
    #[arg(long, global = true)]
    pub no_cache: bool,
    /// Folder whose shader files are used instead of the built-in ones of the same name
    #[arg(long, global = true, value_name = "DIR")]
    pub shader_dir: Option<PathBuf>,
}

impl Global {
    /// Seed where none is said.
    pub const SEED: u64 = 1;
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

/// An open device with what goes with it.
pub struct Context {
    pub device: Arc<Device>,
    pub baker: Baker,
    pub cache: Cache,
    /// Where bakes show how far they are.
    pub progress: Progress,
}

impl Context {
    /// Opens the device that the options choose.
    pub fn new(global: &Global) -> Result<Self> {
        Self::with_device(global, Device::new)
    }

    /// As [`Context::new`] with a device that `open` opens.
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
        let baker = Baker::new(&device, &library);
        Ok(Context { device, baker, cache, progress: Progress::new(global) })
    }

    /// Prepares a scene for drawing.
    pub fn frame(&self, scene: &Scene, options: frame::Options) -> Result<frame::Frame> {
        frame::Frame::new(&self.baker, &self.cache, scene, options, &|what, done, all| {
            self.progress.show(what, done, all);
        })
    }

    /// Finds the fastest variant of the merge on a device where that is not known, for the next time.
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
    pub fn finish(self) -> Result<()> {
        self.device.save_pipeline_cache();
        gpu::validation::Messages::into_result(self.device.take_validation_messages())
    }

    /// The origin of a result file: program, device and command line.
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
