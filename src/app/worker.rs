//! `shadow-fields bake-worker`: a process that captures for a bake in another one, which starts it.

use super::Global;
use super::context;
use crate::bake::{Baker, worker};
use crate::error::Result;
use crate::gpu::{Device, DeviceOptions};
use crate::shaders::Library;

/// Serves the bake at the other end of stdin and stdout.
pub fn run(global: &Global) -> Result<()> {
    let open = || {
        let cache_dir = context::cache_dir(global);
        let library = Library { shader_dir: global.shader_dir.clone(), cache_dir: cache_dir.clone() };
        let options = DeviceOptions { device: global.device.clone(), validation: global.validation, cache_dir };
        Ok(Baker::new(&Device::new(&options)?, &library))
    };
    worker::serve(open, std::io::stdin(), std::io::stdout())
}
