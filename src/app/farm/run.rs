//! `shadow-fields farm run`

use super::super::context::Context;
use super::super::{Cli, Global, Subcommands, output, parse, render};
use crate::asset::Mesh;
use crate::bake::cache::Cache;
use crate::bake::parts::{Part, bake, bake_part};
use crate::bake::{self, hash_text};
use crate::error::{Error, Result};
use crate::farm::plan::{DeviceClass, Plan, Task, TaskKind};
use crate::farm::results::{self, Entry, Found};
use crate::scene::{self, Scene};
use clap::Args;
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Arguments of `farm run`.
#[derive(Args)]
pub struct Arguments {
    /// Plan that `farm plan` has written
    plan: PathBuf,
    /// Number of the slice, from 0
    #[arg(long, value_name = "K")]
    slice: usize,
}

/// Does one slice.
pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    let plan = Plan::read(&arguments.plan)?;
    let slice = arguments.slice;
    if slice >= plan.slices.len() {
        return Err(Error::Usage(format!("--slice {slice}: the plan has slices 0 to {}", plan.slices.len() - 1)));
    }
    let line = |what: &str| output::say(format!("slice {slice} of {}: {what}", output::shown(&arguments.plan)));
    match results::find(&plan, slice) {
        Found::Whole(..) => {
            line("its result is there and intact");
            return Ok(());
        }
        Found::Damaged(error) => log::warn!("{error}; doing the slice anew"),
        Found::Missing => {}
    }
    let started = Instant::now();
    let context = Context::new(global)?;
    plan.check_device(&DeviceClass::of(&context.device))?;
    let mut running = Running { plan: &plan, global, context: Some(context), meshes: HashMap::new() };
    let mut entries = Vec::new();
    for (index, task) in plan.tasks_of(slice).iter().enumerate() {
        let made = running.task(task)?;
        entries.extend(made.into_iter().map(|(name, bytes)| (index as u32, name, bytes)));
    }
    // A result that the validation layer objected to is not written.
    running.context.map_or(Ok(()), Context::finish)?;
    let seconds = started.elapsed().as_secs_f64();
    write(&plan, slice, seconds, &entries)?;
    line(&format!("done in {seconds:.1} s"));
    Ok(())
}

fn write(plan: &Plan, slice: usize, seconds: f64, entries: &[Entry]) -> Result<()> {
    results::write(plan, slice, seconds, entries)
}

/// A file of a result: its name and its content.
type Made = (String, Vec<u8>);

struct Running<'r> {
    plan: &'r Plan,
    global: &'r Global,
    /// `None` while a picture is rendered, which opens its own.
    context: Option<Context>,
    /// Meshes that were read, by the index of their input.
    meshes: HashMap<usize, Mesh>,
}

impl Running<'_> {
    fn task(&mut self, task: &Task) -> Result<Vec<Made>> {
        let Task(_, _, kind, first, count) = *task;
        let words = &self.plan.works[task.work()].words;
        match kind {
            TaskKind::Frames => self.frames(task.input(), words, first, count),
            TaskKind::Bake(kind) => {
                let options = mesh_options(words)?;
                if self.context.is_none() {
                    self.context = Some(Context::new(self.global)?);
                }
                if !self.meshes.contains_key(&task.input()) {
                    self.meshes.clear();
                    self.meshes.insert(task.input(), mesh(self.plan, task.input())?);
                }
                let (Some(context), Some(mesh)) = (&self.context, self.meshes.get(&task.input())) else {
                    unreachable!("both were made above")
                };
                let what = format!("{} {}", mesh.name, kind.name());
                let progress = |done, all| context.progress.show(&what, done, all);
                let part = Part { index: first, count };
                if part != Part::WHOLE {
                    let bytes = bake_part(&context.baker, (mesh, &options), kind, part, &progress)?;
                    return Ok(vec![("part".into(), bytes)]);
                }
                // A cache of its own: what it holds then is what was baked.
                let folder = scratch()?;
                let cache = Cache::new(Some(folder.path()));
                bake(&context.baker, &cache, (mesh, &options), kind, &progress)?;
                files(&folder.path().join("fields"))
            }
        }
    }

    fn frames(&mut self, input: usize, words: &[String], first: u32, count: u32) -> Result<Vec<Made>> {
        let input = &self.plan.inputs[input];
        let path = self.plan.path(&input.path);
        unchanged(&path, &scene_hash(&Scene::load(&path)?), &input.hash)?;
        // One device at a time: two inside one process crashed a driver.
        self.context.take().map_or(Ok(()), Context::finish)?;
        let folder = scratch()?;
        let output = folder.path().join("##########.png");
        let mut line: Vec<String> =
            ["--first", &first.to_string(), "--frames", &count.to_string()].map(str::to_owned).into();
        line.extend_from_slice(words);
        let arguments = render_line(&path, &output, &line)?;
        render::run(self.global, &arguments)?;
        files(folder.path())
    }
}

