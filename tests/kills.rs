//! Killed, crowded and cramped: whenever a command is killed, however many share a cache, and whether or not that can be written,
//! outputs are whole or absent, the next run is as if nothing had happened, and nothing is left over.
//!
//! Some kills run by default. All 60 for each number of processes: `cargo test --test kills -- --ignored --nocapture`.
#![cfg(unix)]

#[path = "common/cli.rs"]
mod cli;
mod common;

use cli::{finish, has_device, names};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::OnceLock;
use std::time::{Duration, Instant};

const SCENE: &str = r#"
[camera]
eye = [0, 1, 4]
target = [0, 0, 0]
[environment]
gradient = { radiance = [0.3, 0.35, 0.4] }
[[mesh]]
name = "floor"
plane = { size_m = 4, cells = 2 }
[[mesh]]
name = "ring"
torus = { major_m = 0.5, minor_m = 0.2, segments = 8, sides = 6 }
[[entity]]
mesh = "floor"
position = [0, -0.6, 0]
[[entity]]
mesh = "ring"
[[entity]]
mesh = "ring"
position = [1.2, 1, 0]
scale = 0.3
emission = [30, 24, 12]
motion = [{ spin = { period_s = 3 } }]
"#;
const MESH: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n";

/// Every kind of command that writes, and what it writes.
const COMMANDS: [(&[&str], &[&str]); 5] = [
    (&["bake", "m.obj", "-o", "f.sf", "--lattice", "cube:3x3", "--face-px", "8"], &["f.sf"]),
    (&["bake", "m.obj", "-o", "s.sf", "--silhouette", "--quality", "draft"], &["s.sf"]),
    (
        &[
            "render",
            "s.toml",
            "-o",
            "p.png",
            "--exr",
            "p.exr",
            "--vertices",
            "v.csv",
            "--size",
            "24x16",
            "--variant",
            "storage",
            "--lattice",
            "cube:2x2",
            "--face-px",
            "4",
            "--quality",
            "draft",
        ],
        &["p.png", "p.exr", "v.csv"],
    ),
    (
        &[
            "render",
            "s.toml",
            "-o",
            "a.png",
            "--frames",
            "4",
            "--size",
            "24x16",
            "--variant",
            "storage",
            "--lattice",
            "cube:2x2",
            "--face-px",
            "4",
            "--lights",
            "sh",
        ],
        &["a.png"],
    ),
    (
        &[
            "render",
            "s.toml",
            "-o",
            "n##.png",
            "--frames",
            "3",
            "--size",
            "16x16",
            "--variant",
            "storage",
            "--lattice",
            "cube:2x2",
            "--face-px",
            "4",
            "--lights",
            "sh",
        ],
        &["n00.png", "n01.png", "n02.png"],
    ),
];

/// A folder for a command's outputs, with its inputs.
fn place(inside: &Path, name: &str) -> PathBuf {
    let folder = inside.join(name);
    std::fs::create_dir_all(&folder).unwrap();
    std::fs::write(folder.join("m.obj"), MESH).unwrap();
    std::fs::write(folder.join("s.toml"), SCENE).unwrap();
    folder
}

fn program(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_shadow-fields"));
    command.current_dir(folder).args(arguments).args(["--cache-dir", "../cache"]).env_remove("RUST_LOG");
    command
}

/// A program that is killed with the test.
struct Running(Child);

