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
        for (name, mesh) in [("a", common::generate::torus(0.6, 0.2, 12, 8)), ("b", common::generate::sphere(1.0, 1))] {
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

    /// The files of all results.
    fn results(&self) -> Vec<PathBuf> {
        let folders = std::fs::read_dir(self.path("results")).into_iter().flatten();
        let files = folders.flat_map(|folder| std::fs::read_dir(folder.unwrap().path()).unwrap());
        let mut files: Vec<PathBuf> = files.map(|file| file.unwrap().path()).collect();
        files.sort();
        files
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

#[test]
fn damaged_results_and_slices_that_run_twice_at_once_end_well() {
    if !has_device() {
        return;
    }
    let farm = Farm::new();
    let slices = farm.plan(1);
    let mut twice: Vec<_> =
        (0..2).map(|_| farm.command(&["farm", "run", "p.json", "--slice", "0", "-q"]).spawn().unwrap()).collect();
    assert!(twice.iter_mut().all(|process| process.wait().unwrap().success()));
    assert_eq!(farm.results().len(), 1);
    farm.good(&["farm", "submit", "p.json", "--engine", "local"]);
    let expected = farm.collected();
    assert!(expected == farm.expected());
    let results = farm.results();
    assert_eq!(results.len(), slices);
    // One byte is turned, one file is cut, one is another slice's, one is gone.
    let bytes: Vec<Vec<u8>> = results.iter().map(|path| std::fs::read(path).unwrap()).collect();
    let mut turned = bytes[0].clone();
    *turned.last_mut().unwrap() ^= 1;
    std::fs::write(&results[0], turned).unwrap();
    std::fs::write(&results[1], &bytes[1][..bytes[1].len() / 2]).unwrap();
    std::fs::write(&results[2], &bytes[3]).unwrap();
    std::fs::remove_file(&results[4]).unwrap();
    let found = farm.run(&["farm", "collect", "p.json", "--into", "cache", "--json"]);
    assert_eq!(found.code, 1, "{}", found.stderr);
    assert!(found.stderr.contains(&format!("4 of {slices} slices have to run again, missing: ")), "{}", found.stderr);
    let said: Value = serde_json::from_str(&found.stdout).unwrap();
    assert_eq!((said["missing"].as_array().unwrap().len(), said["damaged"].as_array().unwrap().len()), (1, 3));
    farm.good(&["farm", "submit", "p.json", "--engine", "local"]);
    assert!(farm.collected() == expected);
    // A slice whose result is damaged does it anew by itself.
    std::fs::write(&results[0], b"not a result").unwrap();
    let number = (0..slices).find(|k| {
        let said = farm.good(&["farm", "run", "p.json", "--slice", &k.to_string()]);
        !said.contains("there and intact")
    });
    assert!(number.is_some());
    assert!(farm.collected() == expected);
}

#[test]
fn other_programs_devices_and_inputs_are_refused_with_both_names() {
    if !has_device() {
        return;
    }
    let farm = Farm::new();
    farm.plan(1);
    let good = std::fs::read_to_string(farm.path("p.json")).unwrap();
    let refused = |edit: &dyn Fn(&mut Value)| {
        let mut plan: Value = serde_json::from_str(&good).unwrap();
        edit(&mut plan);
        std::fs::write(farm.path("p.json"), plan.to_string()).unwrap();
        let ran = farm.run(&["farm", "run", "p.json", "--slice", "0", "-q"]);
        assert!(farm.results().is_empty());
        (ran.code, ran.stderr)
    };
    let (code, said) = refused(&|plan| plan["program"] = "shadow-fields 0.0.1 0123456".into());
    assert!(code == 3 && said.contains("a plan of shadow-fields 0.0.1 0123456, and this is shadow-fields "), "{said}");
    let (code, said) = refused(&|plan| plan["device"]["driver"] = "llvmpipe, Mesa 1.2".into());
    assert!(code == 3 && said.contains("Mesa 1.2), and this device is "), "{said}");
    let (code, said) = refused(&|plan| plan["inputs"][0]["hash"] = "00".into());
    assert!(code == 4 && said.contains("a.obj: it has changed since the plan was made"), "{said}");
    // An engine says the same, and tries it once.
    std::fs::write(farm.path("p.json"), good.replace("\"driver\":\"", "\"driver\":\"other ")).unwrap();
    let ran = farm.run(&["farm", "submit", "p.json", "--engine", "local"]);
    assert!(ran.code == 1 && ran.stderr.contains("and this device is"), "{}", ran.stderr);
}

/// A full disk, a read-only folder and a limit on the sizes of files: the slice fails with one line, and leaves nothing half-written.
#[test]
fn folders_that_cannot_be_written_lose_nothing() {
    if !has_device() {
        return;
    }
    let farm = Farm::new();
    farm.plan(1);
    std::fs::create_dir(farm.path("results")).unwrap();
    for (words, how) in [
        (&["unshare", "-m", "sh"][..], "mount -t tmpfs -o size=8k none results"),
        (&["unshare", "-m", "sh"], "mount -t tmpfs -o ro none results"),
        (&["sh"], "ulimit -f 4"),
    ] {
        let inner = farm.command(&["farm", "run", "p.json", "--slice", "0", "-q"]);
        let mut outer = Command::new(words[0]);
        let after = "\"$@\"; code=$?; find results -type f; exit $code";
        outer.current_dir(farm.folder.path()).args(&words[1..]).args([
            "-c",
            &format!("{how} || exit 99; {after}"),
            "sh",
        ]);
        outer.arg(inner.get_program()).args(inner.get_args()).env_remove("RUST_LOG");
        let ran = finish(&mut outer);
        if ran.code == 99 {
            common::report(&format!("not allowed here: {how}"));
            continue;
        }
        assert_eq!((ran.code, ran.stdout.as_str()), (1, ""), "{how}: {}", ran.stderr);
        // With the limit, the folder that the slice works in is the first that cannot be written.
        let said = ["cannot be written", "nothing was written"];
        assert!(said.iter().any(|words| ran.stderr.contains(words)), "{how}: {}", ran.stderr);
    }
    farm.good(&["farm", "submit", "p.json", "--engine", "local"]);
    assert!(farm.collected() == farm.expected());
}

/// Process ids of all that descend from a process, and its own.
fn descendants(parent: u32) -> Vec<u32> {
    let parents: Vec<(u32, u32)> = std::fs::read_dir("/proc")
        .unwrap()
        .filter_map(|entry| {
            let entry = entry.ok()?;
            let id: u32 = entry.file_name().to_str()?.parse().ok()?;
            let stat = std::fs::read_to_string(entry.path().join("stat")).ok()?;
            Some((id, stat.rsplit_once(") ")?.1.split(' ').nth(1)?.parse().ok()?))
        })
        .collect();
    let mut all = vec![parent];
    let mut next = 0;
    while next < all.len() {
        let parent = all[next];
        all.extend(parents.iter().filter(|(_, of)| *of == parent).map(|(id, _)| *id));
        next += 1;
    }
    all
}

/// Slices, workers and submitters are killed at random moments. Afterwards what is there is whole, and the rest is done.
#[test]
fn kills_lose_at_most_the_slice() {
    if !has_device() {
        return;
    }
    let kills: usize = std::env::var("SHADOW_FIELDS_FARM_KILLS").map_or(4, |text| text.parse().unwrap());
    let farm = Farm::new();
    let slices = farm.plan(2);
    let expected = farm.expected();
    let mut random = fastrand::Rng::with_seed(7);
    let (mut whole, mut killed) = (0, 0);
    for kill in 0..kills {
        if kill % 4 == 0 {
            let _ = std::fs::remove_dir_all(farm.path("results"));
        }
        let before = farm.results();
        let mut command = match kill % 2 {
            0 => farm.command(&["farm", "submit", "p.json", "--engine", "local", "--workers", "2", "-q"]),
            _ => farm.command(&["farm", "run", "p.json", "--slice", &random.usize(0..slices).to_string(), "-q"]),
        };
        let mut process = command.stdout(std::process::Stdio::null()).spawn().unwrap();
        std::thread::sleep(std::time::Duration::from_millis(random.u64(50..1500)));
        let all = descendants(process.id());
        // The submitter alone, any one of its processes, or all of them as when a machine loses power.
        let chosen = match random.usize(0..3) {
            0 => vec![all[0]],
            1 => vec![all[random.usize(0..all.len())]],
            _ => all.clone(),
        };
        for id in &chosen {
            let status =
                Command::new("kill").args(["-9", &id.to_string()]).stderr(std::process::Stdio::null()).status();
            killed += usize::from(status.unwrap().success());
        }
        process.wait().unwrap();
        // Slices of a submitter that was killed go on to their ends.
        let start = std::time::Instant::now();
        while all
            .iter()
            .any(|id| std::fs::read_to_string(format!("/proc/{id}/cmdline")).is_ok_and(|line| line.contains("p.json")))
        {
            assert!(start.elapsed().as_secs() < 60, "slices of a killed submitter end");
            std::thread::sleep(std::time::Duration::from_millis(20));
        }
        let after = farm.results();
        assert!(before.iter().all(|path| after.contains(path)), "nothing is lost");
        let found = farm.run(&["farm", "collect", "p.json", "--into", "cache", "--json"]);
        let said: Value = serde_json::from_str(&found.stdout).unwrap();
        assert_eq!(said["damaged"], serde_json::json!([]), "nothing is wrong: {}", found.stderr);
        let finished = after.iter().filter(|path| path.extension().is_some_and(|e| e == "slice")).count();
        assert_eq!(said["missing"].as_array().unwrap().len(), slices - finished);
        whole += usize::from(found.code == 0);
    }
    farm.good(&["farm", "submit", "p.json", "--engine", "local"]);
    let _ = std::fs::remove_dir_all(farm.path("cache"));
    assert!(farm.collected() == expected);
    // What killed slices left is swept by the next that writes to the same folder, and is no result in any case.
    common::report(&format!("{kills} moments, {killed} processes killed, {whole} plans whole then"));
}

/// Whether the engines of others have to be there.
fn engine(name: &str, is_there: bool) -> bool {
    let required = std::env::var_os("SHADOW_FIELDS_REQUIRE_FARM").is_some_and(|value| value == "1");
    assert!(
        is_there || !required,
        "SHADOW_FIELDS_REQUIRE_FARM=1, but {name} is not there: scripts/setup test installs it"
    );
    if !is_there {
        common::report(&format!("skipped: {name} is not installed"));
    }
    is_there
}

/// The path of programs, with those of the virtual environment that `scripts/setup test` makes first.
fn search_path() -> String {
    let own = Path::new(env!("CARGO_MANIFEST_DIR")).join(".build/farm/bin");
    format!("{}:{}:/usr/sbin", own.display(), std::env::var("PATH").unwrap())
}

fn succeeds(program: &str, arguments: &[&str]) -> bool {
    let mut command = Command::new("env");
    command.arg(program).args(arguments).env("PATH", search_path());
    command.output().is_ok_and(|output| output.status.success())
}

#[test]
fn dask_runs_slices_in_two_workers() {
    if !has_device() || !engine("Dask", succeeds("python3", &["-c", "import distributed"])) {
        return;
    }
    let farm = Farm::new();
    farm.plan(1);
    let mut submit = farm.command(&["farm", "submit", "p.json", "--engine", "dask", "--workers", "2", "-q"]);
    let ran = finish(submit.env("PATH", search_path()));
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    assert!(farm.collected() == farm.expected());
}

#[test]
fn templates_and_commands_are_what_other_farms_take() {
    if !has_device() {
        return;
    }
    let farm = Farm::new();
    let slices = farm.plan(1);
    let commands = farm.good(&["farm", "submit", "p.json", "--engine", "print"]);
    assert_eq!(commands.lines().count(), slices);
    assert!(Command::new("sh").args(["-c", commands.lines().next().unwrap()]).output().unwrap().status.success());
    assert_eq!(farm.results().len(), 1);
    let template = farm.good(&["farm", "submit", "p.json", "--engine", "openjd"]);
    let json: Value = serde_json::from_str(&template).unwrap();
    let range = &json["steps"][0]["parameterSpace"]["taskParameterDefinitions"][0]["range"];
    assert_eq!(*range, format!("1-{}", slices - 1), "only what is missing");
    if engine("OpenJD", succeeds("openjd", &["--version"]) || succeeds("openjd", &["--help"])) {
        let path = farm.path("job.template.json");
        std::fs::write(&path, template).unwrap();
        assert!(succeeds("openjd", &["check", path.to_str().unwrap()]));
        assert!(succeeds("openjd", &["run", path.to_str().unwrap(), "--step", "Slices", "--task-param", "Slice=1"]));
        assert_eq!(farm.results().len(), 2);
        std::fs::write(&path, json.to_string().replace("Task.Param.Slice", "Task.Param.Other")).unwrap();
        assert!(!succeeds("openjd", &["check", path.to_str().unwrap()]), "it tells a broken template");
    }
}

/// Slurm of one node, stopped at the end.
struct SlurmNode(PathBuf);

impl SlurmNode {
    fn script(&self, what: &str) -> bool {
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("scripts/slurm-node");
        let mut command = Command::new(script);
        // Its services outlive the script, and hold no pipe of the test.
        command.arg(&self.0).arg(what).env("PATH", search_path());
        command.stdin(std::process::Stdio::null()).stdout(std::process::Stdio::null()).status().unwrap().success()
    }

    fn conf(&self) -> PathBuf {
        self.0.join("slurm.conf")
    }
}

impl Drop for SlurmNode {
    fn drop(&mut self) {
        self.script("stop");
    }
}

#[test]
fn slurm_runs_an_array_and_requeues_what_dies() {
    let there = ["slurmctld", "slurmd", "sbatch", "munged"]
        .iter()
        .all(|name| search_path().split(':').any(|folder| Path::new(folder).join(name).exists()));
    let root = std::fs::metadata("/proc/self").is_ok_and(|about| std::os::unix::fs::MetadataExt::uid(&about) == 0);
    if !has_device() || !engine("Slurm", there && root) {
        return;
    }
    let farm = Farm::new();
    let slices = farm.plan(1);
    let node = SlurmNode(farm.path("slurm"));
    assert!(node.script("start"));
    // The first start of slice 0 is killed; Slurm puts it back into the queue.
    let text = std::fs::read_to_string(farm.path("p.json")).unwrap();
    let mut submit = farm.command(&["farm", "submit", "p.json", "--engine", "slurm", "--workers", "2", "--dry-run"]);
    let line = finish(submit.env("SLURM_CONF", node.conf()));
    assert!(line.stdout.contains(&format!("--array=0-{}%2 --export=ALL,FIRST=0", slices - 1)), "{}", line.stdout);
    let script = farm.path("p.sbatch");
    let written = std::fs::read_to_string(&script).unwrap();
    let dies = written.replacen("code=$?", "code=$?; echo died", 1).replacen(
        "echo \"slice",
        "if [ \"$slice\" = 0 ] && [ \"${SLURM_RESTART_COUNT:-0}\" = 0 ]; then set -- kill -9; fi\necho \"slice",
        1,
    );
    let dies = dies.replacen(PROGRAM, &format!("[ \"$1\" != kill ] && {PROGRAM}"), 1);
    std::fs::write(&script, dies).unwrap();
    assert_eq!(std::fs::read_to_string(farm.path("p.json")).unwrap(), text);
    let array = format!("--array=0-{}%2", slices - 1);
    let mut sbatch = Command::new("sbatch");
    sbatch
        .args([&array, "--export=ALL,FIRST=0"])
        .arg(&script)
        .env("SLURM_CONF", node.conf())
        .env("PATH", search_path());
    let ran = finish(&mut sbatch);
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    let start = std::time::Instant::now();
    while farm.results().len() < slices {
        assert!(start.elapsed().as_secs() < 200, "{}", farm.good(&["farm", "status", "p.json"]));
        if farm.results().len() == slices - 1 {
            // A requeued task waits for two minutes unless it is released.
            let mut release = Command::new("scontrol");
            let _ = release.args(["update", "JobId=1_0", "StartTime=now"]).env("SLURM_CONF", node.conf()).output();
        }
        std::thread::sleep(std::time::Duration::from_millis(200));
    }
    assert!(farm.collected() == farm.expected());
    let log = std::fs::read_to_string(farm.path("p.logs/1_0.log")).unwrap();
    assert!(log.contains("start 0") && log.contains("start 1") && log.contains("died"), "{log}");
}
