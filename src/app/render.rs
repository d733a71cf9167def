//! `shadow-fields render`

use super::context::{Context, MergeArguments, size};
use super::quality::BakeArguments;
use super::{Global, output};
use crate::asset::false_color::Scheme;
use crate::asset::picture;
use crate::draw::Antialias;
use crate::error::{Error, Result};
use crate::frame::Frame;
use crate::scene::{Scene, values::NUMBER_LIMIT};
use crate::text;
use crate::truth::{self, ErrorMap, error_map, raycast::RayCast};
use clap::Args;
use serde_json::json;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Arguments of `render`.
#[derive(Args)]
pub struct Arguments {
    /// Scene file (see assets/scenes for examples), or the name of a built-in one
    scene: PathBuf,
    /// Picture to write; with --frames an animated PNG, or pictures numbered from 0 when the name has a run of #: out/f_####.png
    #[arg(short, long, value_name = "P.png")]
    output: PathBuf,
    /// Also write linear f32 radiance: of every picture when the name has a run of #, else of the last
    #[arg(long, value_name = "P.exr")]
    exr: Option<PathBuf>,
    /// Pictures of an animation
    #[arg(long, default_value_t = 1, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=10_000))]
    frames: u32,
    /// Pictures a second of scene time; what is shown depends on the time alone, not on this
    #[arg(long, default_value_t = 24, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=240))]
    fps: u16,
    /// Scene time of the first picture, seconds; default: the scene's, which is 0 unless it says otherwise
    #[arg(long, value_name = "SECONDS", value_parser = time_s, allow_negative_numbers = true)]
    time: Option<f64>,
    /// Size of the picture; default: the scene's
    #[arg(long, value_parser = size, value_name = "WxH")]
    size: Option<[u32; 2]>,
    /// Also write a row a lit vertex: entity, position, normal (world), linear radiosity without emission
    #[arg(long, value_name = "V.csv")]
    vertices: Option<PathBuf>,
    /// Also write times and counts
    #[arg(long, value_name = "S.json")]
    stats: Option<PathBuf>,
    /// Light by ray casting instead of shadow fields: slow, and what the fields are judged by
    #[arg(long, group = "judge")]
    reference: bool,
    /// Also write the error of the last picture's vertices against ray casting in false colour, with a scale bar
    #[arg(long, value_name = "E.png", group = "judge", conflicts_with = "reference")]
    error: Option<PathBuf>,
    /// With --error: blue too dark and red too bright, or dark right and light wrong
    #[arg(long, default_value = "signed", value_name = "SCHEME", requires = "error")]
    error_scheme: Scheme,
    /// With --error: the error with the last colour, relative to the root mean square of the radiosity; default: the 99th
    /// percentile, rounded up
    #[arg(long, value_name = "X", value_parser = positive, requires = "error", allow_negative_numbers = true)]
    error_limit: Option<f64>,
    /// With --reference or --error: rays a vertex for the sky and for each light
    #[arg(long, default_value_t = 1024, value_name = "N", requires = "judge", value_parser = clap::value_parser!(u32).range(8..=1 << 20))]
    rays: u32,
    /// How stairs along edges are smoothed: four samples a pixel, outlines and creases alone (quick on a software device), or not
    #[arg(long, default_value = "samples", value_name = "HOW")]
    antialias: Antialias,
    #[command(flatten)]
    merge: MergeArguments,
    #[command(flatten)]
    bake: BakeArguments,
}