/// A folder for what a slice makes on its way. It is removed at the end, and by the system's sweep after a kill.
fn scratch() -> Result<tempfile::TempDir> {
    tempfile::tempdir().map_err(|error| Error::Failed(format!("no temporary folder can be made: {error}")))
}

/// The files in a folder, by name.
fn files(folder: &Path) -> Result<Vec<Made>> {
    let cannot = |error| Error::Failed(format!("{}: cannot be read: {error}", folder.display()));
    let mut out = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(cannot)? {
        let entry = entry.map_err(cannot)?;
        out.push((entry.file_name().to_string_lossy().into_owned(), std::fs::read(entry.path()).map_err(cannot)?));
    }
    if out.is_empty() {
        return Err(Error::Failed(format!("{}: nothing was written, the disk may be full", folder.display())));
    }
    out.sort();
    Ok(out)
}

/// The mesh of an input, which has to be that of the plan.
pub(super) fn mesh(plan: &Plan, input: usize) -> Result<Mesh> {
    let input = &plan.inputs[input];
    let path = plan.path(&input.path);
    let (mesh, _) = scene::load_mesh(&path)?;
    unchanged(&path, &hash_text(&mesh), &input.hash)?;
    Ok(mesh)
}

fn unchanged(path: &Path, found: &str, planned: &str) -> Result<()> {
    if found == planned {
        Ok(())
    } else {
        Err(Error::input(path, "it has changed since the plan was made; plan again"))
    }
}

/// The options of a bake that words say.
///
/// # Errors
/// `Usage` where they are not understood.
pub(super) fn mesh_options(words: &[String]) -> Result<bake::Options> {
    let line =
        ["shadow-fields", "bake", "m.obj", "-o", "m.sf"].map(str::to_owned).into_iter().chain(words.iter().cloned());
    match parse(line)? {
        Cli { command: Subcommands::Bake(arguments), .. } => arguments.of_any_kind(),
        _ => Err(Error::Usage("the options after -- are not those of bake".into())),
    }
}

fn render_line(scene: &Path, output: &Path, words: &[String]) -> Result<render::Arguments> {
    let line = ["shadow-fields".into(), "render".into(), scene.into(), "-o".into(), output.as_os_str().to_owned()];
    match parse(line.into_iter().chain(words.iter().map(Into::into)))? {
        Cli { command: Subcommands::Render(arguments), .. } => Ok(arguments),
        _ => Err(Error::Usage("the options after -- are not those of render".into())),
    }
}

/// The size of pictures that words of `render` say, if they say one.
///
/// # Errors
/// `Usage` where they are not understood, or write anything besides pictures.
pub(super) fn render_words(scene: &Path, words: &[String]) -> Result<Option<[u32; 2]>> {
    let arguments = render_line(scene, Path::new("#.png"), words)?;
    arguments.pictures_only()?;
    Ok(arguments.size)
}

/// The hash of a scene as it was read: with its meshes and its distant light, not with the way they were written.
pub(super) fn scene_hash(scene: &Scene) -> String {
    let mut hasher = blake3::Hasher::new();
    hasher.update(format!("{:?}", scene.data).as_bytes());
    for mesh in &scene.meshes {
        hasher.update(&mesh.content_hash());
    }
    hasher.update(format!("{:?} {:?}", scene.entities, scene.environment).as_bytes());
    hasher.finalize().to_hex()[..32].to_owned()
}
