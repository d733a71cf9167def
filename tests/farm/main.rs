//! Farms: bakes and pictures in slices have the bytes of a run without a farm, whatever happens to slices, engines and
//! folders.
//!
//! The engines of other projects are tried where they are installed; with SHADOW_FIELDS_REQUIRE_FARM=1 they have to be
//! there. With SHADOW_FIELDS_FARM_KILLS=N slices, workers and submitters are killed N times instead of a few.
#![cfg(target_os = "linux")]

#[path = "../common/cli.rs"]
mod cli;
#[path = "../common/mod.rs"]
mod common;
mod engines;
mod faults;
mod plans;

use cli::{Ran, finish, has_device};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

const PROGRAM: &str = env!("CARGO_BIN_EXE_shadow-fields");
/// Options of bakes that make them short.
const DRAFT: [&str; 6] = ["--quality", "draft", "--lattice", "cube:4x3", "--face-px", "16"];
const SCENE: &str = r#"
camera = { eye = [0, 1, 4], target = [0, 0, 0] }
environment = { gradient = { radiance = [0.3, 0.35, 0.4] } }
mesh = [{ name = "floor", plane = { size_m = 4, cells = 2 } }, { name = "ring", file = "meshes/a.obj" }]
entity = [
    { mesh = "floor", position = [0, -0.9, 0] },
    { mesh = "ring", motion = [{ spin = { period_s = 3 } }] },
]
"#;

/// Meshes of a farm: a ring and balls.
const MESHES: usize = 6;

/// A folder with meshes and a scene.
struct Farm {
    folder: tempfile::TempDir,
}

/// The plan of the meshes, and the cache files that it makes as one slice.
struct Whole {
    plan: Value,
    files: BTreeMap<String, Vec<u8>>,
}

/// All tests compare with the same.
fn whole() -> &'static Whole {
    static WHOLE: OnceLock<Whole> = OnceLock::new();
    WHOLE.get_or_init(|| {
        let farm = Farm::new();
        farm.good(&[&["farm", "plan", "meshes", "-o", "p.json"][..], &DRAFT].concat());
        farm.good(&["farm", "run", "p.json", "--slice", "0"]);
        Whole { plan: farm.read("p.json"), files: farm.collected() }
    })
}

impl Farm {
    fn new() -> Self {
        // A name that engines have to quote.
        let name = "a farm's \"5%\" $(touch x) `touch x` {command} {slices} {a";
        let folder = tempfile::Builder::new().prefix(name).tempdir().unwrap();
        std::fs::create_dir(folder.path().join("meshes")).unwrap();
        for index in 0..MESHES {
            let mesh = match index {
                0 => common::generate::torus(0.6, 0.2, 12, 8),
                _ => common::generate::sphere(index as f32, 1),
            };
            let path = folder.path().join(format!("meshes/{}.obj", ["a", "b", "c", "d", "e", "f"][index]));
            std::fs::write(path, common::obj(&mesh)).unwrap();
        }
        std::fs::write(folder.path().join("film.toml"), SCENE).unwrap();
        Farm { folder }
    }

    /// `None` where there is no device.
    fn with_device() -> Option<Self> {
        has_device().then(Self::new)
    }

    /// One with the plan of its meshes, each a slice of its own.
    fn planned() -> Option<Self> {
        let farm = Self::with_device()?;
        let mut plan = whole().plan.clone();
        let slice = |index| json!({ "meshes": { "first": index, "count": 1 } });
        plan["slices"] = (0..MESHES).map(slice).collect();
        farm.write(&plan);
        Some(farm)
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn read(&self, plan: &str) -> Value {
        serde_json::from_slice(&std::fs::read(self.path(plan)).unwrap()).unwrap()
    }

    /// The program in the folder. Compiled shaders are shared by all tests; what is baked is not.
    fn command(&self, words: &[&str]) -> Command {
        let mut command = Command::new(PROGRAM);
        command.current_dir(self.folder.path()).args(words).arg("--cache-dir").arg(cli::cache());
        command.env_remove("RUST_LOG").env("NO_COLOR", "1");
        command
    }

    fn run(&self, words: &[&str]) -> Ran {
        finish(&mut self.command(words))
    }

    fn good(&self, words: &[&str]) -> String {
        let ran = self.run(words);
        assert_eq!(ran.code, 0, "{words:?}: {}", ran.stderr);
        ran.stdout
    }

    fn write(&self, plan: &Value) {
        std::fs::write(self.path("p.json"), plan.to_string()).unwrap();
    }

    fn collected(&self) -> BTreeMap<String, Vec<u8>> {
        self.good(&["farm", "collect", "p.json", "--into", "cache"]);
        files(&self.path("cache/fields"))
    }

    /// The files of all results. What killed slices left unfinished beside them is none.
    fn results(&self) -> Vec<PathBuf> {
        let folders = std::fs::read_dir(self.path("results")).into_iter().flatten();
        let files = folders.flat_map(|folder| std::fs::read_dir(folder.unwrap().path()).unwrap());
        let mut files: Vec<PathBuf> = files.map(|file| file.unwrap().path()).collect();
        files.retain(|path| path.extension().is_some_and(|ending| ending == "slice"));
        files.sort();
        files
    }
}

fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let entries = std::fs::read_dir(folder).unwrap().map(Result::unwrap);
    entries.map(|e| (e.file_name().into_string().unwrap(), std::fs::read(e.path()).unwrap())).collect()
}

