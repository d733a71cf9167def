//! Farms: bakes and pictures in slices have the bytes of a run without a farm, whatever happens to slices, engines and folders.
//!
//! The engines of other projects are tried where they are installed; with SHADOW_FIELDS_REQUIRE_FARM=1 they have to be there. With
//! SHADOW_FIELDS_FARM_KILLS=N slices, workers and submitters are killed N times instead of a few.
#![cfg(target_os = "linux")]

#[path = "common/cli.rs"]
mod cli;
mod common;

use cli::{Ran, finish, has_device};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;

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

/// A folder with two meshes, a scene, and a cache of its own.
struct Farm {
    folder: tempfile::TempDir,
}

impl Farm {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join("meshes")).unwrap();
        for (name, mesh) in [
            ("a", shadow_fields::asset::generate::torus(0.6, 0.2, 12, 8)),
            ("b", shadow_fields::asset::generate::sphere(1.0, 1)),
        ] {
            let text = shadow_fields::asset::obj::write_obj(&mesh);
            std::fs::write(folder.path().join(format!("meshes/{name}.obj")), text).unwrap();
        }
        std::fs::write(folder.path().join("film.toml"), SCENE).unwrap();
        Farm { folder }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn command(&self, words: &[&str]) -> Command {
        let mut command = Command::new(PROGRAM);
        command.current_dir(self.folder.path()).args(words).env_remove("RUST_LOG").env("NO_COLOR", "1");
        // Compiled shaders are shared by all tests; what is baked is not.
        if !words.contains(&"--cache-dir") && words[0] == "farm" {
            let at = words.iter().position(|word| *word == "--").unwrap_or(words.len());
            command = Command::new(PROGRAM);
            command.current_dir(self.folder.path()).args(&words[..at]).arg("--cache-dir").arg(cli::cache());
            command.args(&words[at..]).env_remove("RUST_LOG").env("NO_COLOR", "1");
        }
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

    /// Plans the two meshes, each bake cut into so many parts as `cut` says.
    fn plan(&self, cut: u32) -> usize {
        self.good(&[&["farm", "plan", "meshes", "-o", "p.json"][..], &DRAFT].concat());
        let mut plan: Value = serde_json::from_slice(&std::fs::read(self.path("p.json")).unwrap()).unwrap();
        // Short bakes would all be one slice: each task becomes one, and fields are cut as long ones are.
        let tasks: Vec<Value> = plan["tasks"].as_array().unwrap().clone();
        let cut = tasks.iter().flat_map(|task| {
            let parts = if task[2]["bake"] == "silhouette" { 1 } else { cut };
            (0..parts).map(move |part| serde_json::json!([task[0], task[1], task[2], part, parts]))
        });
        let cut: Vec<Value> = cut.collect();
        let slices = (0..cut.len()).map(|index| serde_json::json!([index, 1, 5.0, 300, 100]));
        plan["slices"] = slices.collect();
        plan["tasks"] = Value::Array(cut);
        std::fs::write(self.path("p.json"), plan.to_string()).unwrap();
        plan["tasks"].as_array().unwrap().len()
    }

    /// What a run without a farm makes: the files of the cache, made by the same plan undivided.
    fn expected(&self) -> BTreeMap<String, Vec<u8>> {
        self.good(&[&["farm", "plan", "meshes", "-o", "whole.json", "--results", "whole"][..], &DRAFT].concat());
        self.good(&["farm", "run", "whole.json", "--slice", "0"]);
        self.good(&["farm", "collect", "whole.json", "--into", "expected"]);
        files(&self.path("expected/fields"))
    }

    fn collected(&self) -> BTreeMap<String, Vec<u8>> {
        self.good(&["farm", "collect", "p.json", "--into", "cache"]);
        files(&self.path("cache/fields"))
    }
}

fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let entries = std::fs::read_dir(folder).unwrap().map(Result::unwrap);
    entries.map(|e| (e.file_name().into_string().unwrap(), std::fs::read(e.path()).unwrap())).collect()
}

#[test]
fn slices_of_bakes_make_the_bytes_of_an_undivided_bake() {
    if !has_device() {
        return;
    }
    let farm = Farm::new();
    let slices = farm.plan(3);
    // A ring: field, self-visibility, transfer in three parts each, silhouettes in one. A convex ball: field and silhouettes.
    assert_eq!(slices, 10 + 4);
    let status: Value = serde_json::from_str(&farm.good(&["farm", "status", "p.json", "--json"])).unwrap();
    assert_eq!((&status["slices"], &status["done"], &status["left_s"]), (&14.into(), &0.into(), &70.0.into()));
    let early = farm.run(&["farm", "collect", "p.json", "--into", "cache"]);
    assert_eq!(early.code, 1);
    assert!(early.stderr.contains("14 of 14 slices have to run again, missing: 0-13"), "{}", early.stderr);
    farm.good(&["farm", "submit", "p.json", "--engine", "local", "--workers", "2"]);
    assert!(farm.good(&["farm", "status", "p.json"]).contains("14 of 14 slices, about 0 s of work left"));
    assert!(farm.good(&["farm", "run", "p.json", "--slice", "3"]).contains("there and intact"));
    let collected = farm.collected();
    assert_eq!(collected.len(), 6);
    assert!(collected == farm.expected(), "{:?}", collected.keys());
    // The files are those that a scene finds: nothing is baked for it, and the bake of a field on its own is the same.
    let bake = ["bake", "meshes/a.obj", "-o", "a.sf", "--cache-dir", cli::cache().to_str().unwrap()];
    farm.good(&[&bake[..], &DRAFT[1..]].concat());
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
    let mut plan: Value = serde_json::from_slice(&std::fs::read(farm.path("p.json")).unwrap()).unwrap();
    assert_eq!(plan["tasks"], serde_json::json!([[0, 0, "frames", 0, 5]]));
    plan["tasks"] = serde_json::json!([[0, 0, "frames", 0, 2], [0, 0, "frames", 2, 3]]);
    plan["slices"] = serde_json::json!([[0, 1, 1.0, 300, 1], [1, 1, 1.0, 300, 1]]);
    std::fs::write(farm.path("p.json"), plan.to_string()).unwrap();
    farm.good(&["farm", "submit", "p.json", "--engine", "local", "--workers", "1"]);
    farm.good(&["farm", "collect", "p.json"]);
    std::fs::create_dir(farm.path("plain")).unwrap();
    let cache = cli::cache().to_str().unwrap();
    let render = ["render", "film.toml", "-o", "plain/f_###.png", "--frames", "5", "--cache-dir", cache];
    farm.good(&[&render[..], &options].concat());
    let (found, plain) = (files(&farm.path("out")), files(&farm.path("plain")));
    assert_eq!(found.keys().collect::<Vec<_>>(), ["f_000.png", "f_001.png", "f_002.png", "f_003.png", "f_004.png"]);
    assert!(found == plain);
}
