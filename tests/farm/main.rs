//! Farms: bakes and pictures in slices have the bytes of a run without a farm, whatever happens to slices, engines and folders.
//!
//! The engines of other projects are tried where they are installed; with SHADOW_FIELDS_REQUIRE_FARM=1 they have to be there. With
//! SHADOW_FIELDS_FARM_KILLS=N slices, workers and submitters are killed N times instead of a few.
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
const DRAFT: [&str; 7] = ["--", "--quality", "draft", "--lattice", "cube:4x3", "--face-px", "16"];
const SCENE: &str = r#"
camera = { eye = [0, 1, 4], target = [0, 0, 0] }
environment = { gradient = { radiance = [0.3, 0.35, 0.4] } }
[[mesh]]
name = "floor"
plane = { size_m = 4, cells = 2 }
[[mesh]]
name = "ring"
file = "meshes/a.obj"
[[entity]]
mesh = "floor"
position = [0, -0.9, 0]
[[entity]]
mesh = "ring"
motion = [{ spin = { period_s = 3 } }]
"#;

/// A folder with two meshes and a scene.
struct Farm {
    folder: tempfile::TempDir,
}

/// The plan of the two meshes, and the cache files that it makes undivided: what a run without a farm makes.
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
        let folder = tempfile::Builder::new().prefix("a farm's 5%").tempdir().unwrap();
        std::fs::create_dir(folder.path().join("meshes")).unwrap();
        for (name, mesh) in
            [("a", crate::common::generate::torus(0.6, 0.2, 12, 8)), ("b", crate::common::generate::sphere(1.0, 1))]
        {
            let text = shadow_fields::asset::obj::write_obj(&mesh);
            std::fs::write(folder.path().join(format!("meshes/{name}.obj")), text).unwrap();
        }
        std::fs::write(folder.path().join("film.toml"), SCENE).unwrap();
        Farm { folder }
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
        let at = words.iter().position(|word| *word == "--").unwrap_or(words.len());
        command.current_dir(self.folder.path()).args(&words[..at]).arg("--cache-dir").arg(cli::cache());
        command.args(&words[at..]).env_remove("RUST_LOG").env("NO_COLOR", "1");
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

    /// Writes the plan of the two meshes, each bake cut into so many parts as `cut` says. Answers with the number of slices.
    fn plan(&self, cut: u32) -> usize {
        let mut plan = whole().plan.clone();
        // Short bakes would all be one slice: each task becomes one, and fields are cut as long ones are.
        let tasks: Vec<Value> = plan["tasks"].as_array().unwrap().clone();
        let cut = tasks.iter().flat_map(|task| {
            let parts = if task[2]["bake"] == "silhouette" { 1 } else { cut };
            (0..parts).map(move |part| json!([task[0], task[1], task[2], part, parts]))
        });
        let cut: Vec<Value> = cut.collect();
        plan["slices"] = (0..cut.len()).map(|index| json!([index, 1, 5.0, 300, 100])).collect();
        plan["tasks"] = Value::Array(cut);
        self.write(&plan);
        plan["tasks"].as_array().unwrap().len()
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
fn slices_of_bakes_make_the_bytes_of_an_undivided_bake() {
    if !has_device() {
        return;
    }
    let farm = Farm::new();
    let slices = farm.plan(3);
    // A ring: field and what is baked of vertices in three parts each, silhouettes in one. A convex ball: field and silhouettes.
    assert_eq!(slices, 7 + 4);
    let status: Value = serde_json::from_str(&farm.good(&["farm", "status", "p.json", "--json"])).unwrap();
    assert_eq!((&status["slices"], &status["done"], &status["left_s"]), (&11.into(), &0.into(), &55.0.into()));
    let early = farm.run(&["farm", "collect", "p.json", "--into", "cache"]);
    assert_eq!(early.code, 1);
    assert!(early.stderr.contains("11 of 11 slices have to run again, missing: 0-10"), "{}", early.stderr);
    farm.good(&["farm", "submit", "p.json", "--engine", "local", "--workers", "2"]);
    assert!(farm.good(&["farm", "status", "p.json"]).contains("11 of 11 slices, about 0 s of work left"));
    assert!(farm.good(&["farm", "run", "p.json", "--slice", "3"]).contains("there and intact"));
    // What another driver left in the cache is replaced, as by results that were not cut.
    farm.collected();
    let known: Vec<PathBuf> = whole().files.keys().map(|name| farm.path("cache/fields").join(name)).collect();
    known.iter().for_each(|path| std::fs::write(path, "another driver's").unwrap());
    let collected = farm.collected();
    assert_eq!(collected.len(), 6);
    assert!(collected == whole().files, "{:?}", collected.keys());
    // The files are those that a scene finds: nothing is baked for it, and the bake of a field on its own is the same.
    farm.good(&[&["bake", "meshes/a.obj", "-o", "a.sf"][..], &DRAFT[1..]].concat());
    assert!(collected.values().any(|bytes| *bytes == std::fs::read(farm.path("a.sf")).unwrap()), "the field of bake");
}

#[test]
fn slices_of_frames_are_the_pictures_of_render() {
    if !has_device() {
        return;
    }
    let farm = Farm::new();
    let options = ["--size", "48x32", "--variant", "storage", "--quality", "draft", "--lattice", "cube:4x3"];
    let plan = ["farm", "plan", "film.toml", "--frames", "5", "--pictures", "out/f_###.png", "-o", "p.json", "--"];
    farm.good(&[&plan[..], &options].concat());
    let mut plan = farm.read("p.json");
    assert_eq!(plan["tasks"], json!([[0, 0, "frames", 0, 5]]));
    plan["tasks"] = json!([[0, 0, "frames", 0, 2], [0, 0, "frames", 2, 3]]);
    plan["slices"] = json!([[0, 1, 1.0, 300, 1], [1, 1, 1.0, 300, 1]]);
    farm.write(&plan);
    farm.good(&["farm", "submit", "p.json", "--engine", "local", "--workers", "1"]);
    farm.good(&["farm", "collect", "p.json"]);
    std::fs::create_dir(farm.path("plain")).unwrap();
    farm.good(&[&["render", "film.toml", "-o", "plain/f_###.png", "--frames", "5"][..], &options].concat());
    let (found, plain) = (files(&farm.path("out")), files(&farm.path("plain")));
    assert_eq!(found.keys().collect::<Vec<_>>(), ["f_000.png", "f_001.png", "f_002.png", "f_003.png", "f_004.png"]);
    assert!(found == plain);
}