/// Renders a scene.
pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    let numbered = Numbered::new(&arguments.output, "png")?;
    let others = [&arguments.exr, &arguments.vertices, &arguments.stats, &arguments.error];
    for path in others.into_iter().flatten().chain([&arguments.output]) {
        output::check_folder(path)?;
    }
    let numbered_exr = arguments.exr.as_deref().map(|path| Numbered::new(path, "exr")).transpose()?.flatten();
    let scene = Scene::load(&arguments.scene)?;
    let context = Context::new(global)?;
    let started = Instant::now();
    let shape = &scene.data.output;
    let first_s = arguments.time.unwrap_or(shape.time_s);
    let size = arguments.size.unwrap_or([shape.width, shape.height]);
    let options = arguments.merge.options(arguments.bake.options(), size, arguments.antialias);
    let mut frame = context.frame(&scene, options).map_err(|error| match error {
        Error::Input(_) => error.context(arguments.scene.display()),
        other => other,
    })?;
    let prepared = started.elapsed();

    let [width, height] = options.size;
    let mut timings = Vec::new();
    let mut worst_error = 0.0_f64;
    let mut draw = |index: u32| {
        let time_s = first_s + f64::from(index) / f64::from(arguments.fps);
        let placements = scene.at(time_s);
        let start = Instant::now();
        let passes = if arguments.reference {
            worst_error = light_by_rays(&mut frame, &placements, arguments.rays, global.seed)?.max(worst_error);
            frame.redraw(&placements, shape.white())?
        } else {
            frame.render(&placements, Some(shape.white()))?
        };
        timings.push((time_s, start.elapsed(), passes));
        let rgb = frame.picture();
        let last = arguments.exr.as_ref().filter(|_| index + 1 == arguments.frames).cloned();
        if let Some(path) = numbered_exr.as_ref().map(|numbered| numbered.path(index)).or(last) {
            frame.redraw(&placements, f32::INFINITY)?;
            picture::write_exr(&path, width, height, &frame.picture())?;
        }
        context.progress.pictures(index + 1, arguments.frames);
        Ok(rgb)
    };
    if numbered.is_none() && arguments.frames > 1 {
        let frames = (0..arguments.frames).map(|index| Ok(picture::encode_srgb(&draw(index)?, shape.exposure_ev)));
        picture::write_apng(&arguments.output, width, height, frames, arguments.fps)?;
    } else {
        for index in 0..arguments.frames {
            let path = numbered.as_ref().map_or_else(|| arguments.output.clone(), |numbered| numbered.path(index));
            picture::write_png(&path, width, height, &draw(index)?, shape.exposure_ev)?;
        }
    }
    let last_frame = frame.merged();
    let last = scene.at(timings.last().map_or(first_s, |(time_s, ..)| *time_s));
    if let Some(path) = &arguments.vertices {
        if !arguments.reference {
            // What no picture showed is lit for this.
            frame.render(&last, None)?;
        }
        text::write(path, &vertex_table(&frame, &last)?)?;
    }

    let error = arguments.error.as_ref().map(|path| {
        frame.render(&last, None)?;
        let cast = RayCast { rays: arguments.rays, seed: global.seed, ..Default::default() };
        let (reference, noise) = truth::picture(&scene, &last, &cast);
        let map = ErrorMap::new(&error_map::radiosity(&frame)?, &reference, arguments.error_scheme);
        map.write(path, &mut frame, &last, arguments.error_limit, noise)
    });
    let error = error.transpose()?;

    let frames: Vec<_> = timings
        .iter()
        .map(|(time_s, wall, passes)| {
            let passes: serde_json::Map<_, _> =
                passes.iter().map(|t| (format!("{}_ms", t.pass.replace(' ', "_")), json!(t.milliseconds))).collect();
            json!({ "time_s": time_s, "frame_ms": wall.as_secs_f64() * 1e3, "passes": passes })
        })
        .collect();
    let report = json!({
        "origin": context.origin(global),
        "scene": arguments.scene.display().to_string(),
        "entities": scene.entities.len(),
        "receiver_vertices": frame.receiver_vertex_count(),
        "variant": frame.variant().name,
        "lookups": frame.counts(&last),
        "last_frame": last_frame,
        "memory_bytes": frame.memory(),
        "device_bytes": frame.memory().device(),
        "reference_standard_error": arguments.reference.then_some(worst_error),
        "error": error,
        "options": {
            "bake": options.bake, "lattice": options.bake.lattice.to_string(), "skip": options.skip,
            "eps": options.eps,
            "size": options.size, "antialias": options.antialias,
        },
        "prepare_ms": prepared.as_secs_f64() * 1e3,
        "baked": frame.buffers.baked,
        "frames": frames,
    });
    if let Some(path) = &arguments.stats {
        text::write(path, &format!("{report:#}\n"))?;
    }
    if global.json {
        output::say(report.to_string());
    } else {
        let walls: Vec<f64> = timings.iter().map(|(_, wall, _)| wall.as_secs_f64() * 1e3).collect();
        output::say(format!(
            "{}: {} entities, {} lit vertices, prepared in {:.0} ms, {} in {:.1} ms (median), variant {}",
            output::shown(&arguments.output),
            scene.entities.len(),
            frame.receiver_vertex_count(),
            prepared.as_secs_f64() * 1e3,
            if arguments.frames == 1 { "a frame".into() } else { format!("{} frames, each", arguments.frames) },
            output::median(&walls),
            if arguments.reference {
                format!("none: {} rays, relative standard error {worst_error:.1e}", arguments.rays)
            } else {
                frame.variant().name.into()
            }
        ));
    }
    drop(frame);
    if arguments.merge.variant.is_none() {
        context.learn(global)?;
    }
    context.finish()
}

