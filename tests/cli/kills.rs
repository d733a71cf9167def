//! Killed and crowded: whenever a command is killed, and however many share a cache, outputs are whole or absent, the
//! next run is as if nothing had happened, and nothing is left over.
//!
//! The variable SHADOW_FIELDS_KILLS says how many rounds there are for each number of processes; without it there are 2.
#![cfg(unix)]

use crate::cli::{bare, finish, has_device};
use crate::common::{Running, paths_below, report};
use crate::{model, room};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

const MESH: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n";

/// Every kind of command that writes, and what it writes, but for `bench`, `profile` and `farm`. Others read the first.
const COMMANDS: [(&str, &[&str]); 6] = [
    ("bake m.obj -o f.sf --lattice cube:3x3 --face-px 8", &["f.sf"]),
    (
        "render scene.toml -o p.png --exr p.exr --vertices v.csv --variant storage --lattice cube:2x3 --face-px 4 \
         --quality draft",
        &["p.png", "p.exr", "v.csv"],
    ),
    ("render scene.toml -o a.png --frames 4 --variant storage --lattice cube:2x3 --face-px 4 --lights sh", &["a.png"]),
    (
        "render scene.toml -o n##.png --frames 3 --size 16x16 --variant storage --lattice cube:2x3 --face-px 4 --lights sh",
        &["n00.png", "n01.png", "n02.png"],
    ),
    ("import t.gltf -o i.toml", &["i.toml"]),
    ("compare ../good/a.png ../good/a.png -o d.png", &["d.png"]),
];

/// A folder for a command's outputs, with its inputs.
fn place(inside: &Path, name: &str) -> PathBuf {
    let folder = inside.join(name);
    room::write(&folder, [24, 16], ", motion = [{ spin = { period_s = 3 } }]");
    std::fs::write(folder.join("m.obj"), MESH).unwrap();
    model::robot().write_embedded(&folder, "t");
    folder
}

fn program(folder: &Path, arguments: &str) -> Command {
    bare(folder, &format!("{arguments} --cache-dir ../cache"))
}

/// What the commands make when nothing disturbs them, and how long they take then.
struct Good {
    outputs: BTreeMap<String, Vec<u8>>,
    took: Vec<Duration>,
    /// Emptied when the tests start. Compiled shaders, which would take most of the time, stay in its cache.
    inside: PathBuf,
}

impl Good {
    fn new() -> Self {
        let inside = Path::new(env!("CARGO_TARGET_TMPDIR")).join("kills");
        let _ = std::fs::remove_dir_all(&inside);
        let folder = place(&inside, "good");
        let mut outputs = BTreeMap::new();
        let mut took = Vec::new();
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

    fn assert_whole(&self, folder: &Path, all_of: Option<usize>) {
        for (name, whole) in &self.outputs {
            if let Ok(bytes) = std::fs::read(folder.join(name)) {
                assert!(bytes == *whole, "{name} is not what it should be");
            }
        }
        for name in all_of.map_or(&[][..], |index| COMMANDS[index].1) {
            assert!(folder.join(name).is_file(), "there is no {name}");
        }
    }

    /// Kills `crowd` processes at random times, the first with `job`, then runs each to its end. How many were cut off.
    fn kill(&self, random: &mut fastrand::Rng, crowd: usize, job: usize) -> usize {
        let folders: Vec<_> = (0..crowd).map(|i| place(&self.inside, &format!("crowd-{i}"))).collect();
        let jobs: Vec<_> = (0..crowd).map(|i| if i == 0 { job } else { random.usize(0..COMMANDS.len()) }).collect();
        let cache = self.inside.join("cache");
        let _ = std::fs::remove_dir_all(cache.join("fields"));
        let begun = Instant::now();
        let mut running: Vec<_> = folders
            .iter()
            .zip(&jobs)
            .map(|(folder, &job)| {
                let end = begun + self.took[job].mul_f64(1.2 * random.f64() * crowd as f64);
                let mut command = program(folder, COMMANDS[job].0);
                // Killed where it is dropped.
                (end, Running(command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap()))
            })
            .collect();
        running.sort_by_key(|(end, _)| *end);
        let mut cut = 0;
        for (end, mut process) in running {
            std::thread::sleep(end.saturating_duration_since(Instant::now()));
            cut += usize::from(process.0.try_wait().unwrap().is_none());
        }
        for (folder, &job) in folders.iter().zip(&jobs) {
            self.assert_whole(folder, None);
            let ran = finish(&mut program(folder, COMMANDS[job].0));
            assert_eq!(ran.code, 0, "{:?}: {}", COMMANDS[job].0, ran.stderr);
            self.assert_whole(folder, Some(job));
        }
        for path in folders.iter().chain([&cache]).flat_map(|folder| paths_below(folder)) {
            let name = path.file_name().unwrap().to_string_lossy();
            assert!(!name.starts_with(".unfinished-"), "a killed process left {}", path.display());
        }
        folders.iter().for_each(|folder| std::fs::remove_dir_all(folder).unwrap());
        cut
    }
}

/// In each round another command is killed for sure.
#[test]
fn kills_leave_whole_outputs_and_a_cache_that_works() {
    if !has_device() {
        return;
    }
    let rounds = std::env::var("SHADOW_FIELDS_KILLS").map_or(2, |text| text.parse().expect("a number of rounds"));
    let good = Good::new();
    let mut random = fastrand::Rng::with_seed(1);
    for crowd in [1, 2, 4] {
        let start = Instant::now();
        let first = random.usize(0..COMMANDS.len());
        let kills = (0..rounds).map(|round| good.kill(&mut random, crowd, (first + round) % COMMANDS.len()));
        let cut: usize = kills.sum();
        let seconds = start.elapsed().as_secs_f64();
        report(&format!("{crowd} processes on one cache, {rounds} rounds: {cut} were cut off, {seconds:.1} s"));
    }
}
