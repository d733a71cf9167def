//! `shadow-fields render` renders a scene to pictures, or to a table of vertices.

use super::context::Context;
use super::outputs::{self, Output, PictureName};
use super::source::{GltfSceneArguments, LookArguments};
use super::{Global, output};
use crate::asset::picture;
use crate::bench::figures::spread;
use crate::draw::Antialias;
use crate::error::{Error, Result};
use crate::frame::{self, Frame, PictureMemory, RenderOptions};
use crate::gpu::Timing;
use crate::scene::{self, Placement, Scene, light, values::NUMBER_LIMIT};
use crate::text::{self, number};
use crate::truth::pixels::{self, RayPicture};
use crate::truth::{self, EntityRadiosity, ErrorMap, World, error_map, raycast::RayCast};
use clap::Args;
use serde_json::{Value, json};
use std::fmt::Write;
use std::ops::Bound;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// A picture that takes more memory than this is told in a line.
const ANNOUNCED_BYTES: u64 = 1_000_000_000;

#[derive(Args)]
pub struct Arguments {
    /// Scene file (see assets/scenes for examples), the name of a built-in one, a glTF file (.glb, .gltf) or an OBJ
    /// file
    scene: PathBuf,
    /// Picture to write; with --frames an animated PNG, or pictures numbered from 0 when the name has a run of #:
    /// out/f_####.png
    #[arg(short, long, value_name = "P.png")]
    output: PathBuf,
    /// Also write linear f32 radiance, at most 65 504 where no ray is cast: of every picture when the name has a run of #,
    /// else of the last
    #[arg(long, value_name = "P.exr")]
    exr: Option<PathBuf>,
    /// Number of pictures
    #[arg(long, default_value_t = 1, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=10_000))]
    frames: u32,
    /// Number of the first picture; its time is --time plus this number of pictures, and numbered names start with it
    #[arg(long, default_value_t = 0, value_name = "N", value_parser = clap::value_parser!(u32).range(..=10_000_000))]
    first: u32,
    /// Also write one row for each lit vertex: entity, position (m) and normal in the world, linear radiosity without
    /// emission
    #[arg(long, value_name = "V.csv")]
    vertices: Option<PathBuf>,
    /// Also write times (ms) and counts
    #[arg(long, value_name = "S.json")]
    stats: Option<PathBuf>,
    /// Cast rays through every pixel instead of using shadow fields: slow, and what pictures should look like
    #[arg(long, group = "judge")]
    reference: bool,
    /// Also write the error of the last picture's vertices in false colour, too dark in blue and too bright in red, with
    /// a scale bar: against rays from the same vertices, which pixels between them do not enter
    #[arg(long, value_name = "E.png", group = "judge", conflicts_with = "reference")]
    error: Option<PathBuf>,
    /// With --error: the error that gets the last colour of the scale, relative to the root mean square of the
    /// radiosity; default: the 99th percentile, rounded up
    #[arg(long, value_name = "X", value_parser = number::<f64>((Bound::Excluded(0.0), Bound::Unbounded)), requires = "error", allow_negative_numbers = true)]
    error_limit: Option<f64>,
    /// Rays for the sky and for each light, 8 to 1048576: 256 by default of every pixel with --reference, 1024 of every
    /// vertex with --error
    #[arg(long, value_name = "N", requires = "judge", value_parser = clap::value_parser!(u32).range(8..=1 << 20))]
    rays: Option<u32>,
    #[command(flatten)]
    picture: PictureArguments,
    #[command(flatten)]
    look: LookArguments,
    #[command(flatten)]
    gltf: GltfSceneArguments,
}

impl Arguments {
    fn rays(&self) -> u32 {
        self.rays.unwrap_or(if self.reference { 256 } else { 1024 })
    }

    /// Compares all files that are to be written with those that the scene names.
    fn check_outputs(&self) -> Result<()> {
        let numbers = self.first..self.first + self.frames;
        let mut outputs = vec![Output::pictures("--output", &self.output, "png", numbers.clone())?];
        if let Some(path) = &self.exr {
            outputs.push(Output::pictures("--exr", path, "exr", numbers)?);
        }
        let others =
            [("--vertices", &self.vertices, "csv"), ("--stats", &self.stats, "json"), ("--error", &self.error, "png")];
        let given = others.into_iter().filter_map(|(option, path, ending)| Some((option, path.as_ref()?, ending)));
        outputs.extend(given.map(|(option, path, ending)| Output::new(option, path, ending)));
        let mut inputs = scene::files::of_scene(&self.scene);
        inputs.extend(self.look.picture().map(Path::to_owned));
        outputs::check(&inputs, &outputs)
    }
}

