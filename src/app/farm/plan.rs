//! `shadow-fields farm plan` cuts bakes and pictures into slices.

use super::super::context::Context;
use super::super::outputs::{self, Output, PictureName, check_ending};
use super::super::render::PictureArguments;
use super::super::{Global, output};
use super::run::scene_hash;
use crate::bake::hash_text;
use crate::error::{Error, Result};
use crate::farm::plan::{device_class, plain};
use crate::farm::{Film, Input, Plan, counted};
use crate::merge::calibrate;
use crate::scene::{self, Scene, gltf, single};
use crate::truth::exposure;
use clap::Args;
use rayon::prelude::*;
use serde_json::json;
use std::collections::HashSet;
use std::path::{Path, PathBuf};

#[derive(Args)]
#[command(after_help = "Examples:\n  shadow-fields farm plan meshes/ -o plan.json --quality high\n  \
    shadow-fields farm plan film.toml --frames 240 --pictures out/f_####.png -o film.json --size 1280x720")]
pub struct Arguments {
    /// Meshes to bake (.obj, .glb and .gltf files, or folders that hold some), or scenes (.toml) to render
    #[arg(required = true, value_name = "WORK")]
    works: Vec<PathBuf>,
    /// Plan to write
    #[arg(short, long, value_name = "PLAN.json")]
    output: PathBuf,
    /// Replace the plan's file even if it is not a plan
    #[arg(long)]
    force: bool,
    /// Shared folder of results, relative to the plan's
    #[arg(long, default_value = "results", value_name = "DIR")]
    results: String,
    /// Meshes or pictures of a slice, which should take some minutes
    #[arg(long, default_value_t = 20, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=200))]
    per_slice: u32,
    /// Number of pictures of each scene
    #[arg(long, value_name = "N", requires = "pictures", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    frames: Option<u32>,
    /// Where `farm collect` puts the pictures of a scene: a name with a run of # for the number, relative to the plan's
    /// folder. With several scenes, $ stands for the scene's name
    #[arg(long, value_name = "F_####.png")]
    pictures: Option<String>,
    #[command(flatten)]
    picture: PictureArguments,
}

pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    let full = std::path::absolute(&arguments.output).map_err(|error| Error::input(&arguments.output, error))?;
    plain(&full)?;
    plain(Path::new(&arguments.results))?;
    if let Some(folder) = &global.cache_dir {
        plain(folder)?;
    }
    check_ending("--output", &arguments.output, "json")?;
    let (meshes, scenes) = find(global, &arguments.works)?;
    let folder = full.parent().unwrap_or(Path::new("/"));
    let patterns = patterns(arguments, &scenes)?;
    let of_meshes = meshes.iter().flat_map(|mesh| scene::files::of_mesh(mesh));
    let of_scenes = scenes.iter().flat_map(|scene| scene::files::of_scene(scene));
    check_outputs(arguments, &of_meshes.chain(of_scenes).collect::<Vec<_>>(), folder, &patterns)?;
    let context = Context::new(global)?;
    let mut picture = arguments.picture.clone();
    // Without a variant of its own each machine would take what is fastest there.
    picture.options.variant.get_or_insert_with(|| calibrate::best_known(&context.device));
    let device = device_class(&context.device);
    // The device is only asked for its names: what it holds is free before work is listed.
    context.finish()?;

    let mut plan = Plan::new(device, arguments.results.clone(), picture.options.bake.resolve()?);
    let read = meshes.par_iter().map(|path| {
        let (mesh, _) = scene::load_mesh(path)?;
        Ok(Input { path: written(path, folder)?, hash: hash_text(&mesh) })
    });
    let mut inputs: Vec<Input> = read.collect::<Result<_>>()?;
    // Meshes of equal content share what is baked.
    let mut known = HashSet::new();
    inputs.retain(|input| known.insert(input.hash.clone()));
    plan.add_meshes(inputs, arguments.per_slice);
    for (path, pictures) in scenes.iter().zip(patterns) {
        let mut scene = Scene::load_at(path, picture.time.unwrap_or(0.0))?;
        let options = picture.options.frame(&scene)?;
        let first_s = picture.first_s(&scene);
        let input = Input { path: written(path, folder)?, hash: scene_hash(&scene) };
        let [width, height] = options.size.map(f64::from);
        exposure::settle(&mut scene, first_s, width / height);
        let exposure_ev = scene.data.output.exposure_ev();
        let film = Film { scene: input, pictures, options, exposure_ev, first_s, fps: picture.fps };
        plan.add_film(film, arguments.frames.unwrap_or(1), arguments.per_slice);
    }
    plan.write(&arguments.output)?;
    let slices = plan.slices.len();
    output::say(if global.json {
        json!({ "slices": slices }).to_string()
    } else {
        format!("{}: {}", output::shown(&arguments.output), counted(slices, "slice"))
    });
    Ok(())
}

