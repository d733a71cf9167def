//! `shadow-fields view` opens a window.

use super::context::Context;
use super::source::{GltfSceneArguments, LookArguments};
use super::{Global, output};
use crate::draw::Antialias;
use crate::error::{Error, Result};
use crate::frame::{self, RenderOptions};
use crate::gpu::{self, Device, PresentMode, Window, display, process};
use crate::scene::Scene;
use crate::view::command::Command;
use crate::view::editor::add_sky;
use crate::view::input::{Event, Key};
use crate::view::{Editor, FrameTarget, Setup, Viewer};
use clap::Args;
use raw_window_handle::HasDisplayHandle;
use std::mem::ManuallyDrop;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};
use winit::application::ApplicationHandler;
use winit::dpi::PhysicalSize;
use winit::event::{ElementState, KeyEvent, MouseScrollDelta, WindowEvent};
use winit::event_loop::{ActiveEventLoop, ControlFlow, EventLoop};
use winit::keyboard::{Key as Logical, ModifiersState, NamedKey};
use winit::window::WindowId;

/// Pixels of a touchpad's wheel that count as a notch.
const NOTCH_PX: f64 = 40.0;
/// How often a window that shows nothing is asked again.
const HIDDEN_PERIOD: Duration = Duration::from_millis(200);
/// Smallest window in which the overlay can be read.
const LEAST_SIZE: PhysicalSize<u32> = PhysicalSize::new(160, 120);

#[derive(Args)]
#[command(after_long_help = format!("Controls:\n{}", crate::view::input::help()))]
pub struct Arguments {
    /// Scene file, the name of a built-in one, a glTF file (.glb, .gltf) or an OBJ file. Another can be dropped on the
    /// window (on X11)
    #[arg(default_value = "assets/scenes/teapot_lights.toml")]
    scene: PathBuf,
    /// Vulkan present mode: when a finished frame is shown
    #[arg(long, default_value = "fifo", value_name = "MODE")]
    present_mode: PresentMode,
    /// Start with the motion paused
    #[arg(long)]
    paused: bool,
    /// Start without panels (H shows them)
    #[arg(long)]
    no_overlay: bool,
    #[command(flatten)]
    options: RenderOptions,
    #[command(flatten)]
    look: LookArguments,
    #[command(flatten)]
    gltf: GltfSceneArguments,
}

/// Opens the window and stays until it is closed.
pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    process::share_arena();
    let mut scene = arguments.gltf.scene(global, &arguments.scene, 0.0)?;
    if arguments.look.environment.is_none() {
        add_sky(&mut scene);
    }
    let size = arguments.options.size.unwrap_or([scene.data.output.width, scene.data.output.height]);
    let time_s = scene.data.output.time_s;
    arguments.look.apply(global, &arguments.scene, &mut scene, size, time_s)?;
    let events = event_loop()?;
    let owned = events.owned_display_handle();
    let handle = owned.display_handle().map_err(no_display)?.as_raw();
    let proxy = events.create_proxy();
    // A loop that has ended need not be woken.
    let _watch = display::outlive(handle, move || proxy.send_event(()).unwrap_or_default());
    let mut device_options = gpu::DeviceOptions::default();
    let context = Context::with_device(global, |options| {
        device_options = options.clone();
        Device::for_display(options, handle)
    })?;
    let outcome = {
        let mut app = App {
            global,
            arguments,
            context: &context,
            device_options,
            scene: Some(scene),
            shown: None,
            outcome: Ok(()),
        };
        // winit panics over the loss of the display, which is told below.
        let hook = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |panic| {
            if !display::is_lost() {
                hook(panic);
            }
        }));
        // Whatever is broken after a panic, the edited scene is data that can be saved.
        let ran = catch_unwind(AssertUnwindSafe(|| events.run_app(&mut app)));
        let App { shown, outcome, .. } = app;
        match ran {
            _ if display::is_lost() => close_lost(shown, owned),
            Ok(ran) => {
                let ran = ran.map_err(|error| Error::Failed(format!("the window system: {error}")));
                close(shown, outcome.and(ran))
            }
            Err(panic) => {
                if let Err(error) = close(shown, Err(Error::Failed("the window failed".into()))) {
                    output::complain(&error);
                }
                resume_unwind(panic);
            }
        }
    };
    let finished = context.finish();
    outcome.and(finished)
}