/// Options that decide a picture, besides the scene.
#[derive(Args, Clone)]
pub(super) struct PictureArguments {
    /// Pictures per second of scene time
    #[arg(long, default_value_t = 24, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=240))]
    pub(super) fps: u16,
    /// Scene time of the first picture, seconds; default: the scene's, which is 0 unless it says otherwise
    #[arg(long, value_name = "SECONDS", value_parser = number::<f64>(-NUMBER_LIMIT..=NUMBER_LIMIT), allow_negative_numbers = true)]
    pub(super) time: Option<f64>,
    #[command(flatten)]
    pub(super) options: RenderOptions,
}

impl PictureArguments {
    /// Scene time of picture 0, in seconds.
    pub(super) fn first_s(&self, scene: &Scene) -> f64 {
        self.time.unwrap_or(scene.data.output.time_s)
    }
}

pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    arguments.check_outputs()?;
    let mut scene = arguments.gltf.scene(global, &arguments.scene, arguments.picture.time.unwrap_or(0.0))?;
    let size = arguments.picture.options.frame(&scene)?.size;
    let first_s = arguments.picture.first_s(&scene);
    arguments.look.apply(global, &arguments.scene, &mut scene, size, first_s)?;
    let context = Context::new(global)?;
    let mut rendering = Rendering::new(global, arguments, &context, &scene)?;
    rendering.write_pictures()?;
    let last_frame = json!(rendering.frame.as_ref().map(Frame::merged));
    rendering.write_vertices()?;
    let error = rendering.write_error()?;
    let report = rendering.report(&last_frame, &error);
    if let Some(path) = &arguments.stats {
        text::write(path, format!("{report:#}\n"))?;
    }
    output::say(if global.json { report.to_string() } else { rendering.summary() });
    drop(rendering);
    if arguments.picture.options.variant.is_none() && !arguments.reference {
        context.learn(global)?;
    }
    context.finish()
}

struct Rendering<'a> {
    global: &'a Global,
    arguments: &'a Arguments,
    context: &'a Context,
    scene: &'a Scene,
    options: frame::Options,
    /// `None` where rays light all that is written.
    frame: Option<Frame>,
    exr: Option<PictureName>,
    prepared: Duration,
    /// Scene time of each picture in seconds, its wall time and its passes.
    timings: Vec<(f64, Duration, Vec<Timing>)>,
    /// Largest relative standard error of ray casting.
    worst_error: f64,
}

impl<'a> Rendering<'a> {
    fn new(global: &'a Global, arguments: &'a Arguments, context: &'a Context, scene: &'a Scene) -> Result<Self> {
        let started = Instant::now();
        let options = arguments.picture.options.frame(scene)?;
        let options = frame::Options { pictures: !arguments.reference, ..options };
        let frame = if arguments.reference && arguments.vertices.is_none() {
            None
        } else {
            announce(global, context, &options)?;
            let frame = context.frame(scene, options).map_err(|error| match error {
                Error::Input(_) => error.context(arguments.scene.display()),
                other => other,
            })?;
            Some(frame)
        };
        let prepared = started.elapsed();
        Ok(Rendering {
            global,
            arguments,
            context,
            scene,
            options,
            frame,
            exr: arguments.exr.as_deref().map(PictureName::new).transpose()?,
            prepared,
            timings: Vec::new(),
            worst_error: 0.0,
        })
    }