impl Running {
    fn start(command: &mut Command) -> Self {
        Running(command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap())
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// What the commands make when nothing disturbs them, and how long they take then.
struct Good {
    outputs: BTreeMap<String, Vec<u8>>,
    took: Vec<Duration>,
    /// Emptied when the tests start. Compiled shaders, which would take most of the time, stay in its cache.
    inside: PathBuf,
}

impl Good {
    /// Made once for all tests.
    fn get() -> &'static Self {
        static GOOD: OnceLock<Good> = OnceLock::new();
        GOOD.get_or_init(Self::new)
    }

    fn new() -> Self {
        let inside = Path::new(env!("CARGO_TARGET_TMPDIR")).join("kills");
        let _ = std::fs::remove_dir_all(&inside);
        let folder = place(&inside, "good");
        let (mut outputs, mut took) = (BTreeMap::new(), Vec::new());
        for (arguments, written) in COMMANDS {
            assert_eq!(finish(&mut program(&folder, arguments)).code, 0, "{arguments:?}");
            let _ = std::fs::remove_dir_all(inside.join("cache/fields"));
            let start = Instant::now();
            assert_eq!(finish(&mut program(&folder, arguments)).code, 0, "{arguments:?}");
            took.push(start.elapsed());
            for name in written {
                outputs.insert((*name).to_owned(), std::fs::read(folder.join(name)).unwrap());
            }
        }
        Good { outputs, took, inside }
    }

    fn cache(&self) -> PathBuf {
        self.inside.join("cache")
    }

    /// Every output in the folder is whole.
    fn assert_whole(&self, folder: &Path, all_of: Option<usize>) {
        for name in names(folder).iter().filter(|name| self.outputs.contains_key(*name)) {
            assert!(std::fs::read(folder.join(name)).unwrap() == self.outputs[name], "{name} is not what it should be");
        }
        for name in all_of.map_or(&[][..], |index| COMMANDS[index].1) {
            assert!(folder.join(name).is_file(), "there is no {name}");
        }
    }

    /// Kills `crowd` processes at random times, and then runs one to its end.
    fn kill(&self, random: &mut fastrand::Rng, crowd: usize) {
        let folders: Vec<_> = (0..crowd).map(|i| place(&self.inside, &format!("crowd-{i}"))).collect();
        let jobs: Vec<_> = folders.iter().map(|_| random.usize(0..COMMANDS.len())).collect();
        let _ = std::fs::remove_dir_all(self.cache().join("fields"));
        let start = Instant::now();
        let mut running: Vec<_> = folders
            .iter()
            .zip(&jobs)
            .map(|(folder, &job)| {
                let end = start + self.took[job].mul_f64(1.2 * random.f64() * crowd as f64);
                (end, Running::start(&mut program(folder, COMMANDS[job].0)))
            })
            .collect();
        running.sort_by_key(|(end, _)| *end);
        for (end, process) in running {
            std::thread::sleep(end.saturating_duration_since(Instant::now()));
            drop(process);
        }
        for (folder, &job) in folders.iter().zip(&jobs) {
            self.assert_whole(folder, None);
            let ran = finish(&mut program(folder, COMMANDS[job].0));
            assert_eq!(ran.code, 0, "{:?}: {}", COMMANDS[job].0, ran.stderr);
            self.assert_whole(folder, Some(job));
        }
        let places = folders.iter().cloned().chain(["", "fields", "spirv"].map(|name| self.cache().join(name)));
        for place in places.filter(|place| place.exists()) {
            let left = names(&place).into_iter().filter(|name| name.starts_with(".unfinished-"));
            assert_eq!(left.collect::<Vec<_>>(), [""; 0], "{}", place.display());
        }
        folders.iter().for_each(|folder| std::fs::remove_dir_all(folder).unwrap());
    }
}

fn kill(times: usize) {
    if !has_device() {
        return;
    }
    let (good, mut random) = (Good::get(), fastrand::Rng::with_seed(1));
    for crowd in [1, 2, 4] {
        let start = Instant::now();
        (0..times).for_each(|_| good.kill(&mut random, crowd));
        let seconds = start.elapsed().as_secs_f64();
        common::report(&format!("{crowd} processes on one cache, killed {times} times: {seconds:.1} s"));
    }
}

#[test]
fn kills_leave_whole_outputs_and_a_cache_that_works() {
    kill(2);
}

#[test]
#[ignore = "takes minutes; a few kills run by default"]
fn sixty_kills_of_one_two_and_four_processes() {
    kill(60);
}

/// A cache on a full disk, a read-only one, and a limit on the sizes of files: the work is done all the same.
#[test]
#[cfg(target_os = "linux")]
fn caches_that_cannot_be_written_lose_nothing() {
    if !has_device() {
        return;
    }
    let good = Good::get();
    let inside = tempfile::tempdir().unwrap();
    let folder = place(inside.path(), "work");
    std::fs::create_dir(inside.path().join("cache")).unwrap();
    // A shell changes what may be written and becomes the program; mounts are its own.
    let shell = |words: &[&str], how: &str, arguments: &[&str]| {
        let inner = program(&folder, arguments);
        let mut outer = Command::new(words[0]);
        outer.current_dir(&folder).args(&words[1..]).args(["-c", &format!("{how} && exec \"$@\""), "sh"]);
        outer.arg(inner.get_program()).args(inner.get_args()).env_remove("RUST_LOG");
        outer
    };
    for (words, how) in [
        (&["unshare", "-m", "sh"][..], "mount -t tmpfs -o size=100k none ../cache"),
        (&["unshare", "-m", "sh"], "mount -t tmpfs -o ro none ../cache"),
        // Files of at most 4 KiB, which no shader is.
        (&["sh"], "ulimit -f 8"),
    ] {
        if shell(words, how, &["--version"]).output().is_ok_and(|output| !output.status.success()) {
            common::report(&format!("not allowed here: {how}"));
            continue;
        }
        let (arguments, written) = COMMANDS[4];
        let ran = finish(&mut shell(words, how, arguments));
        assert_eq!(ran.code, 0, "{how}: {}", ran.stderr);
        good.assert_whole(&folder, Some(4));
        written.iter().for_each(|name| std::fs::remove_file(folder.join(name)).unwrap());
        assert_eq!(names(&folder), ["m.obj", "s.toml"], "{how}");
    }
}
