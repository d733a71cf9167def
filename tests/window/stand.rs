//! A window's inside that draws into an image: events and time in, pictures out.

use crate::common::{self, Gpu, gpu};
use crate::room;
use shadow_fields::asset::picture::srgb_from_linear;
use shadow_fields::bake::Baker;
use shadow_fields::bake::cache::Cache;
use shadow_fields::frame::{self, Frame};
use shadow_fields::gpu::{self, FLIGHTS, Image, ImageShape, Validation};
use shadow_fields::scene::Scene;
use shadow_fields::view::input::{Button, Key};
use shadow_fields::view::{Command, Editor, Event, FrameTarget, Setup, Viewer};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

pub const SIZE: [u32; 2] = [320, 240];
pub const FORMAT: ash::vk::Format = ash::vk::Format::R8G8B8A8_SRGB;
pub struct Stand {
    pub viewer: Viewer,
    image: Image,
    pub options: frame::Options,
    pub cache: PathBuf,
    pub gpu: Gpu,
}

impl Stand {
    pub fn new(name: &str) -> Option<Self> {
        Self::with(name, |_| ())
    }

    /// One whose setup is changed first.
    pub fn with(name: &str, change: impl FnOnce(&mut Setup)) -> Option<Self> {
        Self::of(name, "", change)
    }

    /// With more keys of the lamp.
    pub fn of(name: &str, of_the_lamp: &str, change: impl FnOnce(&mut Setup)) -> Option<Self> {
        let gpu = gpu()?;
        let cache = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("view-{name}"));
        let _ = std::fs::remove_dir_all(&cache);
        let mut setup = Setup {
            device: gpu.device.clone(),
            options: gpu::DeviceOptions {
                device: None,
                validation: Validation::Core,
                cache_dir: Some(common::cache_dir()),
            },
            library: gpu.library.clone(),
            cache: Cache::new(Some(&cache)),
            frame: frame::Options { size: SIZE, pictures: true, ..shadow_fields::check::merge::options() },
            refines: false,
            format: FORMAT,
            seed: 1,
            strict: false,
            preview_after: Duration::from_secs(60),
        };
        change(&mut setup);
        let options = setup.frame;
        // The state and pictures are saved beside the scene's file.
        let path = room::write(&cache, SIZE, of_the_lamp);
        let mut editor = Editor::new(Scene::load(&path).unwrap(), &path);
        editor.apply(Command::ToggleOverlay);
        let viewer = Viewer::new(setup, editor, 1.0).unwrap();
        let [width, height] = SIZE;
        let image =
            Image::new(&gpu.device, "window", ImageShape { format: FORMAT, width, height, samples: 1 }).unwrap();
        Some(Stand { viewer, image, options, cache, gpu })
    }

    /// One turn of the window's loop.
    pub fn turn(&mut self) {
        self.viewer.update(0.0).unwrap();
        let [width, height] = SIZE.map(|s| s as f32);
        let screen = egui::Rect::from_min_size(egui::Pos2::ZERO, egui::vec2(width, height));
        let _ = self.viewer.ui(egui::RawInput { screen_rect: Some(screen), ..Default::default() }).unwrap();
        assert!(self.viewer.draw(FrameTarget::Image(&self.image)).unwrap());
        assert!(self.gpu.device.flight_count() <= FLIGHTS);
    }

    /// Turns until `done`, at most a minute.
    pub fn until(&mut self, what: &str, done: impl Fn(&Viewer) -> bool) {
        let start = Instant::now();
        while !done(&self.viewer) {
            assert!(start.elapsed() < Duration::from_secs(60), "{what}: {:?}", self.viewer.message());
            self.turn();
            std::thread::sleep(Duration::from_millis(2));
        }
    }

    pub fn ready(&mut self) {
        self.until("a first frame", |viewer| viewer.frame.is_some() && !viewer.is_baking());
    }

    /// What is shown, RGBA.
    pub fn shown(&mut self) -> Vec<[u8; 4]> {
        self.turn();
        self.viewer.settle().unwrap();
        self.image.download().unwrap()
    }

    /// The state rendered by a frame of its own, encoded.
    pub fn rendered(&self, scene: &Scene) -> Vec<[u8; 4]> {
        let editor = &self.viewer.editor;
        let baker = Baker::new(&self.gpu.device, &self.gpu.library);
        let cache = Cache::new(Some(&self.cache));
        let mut frame = Frame::new(&baker, &cache, scene, self.options, &|_, _, _| ()).unwrap();
        let white = (-editor.scene().data.output.exposure_ev()).exp2();
        frame.render(&scene.at(editor.time_s), Some(white)).unwrap();
        let encode = |c: f32| (255.0 * srgb_from_linear(c / white)).round() as u8;
        frame.picture().chunks_exact(3).map(|p| [encode(p[0]), encode(p[1]), encode(p[2]), 255]).collect()
    }

    pub fn key(&mut self, key: Key) {
        self.viewer.event(Event::Key { key, control: false, repeat: false }).unwrap();
    }

    pub fn letter(&mut self, letter: char) {
        self.key(Key::from_name(&letter.to_string()).expect("a letter's key"));
    }

    pub fn drag(&mut self, button: Button, from: [f32; 2], to: [f32; 2]) {
        for event in [Event::Press(button, from), Event::Move(to), Event::Release(button)] {
            self.viewer.event(event).unwrap();
            self.turn();
        }
    }
}
