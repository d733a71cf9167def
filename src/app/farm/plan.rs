//! `shadow-fields farm plan` cuts works into slices.

use super::super::context::Context;
use super::super::render::Numbered;
use super::super::{Global, output};
use super::run::{mesh_options, render_words, scene_hash};
use crate::bake::kinds::Kind;
use crate::error::{Error, Result};
use crate::farm::plan::{DeviceClass, Input, Plan, Task, TaskCost, TaskKind, Work};
use crate::merge::calibrate;
use crate::scene::{self, Scene};
use clap::Args;
use rayon::prelude::*;
use serde_json::json;
use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Seconds and MB that a picture is taken to need for each pixel, and for the scene: corrected by what ran.
const PIXEL_SECONDS: f64 = 1e-7;
const PICTURE_SECONDS: f64 = 0.05;
const PIXEL_MB: f64 = 1e-4;
/// Bytes of a picture's file for each pixel.
const PIXEL_BYTES: f64 = 1.5;
/// MB that a process holds for each triangle of a mesh, beside what it holds anyway.
const TRIANGLE_MB: f64 = 2e-3;

/// Arguments of `farm plan`.
#[derive(Args)]
#[command(after_help = "Examples:\n  shadow-fields farm plan meshes/ -o plan.json -- --quality high\n  \
    shadow-fields farm plan film.toml --frames 240 --pictures out/f_####.png -o film.json -- --size 1280x720")]
pub struct Arguments {
    /// What is done: meshes to bake (.obj, .glb and .gltf files, or folders that hold some), or scenes (.toml) to render
    #[arg(required = true, value_name = "WORK")]
    works: Vec<PathBuf>,
    /// Plan to write
    #[arg(short, long, value_name = "PLAN.json")]
    output: PathBuf,
    /// Shared folder of results, relative to the plan's
    #[arg(long, default_value = "results", value_name = "DIR")]
    results: String,
    /// Number of pictures of each scene
    #[arg(long, value_name = "N", requires = "pictures", value_parser = clap::value_parser!(u32).range(1..=10_000_000))]
    frames: Option<u32>,
    /// Where `farm collect` puts the pictures of a scene: a name with a run of # for the number, relative to the plan's folder. With
    /// several scenes, $ stands for the scene's name
    #[arg(long, value_name = "F_####.png")]
    pictures: Option<String>,
    /// Options of `bake` or `render` after --, which decide the bytes: --quality, --size and others
    #[arg(last = true, value_name = "OPTIONS")]
    words: Vec<String>,
}

/// A file to plan, read.
struct Read {
    input: Input,
    /// Kinds with what they cost, of a mesh; empty for a scene.
    kinds: Vec<(Kind, TaskCost)>,
    pixels: f64,
}

/// Plans slices.
pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    let started = Instant::now();
    output::check_folder(&arguments.output)?;
    let full = std::path::absolute(&arguments.output).map_err(|e| Error::input(&arguments.output, e))?;
    let folder = full.parent().unwrap_or(Path::new("/")).to_owned();
    let context = Context::new(global)?;
    let (class, variant) = (DeviceClass::of(&context.device), calibrate::best_known(&context.device).name);
    // The device is only asked for its names: what it holds is free before work is listed.
    context.finish()?;
    let mut plan = Plan::new(class, arguments.results.clone());
    let (meshes, scenes) = find(&arguments.works)?;
    if !meshes.is_empty() {
        add_bakes(&mut plan, &arguments.words, &meshes, &folder)?;
    }
    if let Some(Pictures { frames, patterns }) = pictures(arguments, &scenes)? {
        // Without a variant of its own each machine would take what is fastest there.
        let mut words = arguments.words.clone();
        if !words.iter().any(|word| word.starts_with("--variant")) {
            words.extend(["--variant".into(), variant.into()]);
        }
        render_words(&scenes[0], &words)?;
        for (path, pattern) in scenes.iter().zip(patterns) {
            add_pictures(&mut plan, read_scene(path, &folder, &words)?, (words.clone(), pattern), frames);
        }
    }
    plan.write(&arguments.output)?;
    let seconds: f64 = plan.slices.iter().map(|slice| f64::from(slice.seconds)).sum();
    if global.json {
        output::say(json!({ "slices": plan.slices.len(), "tasks": plan.tasks.len(), "seconds": seconds }).to_string());
    } else {
        output::say(format!(
            "{}: {} slices of {} tasks, about {:.0} s of work, planned in {:.2} s",
            output::shown(&arguments.output),
            plan.slices.len(),
            plan.tasks.len(),
            seconds,
            started.elapsed().as_secs_f64()
        ));
    }
    Ok(())
}

/// Adds the bakes of meshes. Those of equal content share what is baked.
fn add_bakes(plan: &mut Plan, words: &[String], meshes: &[PathBuf], folder: &Path) -> Result<()> {
    let options = mesh_options(words)?;
    let work = plan.works.len() as u32;
    plan.works.push(Work { words: words.to_vec(), pictures: None });
    let read: Vec<Read> = meshes.par_iter().map(|path| read_mesh(path, folder, &options)).collect::<Result<_>>()?;
    let mut known = HashSet::new();
    for Read { input, kinds, .. } in read {
        if !known.insert(input.hash.clone()) {
            continue;
        }
        let index = plan.inputs.len() as u32;
        plan.inputs.push(input);
        for (kind, cost) in kinds {
            let parts = if kind.is_cut() { Plan::parts(cost.seconds) } else { 1 };
            let share = f64::from(parts);
            let cost = TaskCost { seconds: cost.seconds / share, bytes: cost.bytes / share, ..cost };
            let task = |first| Task { work, input: index, kind: TaskKind::Bake(kind), first, count: parts };
            (0..parts).for_each(|part| plan.add(task(part), cost));
        }
    }
    Ok(())
}

