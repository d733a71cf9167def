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

use cli::{Folder, Ran, finish, has_device};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

const DRAFT: &str = "--quality draft --lattice cube:4x3 --face-px 16";
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
type Farm = Folder;

/// The plan of the meshes, and the cache files that it makes as one slice.
struct Whole {
    plan: Value,
    files: BTreeMap<String, Vec<u8>>,
}

/// All tests compare with the same.
fn whole() -> &'static Whole {
    static WHOLE: OnceLock<Whole> = OnceLock::new();
    WHOLE.get_or_init(|| {
        let farm = Farm::with_meshes().expect("a device");
        farm.good(&format!("farm plan meshes -o p.json {DRAFT}"));
        farm.good("farm run p.json --slice 0");
        Whole { plan: farm.plan("p.json"), files: farm.collected() }
    })
}

impl Farm {
    /// `None` where there is no device.
    fn with_meshes() -> Option<Self> {
        // A name that engines have to quote.
        let name = "a farm's \"5%\" $(touch x) `touch x` {command} {slices} {a";
        let farm = has_device().then(|| Folder::named(name))?;
        std::fs::create_dir(farm.at("meshes")).unwrap();
        for index in 0..MESHES {
            let mesh = match index {
                0 => common::generate::torus(0.6, 0.2, 12, 8),
                _ => common::generate::sphere(index as f32, 1),
            };
            farm.write(&format!("meshes/{}.obj", ["a", "b", "c", "d", "e", "f"][index]), common::obj(&mesh));
        }
        farm.write("film.toml", SCENE);
        Some(farm)
    }

    /// One with the plan of its meshes, each a slice of its own.
    fn planned() -> Option<Self> {
        let farm = Self::with_meshes()?;
        let mut plan = whole().plan.clone();
        let slice = |index| json!({ "meshes": { "first": index, "count": 1 } });
        plan["slices"] = (0..MESHES).map(slice).collect();
        farm.write("p.json", plan.to_string());
        Some(farm)
    }

    fn plan(&self, name: &str) -> Value {
        serde_json::from_slice(&self.read(name)).unwrap()
    }

    fn collected(&self) -> BTreeMap<String, Vec<u8>> {
        self.good("farm collect p.json --into cache");
        files(&self.at("cache/fields"))
    }

    /// The files of all results. What killed slices left unfinished beside them is none.
    fn results(&self) -> Vec<PathBuf> {
        let folders = std::fs::read_dir(self.at("results")).into_iter().flatten();
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
    assert_eq!(farm.json("farm status p.json"), json!({ "slices": 6, "done": 0 }));
    let early = farm.run("farm collect p.json --into cache");
    early.ended(1, &["6 of 6 slices to run again, missing: 0-5"]);
    farm.good("farm submit p.json --engine local --workers 2");
    assert!(farm.good("farm status p.json").stdout.contains("6 of 6 slices done"));
    assert!(farm.good("farm run p.json --slice 3").stdout.contains("there and intact"));
    // What another driver left in the cache is replaced.
    farm.collected();
    let known: Vec<PathBuf> = whole().files.keys().map(|name| farm.at("cache/fields").join(name)).collect();
    known.iter().for_each(|path| std::fs::write(path, "another driver's").unwrap());
    let collected = farm.collected();
    // The field and outlines of each mesh, and what is baked of the vertices of the one that is not convex.
    assert_eq!(collected.len(), 2 * MESHES + 1);
    assert!(collected == whole().files, "{:?}", collected.keys());
    // `bake` makes the same field, and a scene finds its fields; at rest it sees past all else, which no farm knows.
    farm.good(&format!("bake meshes/a.obj -o a.sf {DRAFT}"));
    assert!(collected.values().any(|bytes| *bytes == farm.read("a.sf")), "the field of bake");
    let render = format!("render film.toml -o f.png --size 48x32 --json --cache-dir cache {DRAFT}");
    let report: Value = serde_json::from_str(&finish(&mut farm.bare(&render)).stdout).unwrap();
    let baked = report["baked"].as_array().unwrap();
    let of_ring = baked.iter().filter(|bake| bake["what"].as_str().unwrap().starts_with("ring"));
    assert_eq!(of_ring.map(|bake| bake["what"].as_str().unwrap()).collect::<Vec<_>>(), ["ring view"]);
}

#[test]
fn slices_of_pictures_are_those_of_render() {
    let Some(farm) = Farm::with_meshes() else { return };
    std::fs::copy(farm.at("film.toml"), farm.at("other.toml")).unwrap();
    let options = format!("--size 48x32 --variant storage --time 0.5 {DRAFT}");
    let plan = "farm plan film.toml other.toml --frames 5 --pictures out/$_###.png -o p.json --per-slice 3";
    let said = farm.good(&format!("{plan} {options}")).stdout;
    assert!(said.contains("p.json: 4 slices"), "{said}");
    let slice = |film, first, count| json!({ "pictures": { "film": film, "first": first, "count": count } });
    assert_eq!(farm.plan("p.json")["slices"], json!([slice(0, 0, 3), slice(0, 3, 2), slice(1, 0, 3), slice(1, 3, 2)]));
    farm.good("farm submit p.json --engine local --workers 1");
    farm.good("farm collect p.json");
    std::fs::create_dir(farm.at("plain")).unwrap();
    for film in ["film", "other"] {
        farm.good(&format!("render {film}.toml -o plain/{film}_###.png --frames 5 {options}"));
    }
    let found = files(&farm.at("out"));
    let plain = files(&farm.at("plain"));
    assert_eq!(found.len(), 10);
    assert!(found.contains_key("film_000.png") && found["film_000.png"] != found["film_004.png"]);
    assert!(found == plain);
}
