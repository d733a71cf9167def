//! Bakes that are shared out among worker processes: the same bytes, whatever becomes of the workers.
#![cfg(unix)]

#[path = "common/cli.rs"]
mod cli;
mod common;

use cli::{command, finish, has_device};
use common::generate;
use common::{Gpu, gpu, library, report};
use shadow_fields::asset::Mesh;
use shadow_fields::bake::{self, Baker, WorkerOptions, partial::Partial, vertices::Wanted};
use shadow_fields::field::{FieldKind, ShadowField, Shortcuts};
use shadow_fields::gpu::Validation;
use std::cell::RefCell;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

const PROGRAM: &str = env!("CARGO_BIN_EXE_shadow-fields");

fn options() -> bake::Options {
    // Without symmetry all samples are captured.
    let shortcuts = Shortcuts { symmetry: false, ..Default::default() };
    bake::Options { lattice: "cube:6x4".parse().unwrap(), face_px: 32, shortcuts, ..Default::default() }
}

fn ring() -> Mesh {
    generate::torus_two_colour(1.0, 0.3, 24, 12)
}

fn shared(gpu: &Gpu, program: &Path, jobs: u32) -> Baker {
    let workers = WorkerOptions { program: program.to_owned(), jobs: Some(jobs), validation: Validation::Core };
    Baker::with_workers(&gpu.device, &library(), workers)
}

fn field(baker: &Baker, mesh: &Mesh, kind: FieldKind) -> shadow_fields::Result<ShadowField> {
    baker.field(mesh, bake::header(mesh, kind, &options()), &|_, _| ()).map(|(field, _)| field)
}

/// A script in place of the program. Its first runs, as many as `times`, do `what` with the worker `"$@"`; all others run it.
fn script(folder: &Path, times: usize, what: &str) -> PathBuf {
    let path = folder.join("program");
    let runs = folder.join("runs");
    let text = format!(
        "#!/bin/sh\necho >>'{0}'\nif [ $(wc -l <'{0}') -le {times} ]; then\n{what}\nfi\nexec '{PROGRAM}' \"$@\"\n",
        runs.display()
    );
    std::fs::write(&path, text).unwrap();
    std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o755)).unwrap();
    path
}

/// How often a script has run.
fn runs(folder: &Path) -> usize {
    std::fs::read_to_string(folder.join("runs")).map_or(0, |text| text.lines().count())
}

/// The worker gets its mesh and some targets, and then its input ends: it dies in the midst of its work.
const DIES: &str = "dd bs=1 count=20000 2>/dev/null | '/PROGRAM' \"$@\"; exit 0";

fn dies() -> String {
    DIES.replace("/PROGRAM", PROGRAM)
}

#[test]
fn every_kind_of_bake_has_the_same_bytes_in_two_and_three_processes() {
    let Some(gpu) = gpu() else { return };
    let (mesh, options) = (ring(), options());
    let alone = gpu.baker();
    let quiet = |_, _| ();
    let whole = |baker: &Baker| {
        let fields = [FieldKind::Occlusion, FieldKind::Radiance].map(|kind| field(baker, &mesh, kind).unwrap());
        let of = |wanted| baker.vertices_from(&Partial::new(None), &mesh, &options, wanted, &quiet).unwrap().0;
        (fields, [Wanted::BOTH, Wanted::TRANSFER, Wanted::SELF_VISIBILITY].map(of))
    };
    let expected = whole(&alone);
    for jobs in [2, 3] {
        let folder = tempfile::tempdir().unwrap();
        let program = script(folder.path(), 0, ":");
        let start = Instant::now();
        assert!(whole(&shared(&gpu, &program, jobs)) == expected, "{jobs} processes");
        // The same workers serve one bake after another.
        assert_eq!(runs(folder.path()), jobs as usize - 1);
        report(&format!("{jobs} processes: {:.1} s", start.elapsed().as_secs_f64()));
    }
}

/// Every sample is told once, up to the end; a bake that was cancelled goes on with workers from where it was.
#[test]
fn progress_is_one_and_a_cancelled_bake_goes_on() {
    let Some(gpu) = gpu() else { return };
    let folder = tempfile::tempdir().unwrap();
    let (mesh, baker) = (ring(), shared(&gpu, Path::new(PROGRAM), 2));
    let header = bake::header(&mesh, FieldKind::Occlusion, &options());
    let expected = field(&gpu.baker(), &mesh, FieldKind::Occlusion).unwrap();
    let (file, kept) = (folder.path().join("a.part"), folder.path().join("b.part"));
    let told = RefCell::new(Vec::new());
    let progress = |done, all| {
        told.borrow_mut().push((done, all));
        if done * 2 > all && !kept.exists() {
            std::fs::copy(&file, &kept).unwrap();
        }
    };
    let partial = Partial::eager(file.clone());
    assert!(baker.field_from(&partial, &mesh, header.clone(), &progress).unwrap().0 == expected);
    let all = expected.header.captured_samples;
    {
        let told = told.borrow();
        assert!(told.len() > 4 && told.windows(2).all(|w| w[0].0 < w[1].0), "{told:?}");
        assert_eq!(told.last(), Some(&(all, all)));
    }
    assert!(kept.exists() && !file.exists(), "kept on the way, removed at the end");
    told.borrow_mut().clear();
    std::fs::rename(&kept, &file).unwrap();
    assert!(baker.field_from(&partial, &mesh, header, &|d, a| told.borrow_mut().push((d, a))).unwrap().0 == expected);
    let first = told.borrow()[0].0;
    assert!(first > all / 4, "it began at {first} of {all}");
}