    /// Lights and draws one picture; also writes it as EXR where that is asked for.
    fn draw(&mut self, number: u32) -> Result<Vec<f32>> {
        let arguments = self.arguments;
        let white = self.scene.data.output.white();
        let index = arguments.first + number;
        let time_s = arguments.picture.first_s(self.scene) + f64::from(index) / f64::from(arguments.picture.fps);
        let placements = self.scene.at(time_s);
        let start = Instant::now();
        let (shown, linear, passes) = match &mut self.frame {
            Some(frame) if !arguments.reference => {
                let passes = frame.render(&placements, Some(white))?;
                (frame.picture(), None, passes)
            }
            _ => {
                let RayPicture { shown, linear, error } = self.cast(&placements);
                self.worst_error = error.max(self.worst_error);
                (shown, Some(linear), Vec::new())
            }
        };
        self.timings.push((time_s, start.elapsed(), passes));
        let exr = self.exr.as_ref().filter(|name| name.is_numbered() || number + 1 == arguments.frames);
        if let Some(path) = exr.map(|name| name.path(index)) {
            let [width, height] = self.options.size;
            let linear = match (linear, &mut self.frame) {
                (None, Some(frame)) => {
                    frame.redraw(&placements, f32::INFINITY)?;
                    frame.picture()
                }
                (linear, _) => linear.unwrap_or_default(),
            };
            picture::write_exr(&path, width, height, &linear)?;
        }
        self.context.progress.pictures(number + 1, arguments.frames);
        Ok(shown)
    }

    /// The rays of what is compared with pictures, or stands for them.
    fn rays(&self) -> RayCast {
        RayCast {
            rays: self.arguments.rays(),
            seed: self.global.seed,
            bounces: self.options.bounces.most(),
            single_scatter: self.options.single_scatter,
            ..Default::default()
        }
    }

    /// One picture by rays.
    fn cast(&self, placements: &[Placement]) -> RayPicture {
        let world = World::of(self.scene, placements);
        let cast = self.rays();
        let [_, height] = self.options.size;
        let tell = |rows: u32| self.context.progress.count("casting rays by rows", rows, height);
        let smoothed = self.options.antialias != Antialias::None;
        pixels::picture(&world, self.options.size, smoothed, &cast, &tell)
    }

    /// Writes all pictures: one file, an animated PNG, or numbered files.
    fn write_pictures(&mut self) -> Result<()> {
        let name = PictureName::new(&self.arguments.output)?;
        let arguments = self.arguments;
        let [width, height] = self.options.size;
        let exposure_ev = self.scene.data.output.exposure_ev();
        if !name.is_numbered() && arguments.frames > 1 {
            let frames = (0..arguments.frames).map(|index| Ok(picture::encode_srgb(&self.draw(index)?, exposure_ev)));
            return picture::write_apng(&arguments.output, width, height, frames, arguments.picture.fps);
        }
        for index in 0..arguments.frames {
            let path = name.path(arguments.first + index);
            picture::write_png(&path, width, height, &self.draw(index)?, exposure_ev)?;
        }
        Ok(())
    }

    /// Where everything stands in the last picture.
    fn last(&self) -> Vec<Placement> {
        let (time_s, ..) = self.timings.last().expect("at least one picture");
        self.scene.at(*time_s)
    }

    fn write_vertices(&mut self) -> Result<()> {
        let last = self.last();
        let cast = self.rays();
        let (Some(path), Some(frame)) = (&self.arguments.vertices, &mut self.frame) else { return Ok(()) };
        let lit = if self.arguments.reference {
            truth::picture(frame.scene(), &last, &cast).0
        } else {
            // What no picture showed is lit for this.
            frame.render(&last, None)?;
            error_map::radiosity(frame)?
        };
        text::write(path, vertex_table(frame.scene(), &last, &lit))
    }

    /// Compares the last picture's vertices with ray casting, where that is asked for.
    fn write_error(&mut self) -> Result<Value> {
        let last = self.last();
        let cast = self.rays();
        let (Some(path), Some(frame)) = (&self.arguments.error, &mut self.frame) else { return Ok(Value::Null) };
        frame.render(&last, None)?;
        let (reference, noise) = truth::picture(frame.scene(), &last, &cast);
        let map = ErrorMap::new(&error_map::radiosity(frame)?, &reference);
        Ok(json!(map.write(path, frame, &last, self.arguments.error_limit, noise)?))
    }

