//! `shadow-fields farm run` computes one slice.

use super::super::context::Context;
use super::super::{Cli, Global, Subcommands, output, parse, render};
use crate::asset::Mesh;
use crate::bake::cache::Cache;
use crate::bake::parts::{BakePart, bake, bake_part};
use crate::bake::{self, hash_text};
use crate::error::{Error, Result};
use crate::farm::plan::{DeviceClass, Plan, Task, TaskKind};
use crate::farm::results::{self, Content, SliceResult};
use crate::scene::{self, Scene};
use clap::Args;
use std::ffi::OsString;
use std::io;
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
        SliceResult::Whole(..) => {
            line("its result is there and intact");
            return Ok(());
        }
        SliceResult::Damaged(error) => log::warn!("{error}; doing the slice anew"),
        SliceResult::Missing => {}
    }
    let started = Instant::now();
    let context = Context::new(global)?;
    plan.check_device(&DeviceClass::of(&context.device))?;
    let mut running = Running { plan: &plan, global, context: Some(context), mesh: None };
    let mut content = Content::default();
    for (index, task) in plan.tasks_of(slice).iter().enumerate() {
        running.task(task, &mut |name, bytes| {
            content.add(index as u32, name, bytes);
            Ok(())
        })?;
    }
    // A result that the validation layer objected to is not written.
    running.context.map_or(Ok(()), Context::finish)?;
    let seconds = started.elapsed().as_secs_f64();
    content.write(&plan, slice, seconds)?;
    line(&format!("done in {seconds:.1} s"));
    Ok(())
}

/// Takes the name and the content of a file that a task has made.
pub(super) type Take<'t> = &'t mut dyn FnMut(&str, &[u8]) -> Result<()>;

struct Running<'r> {
    plan: &'r Plan,
    global: &'r Global,
    /// `None` while a picture is rendered, which opens its own.
    context: Option<Context>,
    /// The mesh that was read last, and the index of its input.
    mesh: Option<(usize, Mesh)>,
}

impl Running<'_> {
    fn task(&mut self, task: &Task, take: Take<'_>) -> Result<()> {
        let Task { work, input, kind, first, count } = *task;
        let input = input as usize;
        let words = &self.plan.works[work as usize].words;
        match kind {
            TaskKind::Frames => self.frames(input, words, first, count, take),
            TaskKind::Bake(kind) => {
                let options = mesh_options(words)?;
                if self.context.is_none() {
                    self.context = Some(Context::new(self.global)?);
                }
                if self.mesh.as_ref().is_none_or(|(last, _)| *last != input) {
                    self.mesh = Some((input, mesh(self.plan, input)?));
                }
                let (Some(context), Some((_, mesh))) = (&self.context, &self.mesh) else {
                    unreachable!("both were made above")
                };
                let what = format!("{} {}", mesh.name, kind.name());
                let progress = |done, all| context.progress.show(&what, done, all);
                let part = BakePart { index: first, count };
                if part != BakePart::WHOLE {
                    return take("part", &bake_part(&context.baker, (mesh, &options), kind, part, &progress)?);
                }
                // A cache of its own: what it holds then is what was baked.
                let folder = scratch()?;
                let cache = Cache::new(Some(folder.path()));
                bake(&context.baker, &cache, (mesh, &options), kind, &progress)?;
                files(&folder.path().join("fields"), take)
            }
        }
    }

    fn frames(&mut self, input: usize, words: &[String], first: u32, count: u32, take: Take<'_>) -> Result<()> {
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
        files(folder.path(), take)
    }
}

/// A folder for what a slice makes on its way. It is removed at the end, and by the system's sweep after a kill.
pub(super) fn scratch() -> Result<tempfile::TempDir> {
    tempfile::tempdir().map_err(|error| Error::Failed(format!("no temporary folder can be made: {error}")))
}

/// Hands on the files in a folder, in the order of their names.
///
/// # Errors
/// What `take` returns; `Failed` where there are none: what could not be written was kept in memory.
pub(super) fn files(folder: &Path, take: Take<'_>) -> Result<()> {
    let cannot = |error| Error::Failed(format!("{}: cannot be read: {error}", folder.display()));
    let mut names = match std::fs::read_dir(folder) {
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Vec::new(),
        entries => {
            entries.and_then(|all| all.map(|e| Ok(e?.file_name())).collect::<io::Result<_>>()).map_err(cannot)?
        }
    };
    if names.is_empty() {
        return Err(Error::Failed(format!("{}: nothing was written, the disk may be full", folder.display())));
    }
    names.sort();
    names.iter().try_for_each(|name| take(&name.to_string_lossy(), &std::fs::read(folder.join(name)).map_err(cannot)?))
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
    match understood(["shadow-fields", "bake", "m.obj", "-o", "m.sf"].map(OsString::from).into(), words)? {
        Subcommands::Bake(arguments) => arguments.of_any_kind(),
        _ => Err(Error::Usage("the options after -- are not those of bake".into())),
    }
}

/// The subcommand of a line with words behind `--`.
///
/// # Errors
/// `Usage` where they are not understood, or are options of every command, which would decide nothing.
fn understood(mut line: Vec<OsString>, words: &[String]) -> Result<Subcommands> {
    let said = |error: Error| {
        let text = error.to_string();
        let reason = text.lines().next().unwrap_or_default().trim_start_matches("error: ").to_owned();
        Error::Usage(format!("the options after --: {reason}"))
    };
    let without = parse(&line).map_err(said)?.global;
    line.extend(words.iter().map(OsString::from));
    let Cli { global, command } = parse(&line).map_err(said)?;
    if format!("{global:?}") == format!("{without:?}") {
        Ok(command)
    } else {
        Err(Error::Usage(
            "the options after -- are those of bake or render alone; options of every command go before".into(),
        ))
    }
}

fn render_line(scene: &Path, output: &Path, words: &[String]) -> Result<render::Arguments> {
    let line = ["shadow-fields".into(), "render".into(), scene.into(), "-o".into(), output.as_os_str().to_owned()];
    match understood(line.into(), words)? {
        Subcommands::Render(arguments) => Ok(arguments),
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