/// Ends the window after `outcome`. If that or the end itself is an error, edits are saved first.
fn close(shown: Option<Shown>, outcome: Result<()>) -> Result<()> {
    let Some(mut shown) = shown else { return outcome };
    // A device that was lost would be waited for in vain.
    let outcome = outcome.and_then(|()| shown.viewer.settle());
    outcome.map_err(|error| shown.viewer.editor.rescued(error))
}

/// Ends the window whose display is lost. What belongs to it is left to the end of the process, since its calls would
/// fail or wait.
fn close_lost(shown: Option<Shown>, display: impl Sized) -> Result<()> {
    let mut shown = ManuallyDrop::new(shown);
    let _display = ManuallyDrop::new(display);
    let error = display::lost();
    Err(match &mut *shown {
        Some(shown) => shown.viewer.editor.rescued(error),
        None => error,
    })
}

/// The window's title for a scene's file.
fn title(scene: &Path) -> String {
    format!("{} - shadow-fields", scene.display())
}

fn no_display(error: impl std::fmt::Display) -> Error {
    let text = error.to_string().replace('\n', " ");
    // winit puts the place in its source in front.
    let reason = match text.strip_prefix("os error at ") {
        Some(rest) => rest.rsplit(": ").next().unwrap_or(rest),
        None => &text,
    };
    Error::Unsupported(format!(
        "no display to open a window on ({reason}); `shadow-fields render SCENE.toml -o P.png` needs none"
    ))
}

/// winit panics where a library that it loads at run time is missing; here that is an error that names the packages.
fn event_loop() -> Result<EventLoop<()>> {
    let hook = std::panic::take_hook();
    std::panic::set_hook(Box::new(|_| ()));
    let made = std::panic::catch_unwind(EventLoop::new);
    std::panic::set_hook(hook);
    let libraries = "a library of the window system is missing; Debian's packages are libx11-6 libx11-xcb1 libxcursor1 libxi6 \
                     libxkbcommon-x11-0";
    match made {
        Ok(Ok(events)) => Ok(events),
        Ok(Err(error)) if error.to_string().contains(".so") => Err(no_display(format!("{libraries}: {error}"))),
        Ok(Err(error)) => Err(no_display(error)),
        Err(_) => Err(no_display(libraries)),
    }
}

/// The open window and all that draws into it; fields go in this order.
struct Shown {
    viewer: Viewer,
    egui: egui_winit::State,
    target: Window,
    window: Arc<winit::window::Window>,
    /// The scene's file that the title names.
    titled: PathBuf,
    modifiers: ModifiersState,
    pointer: [f32; 2],
    updated: Instant,
    opened: Instant,
    /// When nothing could be drawn, if that was the last time.
    hidden: Option<Instant>,
}

struct App<'a> {
    global: &'a Global,
    arguments: &'a Arguments,
    context: &'a Context,
    device_options: gpu::DeviceOptions,
    scene: Option<Scene>,
    shown: Option<Shown>,
    outcome: Result<()>,
}

