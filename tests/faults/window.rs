//! What a window shows, drawn into an image: all of a window but its surface.

use shadow_fields::bake::cache::Cache;
use shadow_fields::draw::{Antialias, Shading};
use shadow_fields::gpu::{Access, Buffer, BufferKind, Commands, Device, DeviceOptions, Image, ImageShape};
use shadow_fields::scene::{Lights, Scene};
use shadow_fields::shaders::Library;
use shadow_fields::view::command::{Command, Step};
use shadow_fields::view::{Editor, FrameTarget, Setup, Viewer};
use shadow_fields::{Error, Result, bake, check, frame};
use std::path::Path;

const SIZE: [u32; 2] = [48, 32];
const FORMAT: ash::vk::Format = ash::vk::Format::R8G8B8A8_SRGB;

/// Draws frames of a scene that is edited, with the overlay, and writes the last as `w.raw`.
pub fn run(folder: &Path) -> Result<()> {
    let cache_dir = folder.join("cache");
    let options = DeviceOptions { cache_dir: Some(cache_dir.clone()), ..DeviceOptions::default() };
    let device = Device::new(&options)?;
    let [width, height] = SIZE;
    let image = Image::new(&device, "window", ImageShape { format: FORMAT, width, height, samples: 1 })?;
    let path = folder.join("scene.toml");
    let setup = Setup {
        device: device.clone(),
        options,
        workers: None,
        library: Library { shader_dir: None, cache_dir: Some(cache_dir.clone()) },
        cache: Cache::new(Some(&cache_dir)),
        frame: frame_options(),
        format: FORMAT,
        encodes_srgb: true,
        seed: 1,
        strict: false,
        settings: None,
    };
    let editor = Editor::new(Scene::load(&path)?, &path);
    let mut viewer = Viewer::new(setup, editor, 1.0)?;
    viewer.apply(Command::Resize(SIZE))?;
    viewer.apply(Command::ToggleRunning)?;
    while viewer.is_baking() {
        std::thread::yield_now();
        viewer.update(0.0)?;
    }
    let turn = |viewer: &mut Viewer| {
        viewer.update(0.0)?;
        let [width, height] = SIZE.map(|side| side as f32);
        let screen = egui::Rect::from_min_size(egui::Pos2::ZERO, egui::vec2(width, height));
        let _ = viewer.ui(egui::RawInput { screen_rect: Some(screen), ..Default::default() })?;
        viewer.draw(FrameTarget::Image(&image)).map(|_| ())
    };
    turn(&mut viewer)?;
    viewer.apply(Command::Step { step: Step::Up, repeat: false })?;
    turn(&mut viewer)?;
    viewer.apply(Command::ToggleOverlay)?;
    turn(&mut viewer)?;
    viewer.settle()?;
    if viewer.frame().is_none() {
        return Err(Error::Failed(viewer.message().unwrap_or("no frame, and nothing is said of it").to_owned()));
    }
    let pixels = look(&device, &image)?;
    drop(viewer);
    device.save_pipeline_cache();
    std::fs::write(folder.join("w.raw"), pixels).map_err(|error| Error::Failed(error.to_string()))
}

fn frame_options() -> frame::Options {
    let lattice = "cube:2x2".parse().expect("a lattice");
    frame::Options {
        bake: bake::Options { lattice, face_px: 4, ..Default::default() },
        lights: Lights::Sharp,
        shading: Some(Shading::Vertex),
        size: SIZE,
        antialias: Antialias::Outlines,
        ..check::merge::options()
    }
}

fn look(device: &std::sync::Arc<Device>, image: &Image) -> Result<Vec<u8>> {
    let bytes = 4 * SIZE[0] * SIZE[1];
    let host = Buffer::new(device, "window on the host", BufferKind::Readback, bytes.into())?;
    let mut commands = Commands::new(device, "look")?;
    commands.copy_image(image, &host);
    commands.barrier(Access::TransferWrite, Access::HostRead);
    commands.submit()?;
    Ok(host.read(0, bytes as usize))
}