/// Fails where the plan or a picture would replace an input, or the plan a file that is none.
fn check_outputs(arguments: &Arguments, inputs: &[PathBuf], folder: &Path, patterns: &[String]) -> Result<()> {
    let path = &arguments.output;
    let mut outputs = vec![Output::new("--output", path, "json")];
    let numbers = 0..arguments.frames.unwrap_or(1);
    for pattern in patterns {
        let pictures = Output::pictures("--pictures", &folder.join(pattern), "png", numbers.clone())?;
        // `collect` makes their folder: only one that is there can be an input.
        outputs.extend(pictures.existing());
    }
    outputs::check(inputs, &outputs)?;
    if path.is_file() && !arguments.force && !Plan::is_at(path) {
        return Err(Error::Usage(format!("{} is no plan; --force replaces it", path.display())));
    }
    Ok(())
}

/// Where the pictures of each scene go.
fn patterns(arguments: &Arguments, scenes: &[PathBuf]) -> Result<Vec<String>> {
    let wrong = |what: String| Err(Error::Usage(what));
    let (frames, pictures) = match (scenes.first(), arguments.frames, &arguments.pictures) {
        (Some(_), Some(frames), Some(pictures)) => (frames, pictures),
        (Some(scene), ..) => return wrong(format!("{}: a scene needs --frames and --pictures", scene.display())),
        (None, None, None) if arguments.picture.options.size.is_none() && arguments.picture.time.is_none() => {
            return Ok(Vec::new());
        }
        (None, ..) => return wrong("--frames, --pictures, --size and --time are for scenes, and there is none".into()),
    };
    plain(Path::new(pictures))?;
    check_ending("--pictures", Path::new(pictures), "png")?;
    if frames > 1 && !PictureName::new(Path::new(pictures))?.is_numbered() {
        return wrong(format!("--pictures {pictures}: the name needs a run of # for the number"));
    }
    let name = |path: &PathBuf| path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let patterns: Vec<String> = scenes.iter().map(|path| pictures.replace('$', &name(path))).collect();
    let distinct: HashSet<&String> = patterns.iter().collect();
    if distinct.len() < patterns.len() {
        let what = "the names of all scenes have to differ; $ stands for the scene's name";
        return wrong(format!("--pictures {pictures}: {what}"));
    }
    Ok(patterns)
}

/// Meshes and scenes of the works, in order of their names within a folder.
fn find(global: &Global, works: &[PathBuf]) -> Result<(Vec<PathBuf>, Vec<PathBuf>)> {
    let is_mesh = |path: &Path| gltf::is_gltf(path) || single::is_obj(path);
    let mut meshes = Vec::new();
    let mut scenes = Vec::new();
    for path in works {
        let cannot = |error| Error::input(path, format!("cannot be read: {error}"));
        if std::fs::metadata(path).map_err(cannot)?.is_dir() {
            let entries = std::fs::read_dir(path).map_err(cannot)?.map(|entry| entry.map(|e| e.path()));
            let entries: Vec<PathBuf> = entries.collect::<std::io::Result<_>>().map_err(cannot)?;
            let folders = entries.iter().filter(|path| path.is_dir()).count();
            if folders > 0 {
                let left_out = counted(folders, "folder");
                output::note(global, format!("note: {}: {left_out} in it left out; name them too", path.display()));
            }
            let mut found: Vec<PathBuf> = entries.into_iter().filter(|path| is_mesh(path)).collect();
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
    plain(full.strip_prefix(folder).unwrap_or(&full)).map(str::to_owned)
}
