//! `shadow-fields farm run` computes one slice.

use super::super::context::Context;
use super::super::{Global, output};
use crate::asset::picture;
use crate::bake::surfaces::GroupPlan;
use crate::bake::{self, Wanted, cache::Cache, hash_text};
use crate::error::{Error, Result};
use crate::farm::results::{self, SliceResult};
use crate::farm::{Film, Input, Plan, Slice};
use crate::field::FieldKind;
use crate::scene::{self, Scene};
use clap::Args;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

#[derive(Args)]
pub struct Arguments {
    /// Plan that `farm plan` has written
    plan: PathBuf,
    /// Number of the slice, from 0
    #[arg(long, value_name = "K")]
    slice: usize,
    /// End when stdin does, which an engine holds open that waits for the slice
    #[arg(long, hide = true)]
    until_stdin_ends: bool,
}

pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    let plan = Plan::read(&arguments.plan)?;
    let number = arguments.slice;
    let Some(slice) = plan.slices.get(number) else {
        return Err(Error::Usage(format!("--slice {number}: the plan has slices 0 to {}", plan.slices.len() - 1)));
    };
    let say = |what: &str| output::say(format!("slice {number} of {}: {what}", output::shown(&arguments.plan)));
    match results::find(&plan, number) {
        SliceResult::Whole(_) => {
            say("its result is there and intact");
            return Ok(());
        }
        SliceResult::Damaged(error) => log::warn!("{error}; doing the slice anew"),
        SliceResult::Missing => {}
    }
    let started = Instant::now();
    // It is removed at the end, and by the system's sweep after a kill.
    let scratch =
        tempfile::tempdir().map_err(|error| Error::Failed(format!("a temporary folder cannot be written: {error}")))?;
    if arguments.until_stdin_ends {
        end_with_stdin(scratch.path().to_owned());
    }
    let context = Context::new(global)?;
    plan.check_device(&context.device)?;
    // The folder in which a cache keeps what is baked.
    let made = scratch.path().join("fields");
    let count = match *slice {
        Slice::Meshes { first, count } => {
            let mut files = 0;
            for mesh in plan.meshes(first, count) {
                files += bake_mesh(&context, &plan, mesh, scratch.path())?;
            }
            files
        }
        Slice::Pictures { film, first, count } => {
            render(&context, &plan, &plan.films[film as usize], first..first + count, &made)?;
            count as usize
        }
    };
    // A result that the validation layer objected to is not written.
    context.finish()?;
    results::write(&plan, number, &made, count)?;
    say(&format!("done in {:.1} s", started.elapsed().as_secs_f64()));
    Ok(())
}

/// Ends this process when the one that started it has ended, which held the other end of stdin.
fn end_with_stdin(scratch: PathBuf) {
    std::thread::spawn(move || {
        let _ = std::io::copy(&mut std::io::stdin(), &mut std::io::sink());
        let _ = std::fs::remove_dir_all(scratch);
        std::process::exit(1);
    });
}

/// Bakes everything that a scene may need of a mesh into a cache of its own, and answers with the number of its files.
fn bake_mesh(context: &Context, plan: &Plan, input: &Input, folder: &Path) -> Result<usize> {
    let path = plan.path(&input.path);
    let (mesh, _) = scene::load_mesh(&path)?;
    check_unchanged(&path, &hash_text(&mesh), &input.hash)?;
    let baker = &context.baker;
    let options = &plan.bake;
    let cache = Cache::new(Some(folder));
    let progress = |done, all| context.progress.show(&mesh.name, done, all);
    let mut files = 0;
    let radiance = mesh.colors.is_some().then_some(FieldKind::Radiance);
    for kind in [Some(FieldKind::Occlusion), radiance].into_iter().flatten() {
        cache.field(baker, &mesh, &bake::header(&mesh, kind, options), &progress)?;
        files += 1;
    }
    cache.silhouette(baker, &mesh, options, &progress)?;
    files += 1;
    let alone = GroupPlan::alone(&Arc::new(mesh.clone()), options, Wanted::BOTH);
    if alone.key.is_some() {
        cache.surfaces(&alone, &progress);
        files += 1;
    }
    Ok(files)
}

/// Renders pictures of a film into a folder, where their numbers are their names.
fn render(context: &Context, plan: &Plan, film: &Film, numbers: Range<u32>, folder: &Path) -> Result<()> {
    let path = plan.path(&film.scene.path);
    let mut scene = Scene::load_at(&path, film.first_s)?;
    check_unchanged(&path, &scene_hash(&scene), &film.scene.hash)?;
    scene.data.output.exposure_ev = Some(film.exposure_ev);
    let shape = &scene.data.output;
    let mut frame = context.frame(&scene, film.options).map_err(|error| match error {
        Error::Input(_) => error.context(path.display()),
        other => other,
    })?;
    let [width, height] = film.options.size;
    crate::text::make_folder(folder)?;
    let count = numbers.end - numbers.start;
    for (done, number) in (1..).zip(numbers) {
        let time_s = film.first_s + f64::from(number) / f64::from(film.fps);
        frame.render(&scene.at(time_s), Some(shape.white()))?;
        let path = folder.join(format!("{number}.png"));
        picture::write_png(&path, width, height, &frame.picture(), shape.exposure_ev())?;
        context.progress.pictures(done, count);
    }
    Ok(())
}

fn check_unchanged(path: &Path, found: &str, planned: &str) -> Result<()> {
    if found == planned {
        return Ok(());
    }
    Err(Error::input(path, "it has changed since the plan was made; plan again"))
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