/// Adds the pictures of a scene, `words` being those of `render`, in runs that fit into a slice.
fn add_pictures(plan: &mut Plan, read: Read, (words, pattern): (Vec<String>, String), frames: u32) {
    let (work, index) = (plan.works.len() as u32, plan.inputs.len() as u32);
    plan.works.push(Work { words, pictures: Some(pattern) });
    plan.inputs.push(read.input);
    let each = TaskCost {
        seconds: PICTURE_SECONDS + read.pixels * PIXEL_SECONDS,
        memory_mb: read.pixels * PIXEL_MB,
        bytes: read.pixels * PIXEL_BYTES,
    };
    let run = Plan::fitting(each);
    for first in (0..frames).step_by(run as usize) {
        let count = run.min(frames - first);
        let share = f64::from(count);
        let cost = TaskCost { seconds: share * each.seconds, bytes: share * each.bytes, ..each };
        plan.add(Task { work, input: index, kind: TaskKind::Frames, first, count }, cost);
    }
}

/// How many pictures there are of each scene, and the pattern of their names for each.
struct Pictures {
    frames: u32,
    patterns: Vec<String>,
}

/// What is said of pictures; `None` where there are no scenes.
///
/// # Errors
/// `Usage` where something is missing, or pictures would overwrite one another.
fn pictures(arguments: &Arguments, scenes: &[PathBuf]) -> Result<Option<Pictures>> {
    let wrong = |what: String| Err(Error::Usage(what));
    let (frames, pictures) = match (scenes.first(), arguments.frames, &arguments.pictures) {
        (Some(_), Some(frames), Some(pictures)) => (frames, pictures),
        (Some(scene), ..) => return wrong(format!("{}: a scene needs --frames and --pictures", scene.display())),
        (None, None, None) => return Ok(None),
        (None, ..) => return wrong("--frames and --pictures are for scenes, and there is none".into()),
    };
    if frames > 1 && Numbered::new(Path::new(pictures), "png")?.is_none() {
        return wrong(format!("--pictures {pictures}: the name needs a run of # for the number"));
    }
    let name = |path: &PathBuf| path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let patterns: Vec<String> = scenes.iter().map(|path| pictures.replace('$', &name(path))).collect();
    let distinct: HashSet<&String> = patterns.iter().collect();
    if distinct.len() < patterns.len() {
        return wrong(format!(
            "--pictures {pictures}: the names of all scenes have to differ; $ stands for the scene's name"
        ));
    }
    Ok(Some(Pictures { frames, patterns }))
}

/// Meshes and scenes of the works, in order of their names within a folder.
fn find(works: &[PathBuf]) -> Result<(Vec<PathBuf>, Vec<PathBuf>)> {
    let is_mesh = |path: &Path| {
        path.extension().is_some_and(|e| ["obj", "glb", "gltf"].iter().any(|m| e.eq_ignore_ascii_case(m)))
    };
    let (mut meshes, mut scenes) = (Vec::new(), Vec::new());
    for path in works {
        let cannot = |error| Error::input(path, format!("cannot be read: {error}"));
        if std::fs::metadata(path).map_err(cannot)?.is_dir() {
            let entries = std::fs::read_dir(path).map_err(cannot)?.map(|entry| entry.map(|e| e.path()));
            let mut found: Vec<PathBuf> = entries.collect::<std::io::Result<_>>().map_err(cannot)?;
            found.retain(|path| is_mesh(path));
            if found.is_empty() {
                return Err(Error::input(path, "a folder without meshes (.obj, .glb, .gltf)"));
            }
            found.sort();
            meshes.extend(found);
        } else if is_mesh(path) {
            meshes.push(path.clone());
        } else if path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("toml")) {
            scenes.push(path.clone());
        } else {
            return Err(Error::input(path, "expected a folder, a mesh (.obj, .glb, .gltf) or a scene (.toml)"));
        }
    }
    Ok((meshes, scenes))
}

/// A path as plans have it.
fn written(path: &Path, folder: &Path) -> Result<String> {
    let full = std::path::absolute(path).map_err(|error| Error::input(path, error))?;
    let short = full.strip_prefix(folder).unwrap_or(&full);
    short.to_str().map(str::to_owned).ok_or_else(|| Error::input(path, "a plan needs names in UTF-8"))
}

fn read_mesh(path: &Path, folder: &Path, options: &crate::bake::Options) -> Result<Read> {
    let (mesh, _) = scene::load_mesh(path)?;
    let memory_mb = mesh.triangles.len() as f64 * TRIANGLE_MB;
    let cost = |kind: Kind| TaskCost {
        seconds: kind.seconds(&mesh, options),
        memory_mb,
        bytes: kind.bytes(&mesh, options) as f64,
    };
    let kinds = Kind::of(&mesh).into_iter().map(|kind| (kind, cost(kind))).collect();
    let input = Input { path: written(path, folder)?, hash: crate::bake::hash_text(&mesh) };
    Ok(Read { input, kinds, pixels: 0.0 })
}

fn read_scene(path: &Path, folder: &Path, words: &[String]) -> Result<Read> {
    let scene = Scene::load(path)?;
    let size = render_words(path, words)?.unwrap_or([scene.data.output.width, scene.data.output.height]);
    let input = Input { path: written(path, folder)?, hash: scene_hash(&scene) };
    Ok(Read { input, kinds: Vec::new(), pixels: f64::from(size[0]) * f64::from(size[1]) })
}
