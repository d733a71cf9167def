//! "assemble" against its twin in f64.

use super::CheckRow;
use super::project::F32;
use crate::bake::Baker;
use crate::bake::assemble::{self, Assemble, Sources};
use crate::error::Result;
use crate::field::quantity::channel_stride;
use crate::field::{Lattice, Storage};
use crate::gpu::{Buffer, Commands};
use fastrand::Rng;
use half::f16;

/// Half an ulp of f16 is 4.9e-4 relative; what is below 6.1e-5 is stored as 0.
const F16: f64 = 2e-3;

/// Lattice, bands and channels that are tried.
const CASES: [(&str, usize, usize); 3] =
    [("cube:3x5,inner=0.3", 4, 1), ("cube:3x5,edges,inner=0.3", 3, 3), ("cube:1x1", 2, 3)];

/// Assembles random numbers, some of them inside the solid. The largest error relative to 1 + what is wanted; infinite
/// where anything was written outside the field.
fn compare(baker: &Baker, (lattice, bands, channels): (&Lattice, usize, usize), storage: Storage) -> Result<f64> {
    const FACTOR: f32 = 0.7;
    let mut rng = Rng::with_seed(3);
    let inside: Vec<bool> = (0..lattice.sample_count()).map(|i| i > 0 && rng.u32(..10) < 3).collect();
    let sources = Sources::new(lattice, &inside, &inside)?;
    let stride = channels * channel_stride(bands);
    // Samples inside the solid are never used: their NaN would show.
    let number = |inside: bool, rng: &mut Rng| if inside { f32::NAN } else { 8.0 * rng.f32() - 4.0 };
    let captured: Vec<f32> =
        inside.iter().flat_map(|&inside| (0..stride).map(|_| number(inside, &mut rng)).collect::<Vec<_>>()).collect();
    let wanted = assemble::twin(&captured, &sources, stride, FACTOR);
    assert_eq!(wanted.len(), lattice.stored_count() as usize * stride);

    let device = baker.device();
    let pass = Assemble::new(device, baker.library(), storage)?;
    let captured = Buffer::with_data(device, "captured", &captured)?;
    let offsets = Buffer::with_data(device, "offsets", &sources.offsets)?;
    let list = Buffer::with_data(device, "list", &sources.list)?;
    // Room before and behind, which must stay as it is.
    let size = wanted.len() * storage.bytes();
    let field = Buffer::with_data(device, "field", &vec![0xab_u8; 256 + size + 256])?;
    let range = 256..256 + size as u64;
    let counts = (lattice.stored_count(), (stride / 4) as u32);
    let mut commands = Commands::new(device, "assemble check")?;
    commands
        .pass("assemble", |c| pass.record(c, [&captured, &offsets, &list], (&field, range.clone()), counts, FACTOR))?;
    commands.submit()?;
    let bytes: Vec<u8> = field.download(256 + size + 256)?;
    if bytes[..256].iter().chain(&bytes[256 + size..]).any(|b| *b != 0xab) {
        return Ok(f64::INFINITY);
    }
    let number = |raw: &[u8]| match storage {
        Storage::F32 => f64::from(f32::from_le_bytes(raw.try_into().expect("four bytes"))),
        Storage::F16 => f16::from_le_bytes(raw.try_into().expect("two bytes")).to_f64(),
    };
    let found = bytes[256..256 + size].chunks_exact(storage.bytes()).map(number);
    let errors = found.zip(&wanted).map(|(found, wanted)| (found - wanted).abs() / (1.0 + wanted.abs()));
    Ok(errors.fold(0.0, |worst, error| if error.is_nan() { f64::INFINITY } else { worst.max(error) }))
}

pub fn rows(baker: &Baker, add: &mut dyn FnMut(CheckRow)) -> Result<()> {
    for (storage, tolerance) in [(Storage::F32, F32), (Storage::F16, F16)] {
        for (text, bands, channels) in CASES {
            let lattice: Lattice = text.parse().expect("a lattice in the table");
            let worst = compare(baker, (&lattice, bands, channels), storage)?;
            let what = format!("{}, {lattice}", format!("{storage:?}").to_lowercase());
            add(CheckRow::new("assemble", what, "of 1 + coefficient", worst, tolerance));
        }
    }
    Ok(())
}