#[test]
fn a_worker_that_dies_is_repeated_once_and_then_named() {
    let Some(gpu) = gpu() else { return };
    let mesh = ring();
    let expected = field(&gpu.baker(), &mesh, FieldKind::Occlusion).unwrap();
    let header = bake::header(&mesh, FieldKind::Occlusion, &options());
    // The first process waits after its first samples, so that there is work for the second.
    let bake = |folder: &Path, times| {
        let baker = shared(&gpu, &script(folder, times, &dies()), 2);
        let wait = |_, _| wait_until("two starts of a worker", || runs(folder) == 2);
        baker.field(&mesh, header.clone(), &wait).map(|(field, _)| field)
    };
    let folder = tempfile::tempdir().unwrap();
    assert!(bake(folder.path(), 1).unwrap() == expected);
    assert_eq!(runs(folder.path()), 2, "one died, one did its work");
    let folder = tempfile::tempdir().unwrap();
    let error = bake(folder.path(), 9).map(|_| ()).expect_err("it died twice").to_string();
    assert!(error.starts_with("worker process 2, at its second try of samples "), "{error}");
    assert!(error.contains("torus") && error.contains("has died"), "{error}");
    assert_eq!(runs(folder.path()), 2);
}

/// Workers that cannot serve are left out with a warning: none is there, it ends at once, or it is another program or version.
#[test]
fn without_workers_the_bake_goes_on_alone() {
    let Some(gpu) = gpu() else { return };
    let mesh = ring();
    let expected = field(&gpu.baker(), &mesh, FieldKind::Occlusion).unwrap();
    assert!(field(&shared(&gpu, Path::new("/nowhere/program"), 2), &mesh, FieldKind::Occlusion).unwrap() == expected);
    let other = r#"printf '\116\0\0\0\0\0\0\0\0\0\0\0{"Hello":{"program":"shadow-fields 0.0.1 abc","device":"none","driver":"none of 1"}}'; exec cat >/dev/null"#;
    for what in ["exit 7", "echo Usage: another program", other] {
        let folder = tempfile::tempdir().unwrap();
        let program = script(folder.path(), 9, what);
        assert!(field(&shared(&gpu, &program, 2), &mesh, FieldKind::Occlusion).unwrap() == expected, "{what}");
        assert_eq!(runs(folder.path()), 2, "{what}");
    }
}

/// Process ids of the children of a process.
#[cfg(target_os = "linux")]
fn children(parent: u32) -> Vec<u32> {
    let of = |entry: std::fs::DirEntry| {
        let id: u32 = entry.file_name().to_str()?.parse().ok()?;
        let stat = std::fs::read_to_string(entry.path().join("stat")).ok()?;
        let (_, rest) = stat.rsplit_once(") ")?;
        let words: Vec<&str> = rest.split(' ').collect();
        (words[0] != "Z" && words[1] == parent.to_string()).then_some(id)
    };
    std::fs::read_dir("/proc").unwrap().filter_map(|entry| of(entry.unwrap())).collect()
}

#[cfg(target_os = "linux")]
fn kill(signal: &str, id: u32) {
    // The process may have ended by itself meanwhile.
    std::process::Command::new("kill")
        .args([signal, &id.to_string()])
        .stderr(std::process::Stdio::null())
        .status()
        .unwrap();
}

fn wait_until(what: &str, done: impl Fn() -> bool) {
    let start = Instant::now();
    while !done() {
        assert!(start.elapsed() < Duration::from_secs(20), "{what}");
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// The signal of Ctrl-C; or, where this test was started in a shell's background and so ignores it as its children do, that of `kill`.
#[cfg(target_os = "linux")]
fn ctrl_c() -> &'static str {
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:")).unwrap();
    let mask = u64::from_str_radix(ignored.trim(), 16).unwrap();
    if mask & 2 != 0 { "-TERM" } else { "-INT" }
}

/// Workers that are killed are replaced; and none outlives a bake that is ended, by Ctrl-C or without a word.
#[test]
#[cfg(target_os = "linux")]
fn workers_are_replaced_and_end_with_their_bake() {
    if !has_device() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("m.obj"), shadow_fields::asset::obj::write_obj(&ring())).unwrap();
    let of = |lattice| {
        move |jobs, name| ["bake", "m.obj", "-o", name, "--lattice", lattice, "--symmetry", "off", "--jobs", jobs]
    };
    let (arguments, long) = (of("cube:9x5"), of("cube:20x12"));
    let read = |name: &str| std::fs::read(folder.path().join(name)).unwrap();
    assert_eq!(finish(&mut command(folder.path(), &arguments("1", "alone.sf"))).code, 0);
    let mut bake = command(folder.path(), &arguments("3", "killed.sf")).spawn().unwrap();
    wait_until("two workers", || children(bake.id()).len() == 2);
    // One at its start, and one that may be at work.
    kill("-9", children(bake.id())[0]);
    std::thread::sleep(Duration::from_millis(700));
    children(bake.id()).first().into_iter().for_each(|&id| kill("-9", id));
    assert!(bake.wait().unwrap().success());
    assert!(read("killed.sf") == read("alone.sf"));
    for signal in ["-9", ctrl_c()] {
        let mut bake = command(folder.path(), &long("3", "ended.sf")).spawn().unwrap();
        wait_until("two workers", || children(bake.id()).len() == 2);
        std::thread::sleep(Duration::from_millis(400));
        let workers = children(bake.id());
        kill(signal, bake.id());
        bake.wait().unwrap();
        wait_until("no worker", || {
            workers.iter().all(|id| {
                // A zombie is dead: whoever inherited it has not asked yet.
                std::fs::read_to_string(format!("/proc/{id}/stat")).map_or(true, |stat| stat.contains(") Z "))
            })
        });
    }
    assert_eq!(cli::names(folder.path()), ["alone.sf", "killed.sf", "m.obj"]);
}