/// Processes of this machine whose command line, in which a zero byte ends each word, holds `words`.
fn processes(words: &[u8]) -> Vec<u32> {
    let id = |entry: std::fs::DirEntry| {
        let id = entry.file_name().to_str()?.parse().ok()?;
        let line = std::fs::read(entry.path().join("cmdline")).ok()?;
        line.windows(words.len()).any(|found| found == words).then_some(id)
    };
    std::fs::read_dir("/proc").unwrap().filter_map(|entry| id(entry.ok()?)).collect()
}

#[test]
fn slices_of_bakes_make_the_bytes_of_a_run_without_a_farm() {
    let Some(farm) = Farm::planned() else { return };
    let status: Value = serde_json::from_str(&farm.good(&["farm", "status", "p.json", "--json"])).unwrap();
    assert_eq!(status, json!({ "slices": 6, "done": 0 }));
    let early = farm.run(&["farm", "collect", "p.json", "--into", "cache"]);
    assert_eq!(early.code, 1);
    assert!(early.stderr.contains("6 of 6 slices to run again, missing: 0-5"), "{}", early.stderr);
    farm.good(&["farm", "submit", "p.json", "--engine", "local", "--workers", "2"]);
    assert!(farm.good(&["farm", "status", "p.json"]).contains("6 of 6 slices done"));
    assert!(farm.good(&["farm", "run", "p.json", "--slice", "3"]).contains("there and intact"));
    // What another driver left in the cache is replaced.
    farm.collected();
    let known: Vec<PathBuf> = whole().files.keys().map(|name| farm.path("cache/fields").join(name)).collect();
    known.iter().for_each(|path| std::fs::write(path, "another driver's").unwrap());
    let collected = farm.collected();
    // The field and outlines of each mesh, and what is baked of the vertices of the one that is not convex.
    assert_eq!(collected.len(), 2 * MESHES + 1);
    assert!(collected == whole().files, "{:?}", collected.keys());
    // The field of `bake` is the same, and a scene finds the fields that it needs. Its own visibility at rest is past all
    // else that rests in the scene, which a farm of meshes does not know.
    farm.good(&[&["bake", "meshes/a.obj", "-o", "a.sf"][..], &DRAFT].concat());
    assert!(collected.values().any(|bytes| *bytes == std::fs::read(farm.path("a.sf")).unwrap()), "the field of bake");
    let mut render = Command::new(PROGRAM);
    render
        .args(["render", "film.toml", "-o", "f.png", "--size", "48x32", "--json", "--cache-dir", "cache"])
        .args(DRAFT);
    let report: Value = serde_json::from_str(&finish(render.current_dir(farm.folder.path())).stdout).unwrap();
    let baked = report["baked"].as_array().unwrap();
    let of_ring = baked.iter().filter(|bake| bake["what"].as_str().unwrap().starts_with("ring"));
    assert_eq!(of_ring.map(|bake| bake["what"].as_str().unwrap()).collect::<Vec<_>>(), ["ring view"]);
}

#[test]
fn slices_of_pictures_are_those_of_render() {
    let Some(farm) = Farm::with_device() else { return };
    std::fs::copy(farm.path("film.toml"), farm.path("other.toml")).unwrap();
    let options = [&["--size", "48x32", "--variant", "storage", "--time", "0.5"][..], &DRAFT].concat();
    let plan = "farm plan film.toml other.toml --frames 5 --pictures out/$_###.png -o p.json --per-slice 3";
    let said = farm.good(&plan.split(' ').chain(options.iter().copied()).collect::<Vec<_>>());
    assert!(said.contains("p.json: 4 slices"), "{said}");
    let slice = |film, first, count| json!({ "pictures": { "film": film, "first": first, "count": count } });
    assert_eq!(farm.read("p.json")["slices"], json!([slice(0, 0, 3), slice(0, 3, 2), slice(1, 0, 3), slice(1, 3, 2)]));
    farm.good(&["farm", "submit", "p.json", "--engine", "local", "--workers", "1"]);
    farm.good(&["farm", "collect", "p.json"]);
    std::fs::create_dir(farm.path("plain")).unwrap();
    for film in ["film", "other"] {
        let scene = format!("{film}.toml");
        let pictures = format!("plain/{film}_###.png");
        farm.good(&[&["render", &scene, "-o", &pictures, "--frames", "5"][..], &options].concat());
    }
    let found = files(&farm.path("out"));
    let plain = files(&farm.path("plain"));
    assert_eq!(found.len(), 10);
    assert!(found.contains_key("film_000.png") && found["film_000.png"] != found["film_004.png"]);
    assert!(found == plain);
}