impl App<'_> {
    fn open(&mut self, events: &ActiveEventLoop, scene: Scene) -> Result<Shown> {
        let device = &self.context.device;
        let options = self.arguments.options.frame(&scene)?;
        let [width, height] = options.size;
        let attributes = winit::window::Window::default_attributes()
            .with_title(title(&self.arguments.scene))
            .with_inner_size(PhysicalSize::new(width, height))
            .with_min_inner_size(LEAST_SIZE);
        let window = Arc::new(events.create_window(attributes).map_err(no_display)?);
        let own: [u32; 2] = window.inner_size().into();
        let target = Window::new(device, &window, own, self.arguments.present_mode)?;
        let antialias = self.arguments.options.antialias.unwrap_or_else(|| Antialias::usual(device));
        let setup = Setup {
            device: device.clone(),
            options: self.device_options.clone(),
            library: self.context.baker.library().clone(),
            cache: self.context.cache.clone(),
            frame: frame::Options { size: own, antialias, ..options },
            refines: self.arguments.options.antialias.is_none() && antialias != Antialias::Samples,
            format: target.format(),
            seed: self.global.seed,
            strict: self.arguments.gltf.gltf.strict,
            preview_after: Duration::from_secs(1),
        };
        let mut editor = Editor::new(scene, &self.arguments.scene);
        let paused = self.arguments.paused.then_some(Command::ToggleRunning);
        for command in paused.into_iter().chain(self.arguments.no_overlay.then_some(Command::ToggleOverlay)) {
            editor.apply(command);
        }
        let scale = window.scale_factor() as f32;
        let mut viewer = Viewer::new(setup, editor, scale)?;
        viewer.apply(Command::Resize(own))?;
        let egui = egui_winit::State::new(
            viewer.egui.clone(),
            egui::ViewportId::ROOT,
            &*window,
            Some(scale),
            None,
            Some(device.limits.max_image_dimension2_d as usize),
        );
        window.request_redraw();
        Ok(Shown {
            viewer,
            egui,
            target,
            window,
            titled: self.arguments.scene.clone(),
            modifiers: ModifiersState::empty(),
            pointer: [0.0; 2],
            updated: Instant::now(),
            opened: Instant::now(),
            hidden: None,
        })
    }

    /// Ends the loop where something failed or the user is done.
    fn check(&mut self, events: &ActiveEventLoop, outcome: Result<()>) {
        if let Err(error) = outcome {
            self.outcome = Err(error);
            events.exit();
        } else if self.shown.as_ref().is_some_and(|shown| shown.viewer.quit) {
            events.exit();
        }
    }
}

impl ApplicationHandler for App<'_> {
    fn resumed(&mut self, events: &ActiveEventLoop) {
        let Some(scene) = self.scene.take() else { return };
        let opened = self.open(events, scene).map(|shown| self.shown = Some(shown));
        self.check(events, opened);
    }

    fn window_event(&mut self, events: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        let Some(shown) = self.shown.as_mut().filter(|_| !display::is_lost()) else { return };
        let outcome = shown.window_event(&event);
        self.check(events, outcome);
    }

    fn about_to_wait(&mut self, events: &ActiveEventLoop) {
        if display::is_lost() {
            return events.exit();
        }
        let Some(shown) = &mut self.shown else { return };
        let now = Instant::now();
        let passed = now.duration_since(std::mem::replace(&mut shown.updated, now));
        let outcome = shown.viewer.update(passed.as_secs_f64());
        let flow = if let Some(tried) = shown.hidden {
            if tried.elapsed() >= HIDDEN_PERIOD {
                shown.window.request_redraw();
            }
            ControlFlow::WaitUntil(now + HIDDEN_PERIOD)
        } else if shown.viewer.wants_frame() {
            shown.window.request_redraw();
            ControlFlow::Wait
        } else {
            shown.viewer.idle().map_or(ControlFlow::Wait, |idle| ControlFlow::WaitUntil(now + idle))
        };
        events.set_control_flow(flow);
        self.check(events, outcome);
    }
}

impl Shown {
    /// egui's input, as `take_egui_input` gives it. That panics where another program has just destroyed the window.
    fn input(&mut self) -> egui::RawInput {
        let scale = egui_winit::pixels_per_point(&self.viewer.egui, &self.window);
        let [width, height] = self.viewer.editor.window().map(|side| side as f32 / scale);
        let input = self.egui.egui_input_mut();
        input.time = Some(self.opened.elapsed().as_secs_f64());
        input.screen_rect = Some(egui::Rect::from_min_size(egui::Pos2::ZERO, egui::vec2(width, height)));
        input.viewport_id = egui::ViewportId::ROOT;
        let viewport = input.viewports.entry(egui::ViewportId::ROOT).or_default();
        viewport.native_pixels_per_point = Some(self.window.scale_factor() as f32);
        input.take()
    }

