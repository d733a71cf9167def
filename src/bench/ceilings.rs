//! Peak rates of a device, measured with shaders that do one kind of work each, to compare the merge with.

use crate::error::Result;
use crate::gpu::{Bind, Buffer, BufferKind, Commands, ComputePipeline, Device, TexelView};
use crate::shaders::{Library, ShaderPermutation};
use ash::vk;
use serde::Serialize;
use std::sync::Arc;

/// Measured peak rates of a device.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct Ceilings {
    /// Multiplications and additions, in 10^9 a second; a fused one counts as two.
    pub gflops: f64,
    /// Texels of four halves from a buffer of the field's size, in 10^9 a second.
    pub texel_halves_giga: f64,
    /// Texels of 16 bytes from a buffer of the field's size, in 10^9 a second.
    pub texel_packed_giga: f64,
    /// Reads of 8 bytes from a storage block of the field's size, in 10^9 a second.
    pub storage_giga: f64,
    /// Time of a dispatch of one workgroup with almost no work, milliseconds: the resolution of all times.
    pub dispatch_ms: f64,
}

impl Ceilings {
    /// Whether a time is at least five times that of an idle dispatch, so that it measures work and not overhead.
    pub fn resolve(&self, milliseconds: f64) -> bool {
        milliseconds >= 5.0 * self.dispatch_ms
    }
}

/// Number of timed runs of each shader, after one run to warm up.
const RUNS: usize = 5;
/// Vector multiply-adds, or reads, per iteration.
const READS: u32 = 16;
/// Invocations of the shortest run.
const LEAST_INVOCATIONS: u32 = 1 << 14;
/// Those of the longest. Each writes 16 bytes.
const MOST_INVOCATIONS: u32 = 1 << 22;
/// Least time of a run in those of an idle dispatch, so that the work is measured and not its start.
const LEAST: f64 = 100.0;

/// Measures a device with reads from a buffer of `field_bytes`.
pub fn measure(device: &Arc<Device>, library: &Library, field_bytes: u64) -> Result<Ceilings> {
    let source = Buffer::with_data(device, "ceiling source", &vec![0x2000_2000_u32; field_bytes as usize / 4])?;
    let out = Buffer::new(device, "ceiling results", BufferKind::Device, 16 * u64::from(MOST_INVOCATIONS))?;
    let pipeline = |kind: u32, rounds: u32, texel_bytes: u64| -> Result<ComputePipeline> {
        let texels = (field_bytes / texel_bytes).max(8);
        let row = ShaderPermutation::new("ceiling.comp", 4)
            .define("KIND", kind)
            .define("READS", READS)
            .define("ROUNDS", rounds)
            .define("MASK", (1_u32 << texels.ilog2()) - 1);
        ComputePipeline::new(device, "ceiling", &library.shader(&row)?)
    };
    let seconds = |kind: u32, pipeline: &ComputePipeline, invocations: u32| -> Result<f64> {
        let first = match kind {
            1 => Bind::Texel(TexelView::new(&source, vk::Format::R16G16B16A16_SFLOAT)?),
            2 => Bind::Texel(TexelView::new(&source, vk::Format::R32G32B32A32_UINT)?),
            _ => Bind::Buffer(&source),
        };
        best(device, pipeline, &[first, Bind::Buffer(&out)], invocations)
    };
    let idle = seconds(0, &pipeline(0, 1, 8)?, 1)?;
    let rate = |kind: u32, rounds: u32, texel_bytes: u64| -> Result<f64> {
        let pipeline = pipeline(kind, rounds, texel_bytes)?;
        let mut invocations = LEAST_INVOCATIONS;
        let mut time = seconds(kind, &pipeline, invocations)?;
        while time < LEAST * idle && invocations < MOST_INVOCATIONS {
            invocations *= 4;
            time = seconds(kind, &pipeline, invocations)?;
        }
        Ok(1e-9 * f64::from(invocations) * f64::from(rounds) * f64::from(READS) / time)
    };
    // Rounds differ by kind, because some kinds are slow on a CPU.
    Ok(Ceilings {
        // An iteration multiplies and adds vectors of four.
        gflops: 8.0 * rate(0, 256, 8)?,
        texel_halves_giga: rate(1, 64, 8)?,
        texel_packed_giga: rate(2, 64, 16)?,
        storage_giga: rate(3, 16, 8)?,
        dispatch_ms: 1e3 * idle,
    })
}

/// Seconds of the fastest run, because noise only adds time.
fn best(device: &Arc<Device>, pipeline: &ComputePipeline, resources: &[Bind<'_>], invocations: u32) -> Result<f64> {
    let mut least = f64::INFINITY;
    for run in 0..=RUNS {
        let mut commands = Commands::new(device, "ceiling")?;
        commands.pass("ceiling", |c| c.dispatch(pipeline, resources, &(), [invocations, 1, 1]))?;
        let milliseconds = commands.submit()?[0].milliseconds;
        if run > 0 {
            least = least.min(milliseconds);
        }
    }
    Ok(least * 1e-3)
}
