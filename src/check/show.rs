//! "show" against its twin: a picture of radiances from black to above white, on targets that encode sRGB by themselves
//! and others.

use super::CheckRow;
use crate::bake::Baker;
use crate::draw::show::Show;
use crate::error::Result;
use crate::gpu::{Access, Buffer, Commands, Image, ImageShape, Target};
use ash::vk;
use half::f16;

/// Largest difference in steps of 8 bits: the shader's curve is off by a twelfth of a step, and a device may round
/// either way.
const STEPS: f64 = 1.0;
/// Radiance that becomes white.
const WHITE: f32 = 2.0;
const SIZE: [u32; 2] = [64, 32];

pub fn rows(baker: &Baker, add: &mut dyn FnMut(CheckRow)) -> Result<()> {
    for (format, what) in
        [(vk::Format::R8G8B8A8_UNORM, "encoded by the shader"), (vk::Format::R8G8B8A8_SRGB, "encoded by the target")]
    {
        let worst = compare(baker, format)?;
        add(CheckRow::new("show", what, "largest difference, steps of 8 bits", worst, STEPS));
    }
    Ok(())
}

/// The largest difference between a shown ramp and the twin's, in steps of 8 bits.
fn compare(baker: &Baker, format: vk::Format) -> Result<f64> {
    let device = baker.device();
    let [width, height] = SIZE;
    let texels = width * height;
    // From 0 to a fifth above white; green goes the other way, and blue is below a thousandth, where the curve is a
    // line.
    let ramp = (0..texels).map(|i| 1.2 * WHITE * i as f32 / (texels - 1) as f32);
    let radiances = ramp.map(|r| [r, 1.2 * WHITE - r, 1e-3 * r, 1.0].map(f16::from_f32));
    let radiances: Vec<[f16; 4]> = radiances.collect();
    let upload = Buffer::with_data(device, "linear ramp", &radiances)?;
    let shape = ImageShape { format: vk::Format::R16G16B16A16_SFLOAT, width, height, samples: 1 };
    let picture = Image::new(device, "linear picture", shape)?;
    let shown = Image::new(device, "shown picture", ImageShape { format, ..shape })?;
    let show = Show::new(device, baker.library(), format)?;
    let mut commands = Commands::new(device, "check of show")?;
    commands.image_barrier(&picture, None, Access::TransferWrite);
    commands.copy_to_image(&upload, &picture);
    commands.image_barrier(&picture, Some(Access::TransferWrite), Access::GraphicsSampled);
    commands.image_barrier(&shown, None, Access::ColorWrite);
    let target = Target { color: &shown, second: None, clear: Some([0.0; 4]), depth: None, resolve: None };
    commands.pass("show", |c| c.render(&target, |drawing| show.record(drawing, &picture, WHITE)))?;
    commands.image_barrier(&shown, Some(Access::ColorWrite), Access::TransferRead);
    commands.submit()?;
    let found: Vec<[u8; 4]> = shown.download()?;
    let apart = found.iter().zip(&radiances).flat_map(|(found, radiance)| {
        [0, 1, 2].map(|channel| found[channel].abs_diff(Show::twin(radiance[channel].to_f32(), WHITE)))
    });
    Ok(apart.max().map_or(f64::INFINITY, f64::from))
}