/// Replaces what the merge would find by what rays find. Returns the relative standard error.
fn light_by_rays(frame: &mut Frame, placements: &[crate::scene::Placement], rays: u32, seed: u64) -> Result<f64> {
    let cast = RayCast { rays, seed, ..Default::default() };
    let (lit, error) = truth::picture(frame.scene(), placements, &cast);
    for (entity, radiosity) in lit {
        frame.set_radiosity(entity, &radiosity)?;
    }
    Ok(error)
}

/// A scene time in seconds, within the limit of numbers in scene files.
fn time_s(text: &str) -> std::result::Result<f64, String> {
    let number = text.parse().ok().filter(|time: &f64| time.abs() <= NUMBER_LIMIT);
    number.ok_or_else(|| format!("expected seconds from -{NUMBER_LIMIT:e} to {NUMBER_LIMIT:e}, got \"{text}\""))
}

/// A number above 0.
fn positive(text: &str) -> std::result::Result<f64, String> {
    let number = text.parse().ok().filter(|x: &f64| x.is_finite() && *x > 0.0);
    number.ok_or_else(|| format!("expected a number above 0, got \"{text}\""))
}

/// An output name with a run of `#` that stands for the frame's number.
struct Numbered {
    before: String,
    digits: usize,
    after: String,
}

impl Numbered {
    /// A name that ends as the pictures do; `None` where it has no run of `#`.
    fn new(path: &Path, ending: &str) -> Result<Option<Self>> {
        output::check_ending(path, ending, "this picture")?;
        let Some(text) = path.to_str() else {
            let what = format!("{}: a name with # has to be UTF-8", path.display());
            return if path.as_os_str().as_encoded_bytes().contains(&b'#') {
                Err(Error::Usage(what))
            } else {
                Ok(None)
            };
        };
        Ok(text.find('#').map(|at| {
            let digits = text[at..].bytes().take_while(|b| *b == b'#').count();
            Numbered { before: text[..at].into(), digits, after: text[at + digits..].into() }
        }))
    }

    fn path(&self, index: u32) -> PathBuf {
        format!("{}{index:0width$}{}", self.before, self.after, width = self.digits).into()
    }
}

/// A row a vertex of every receiver, world frame.
fn vertex_table(frame: &Frame, placements: &[crate::scene::Placement]) -> Result<String> {
    let mut text = String::from("entity,x,y,z,nx,ny,nz,r,g,b\n");
    for (index, entity) in frame.scene().entities.iter().enumerate().filter(|(_, e)| e.receives) {
        let mesh = &frame.scene().meshes[entity.mesh];
        let placement = &placements[index];
        let name = if entity.name.contains([',', '"', '\n']) {
            format!("\"{}\"", entity.name.replace('"', "\"\""))
        } else {
            entity.name.clone()
        };
        let rotation = placement.turn();
        for ((position, normal), [r, g, b]) in mesh.positions.iter().zip(&mesh.normals).zip(frame.radiosity(index)?) {
            let p = placement.position.as_dvec3() + rotation * (position.as_dvec3() * f64::from(placement.scale));
            let n = rotation * normal.as_dvec3();
            let [p, n] = [p.as_vec3(), n.as_vec3()];
            let _ = writeln!(text, "{name},{},{},{},{},{},{},{r},{g},{b}", p.x, p.y, p.z, n.x, n.y, n.z);
        }
    }
    Ok(text)
}