    /// What `--stats` and `--json` have.
    fn report(&self, last_frame: &Value, error: &Value) -> Value {
        let frame = self.frame.as_ref();
        let options = &self.options;
        let lights = light::listed(self.scene, options.lights).into_iter();
        let lights = lights.map(|(name, form)| json!({ "name": name, "form": form.name() }));
        let pictures = self.timings.iter().map(|(time_s, wall, passes)| {
            let named = |t: &Timing| (format!("{}_ms", t.pass.replace(' ', "_")), json!(t.milliseconds));
            // Only pixels that evaluate sharp lights are counted.
            let evaluated = passes.iter().find_map(|timing| timing.counted);
            let passes: serde_json::Map<_, _> = passes.iter().map(named).collect();
            json!({
                "time_s": time_s, "frame_ms": wall.as_secs_f64() * 1e3, "passes": passes,
                "pixels_evaluated": evaluated,
            })
        });
        json!({
            "origin": self.context.origin(self.global),
            "scene": self.arguments.scene.display().to_string(),
            "entities": self.scene.entities.len(),
            "receiver_vertices": frame.map(Frame::receiver_vertex_count),
            "variant": frame.map(|frame| frame.variant().name),
            "lights": lights.collect::<Vec<_>>(),
            "last_frame": last_frame,
            "device_bytes": frame.map(|_| self.context.device.allocated_bytes()),
            "reference_standard_error": self.arguments.reference.then_some(self.worst_error),
            "error": error,
            "options": {
                "bake": options.bake, "lattice": options.bake.lattice.to_string(), "skip": options.skip,
                "eps": options.eps, "lights": options.lights, "shading": options.shading,
                "size": options.size, "antialias": options.antialias,
            },
            "prepare_ms": self.prepared.as_secs_f64() * 1e3,
            "baked": frame.map(|frame| &frame.buffers.baked),
            "frames": pictures.collect::<Vec<_>>(),
        })
    }

    /// One line for people.
    fn summary(&self) -> String {
        let arguments = self.arguments;
        let walls: Vec<f64> = self.timings.iter().map(|(_, wall, _)| wall.as_secs_f64() * 1e3).collect();
        let prepared = self.frame.as_ref().map(|frame| {
            let prepared_ms = self.prepared.as_secs_f64() * 1e3;
            format!(", {} lit vertices, prepared in {prepared_ms:.0} ms", frame.receiver_vertex_count())
        });
        let median = spread(&walls).median;
        let frames = match arguments.frames {
            1 => format!("the first frame in {median:.1} ms"),
            count => format!("{count} frames, each in {median:.1} ms (median)"),
        };
        format!(
            "{}: {} entities{}, {frames}, {}",
            output::shown(&arguments.output),
            self.scene.entities.len(),
            prepared.unwrap_or_default(),
            match &self.frame {
                Some(frame) if !arguments.reference => format!("variant {}", frame.variant().name),
                _ => format!(
                    "{} rays a pixel and light, relative standard error {:.1e}",
                    arguments.rays(),
                    self.worst_error
                ),
            }
        )
    }
}

/// Says what memory a large picture takes, before any work is done for it.
fn announce(global: &Global, context: &Context, options: &frame::Options) -> Result<()> {
    let picture = PictureMemory::new(&context.device, options);
    picture.check(&context.device)?;
    if picture.all() >= ANNOUNCED_BYTES {
        output::note(global, format!("note: {picture}"));
    }
    Ok(())
}

/// A row a vertex of every receiver, world frame.
fn vertex_table(scene: &Scene, placements: &[Placement], lit: &[EntityRadiosity]) -> String {
    let mut text = String::from("entity,x,y,z,nx,ny,nz,r,g,b\n");
    for (index, radiosity) in lit {
        let entity = &scene.entities[*index];
        let mesh = scene.surface(*index);
        let placement = &placements[*index];
        let name = if entity.name.contains([',', '"', '\n']) {
            format!("\"{}\"", entity.name.replace('"', "\"\""))
        } else {
            entity.name.clone()
        };
        let rotation = placement.turn();
        for ((position, normal), [r, g, b]) in mesh.positions.iter().zip(&mesh.normals).zip(radiosity) {
            let p = placement.position.as_dvec3() + rotation * (position.as_dvec3() * f64::from(placement.scale));
            let n = rotation * normal.as_dvec3();
            let [p, n] = [p.as_vec3(), n.as_vec3()];
            let _ = writeln!(text, "{name},{},{},{},{},{},{},{r},{g},{b}", p.x, p.y, p.z, n.x, n.y, n.z);
        }
    }
    text
}