    fn window_event(&mut self, event: &WindowEvent) -> Result<()> {
        if let WindowEvent::RedrawRequested = event {
            return self.redraw();
        }
        let response = self.egui.on_window_event(&self.window, event);
        if response.repaint {
            self.window.request_redraw();
        }
        match event {
            WindowEvent::CloseRequested => self.viewer.apply(Command::Quit),
            WindowEvent::DroppedFile(path) => self.viewer.open(path),
            WindowEvent::Destroyed => Err(Error::Device("another program destroyed the window".into())),
            WindowEvent::Resized(size) => {
                log::info!("resized to {}x{}", size.width, size.height);
                self.hidden = None;
                self.target.resize((*size).into());
                self.viewer.apply(Command::Resize((*size).into()))
            }
            WindowEvent::Occluded(occluded) => {
                log::info!("occluded: {occluded}");
                self.hidden = self.hidden.filter(|_| *occluded);
                Ok(())
            }
            WindowEvent::ModifiersChanged(modifiers) => {
                self.modifiers = modifiers.state();
                Ok(())
            }
            WindowEvent::Focused(false) => self.viewer.event(Event::Lost),
            WindowEvent::CursorMoved { position, .. } => {
                self.pointer = [position.x as f32, position.y as f32];
                if response.consumed && !self.viewer.input.is_dragging() {
                    return Ok(());
                }
                self.viewer.event(Event::Move(self.pointer))
            }
            // A dragged entity is released wherever the pointer is.
            WindowEvent::MouseInput { state: ElementState::Released, button, .. } => {
                self.viewer.event(Event::Release(*button))
            }
            _ if response.consumed => Ok(()),
            WindowEvent::MouseInput { state: ElementState::Pressed, button, .. } => {
                self.viewer.event(Event::Press(*button, self.pointer))
            }
            WindowEvent::MouseWheel { delta, .. } => {
                let notches = match delta {
                    MouseScrollDelta::LineDelta(_, lines) => *lines,
                    MouseScrollDelta::PixelDelta(pixels) => (pixels.y / NOTCH_PX) as f32,
                };
                self.viewer.event(Event::Wheel(notches))
            }
            WindowEvent::KeyboardInput { event, is_synthetic: false, .. } if event.state == ElementState::Pressed => {
                let control = self.modifiers.control_key();
                key_of(event).map_or(Ok(()), |key| self.viewer.event(Event::Key { key, control, repeat: event.repeat }))
            }
            _ => Ok(()),
        }
    }

    fn redraw(&mut self) -> Result<()> {
        let input = self.input();
        let output = self.viewer.ui(input)?;
        self.egui.handle_platform_output(&self.window, output);
        self.window.pre_present_notify();
        let scene = self.viewer.editor.path();
        if scene != self.titled {
            self.window.set_title(&title(scene));
            self.titled = scene.to_owned();
        }
        let drawn = self.viewer.draw(FrameTarget::Window(&mut self.target))?;
        self.hidden = (!drawn).then(Instant::now);
        Ok(())
    }
}

fn key_of(event: &KeyEvent) -> Option<Key> {
    match &event.logical_key {
        Logical::Named(NamedKey::Space) => Some(Key::Space),
        Logical::Named(NamedKey::Escape) => Some(Key::Escape),
        Logical::Named(NamedKey::Home) => Some(Key::Home),
        Logical::Named(NamedKey::F1) => Some(Key::F1),
        Logical::Named(NamedKey::F12) => Some(Key::F12),
        Logical::Character(text) => Key::from_name(text),
        _ => None,
    }
}
