//! The engines of others: Slurm, Dask, OpenJD, and lines of commands.

use super::{Farm, MESHES, cli, common, finish, processes, whole};
use serde_json::Value;
use std::path::Path;
use std::process::{Command, Stdio};

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
    if !engine("Dask", succeeds("python3", &["-c", "import distributed"])) {
        return;
    }
    let Some(farm) = Farm::planned() else { return };
    let mut submit = farm.command("farm submit p.json --engine dask --workers 2 -q");
    finish(submit.env("PATH", search_path())).ended(0, &[]);
    assert!(farm.collected() == whole().files);
}

#[test]
fn a_dask_that_is_missing_says_so_in_a_line() {
    let Some(farm) = Farm::planned() else { return };
    std::fs::create_dir(farm.at("stub")).unwrap();
    farm.write("stub/distributed.py", "raise ImportError");
    let mut submit = farm.command("farm submit p.json --engine dask");
    let ran = finish(submit.env("PYTHONPATH", farm.at("stub")));
    assert_eq!((ran.code, ran.stderr.as_str()), (1, "shadow-fields: dask: python3 has no package distributed\n"));
}

/// No path of a plan, whoever wrote it, becomes a line of a script.
#[test]
fn control_characters_in_paths_are_refused_by_plan_and_by_engines() {
    let Some(farm) = Farm::planned() else { return };
    let evil = "p\n$(touch x)\n.json";
    let refused = |ran: super::Ran, code, words: &[&str]| {
        assert_eq!((ran.code, ran.stdout.as_str()), (code, ""), "{words:?}: {}", ran.stderr);
        let is_line = ran.stderr.lines().count() == 1 && ran.stderr.contains("\\n$(touch x)\\n");
        assert!(is_line, "{words:?}: {}", ran.stderr);
    };
    std::fs::create_dir(farm.at("m\n$(touch x)\n")).unwrap();
    std::fs::copy(farm.at("meshes/a.obj"), farm.at("m\n$(touch x)\n/a.obj")).unwrap();
    for words in [
        &["farm", "plan", "meshes", "-q", "-o", evil][..],
        &["farm", "plan", "meshes", "-q", "-o", "q.json", "--results", evil],
        &["farm", "plan", "m\n$(touch x)\n", "-q", "-o", "q.json"],
        &["farm", "plan", "film.toml", "-q", "-o", "q.json", "--frames", "1", "--pictures", "\n$(touch x)\n#.png"],
    ] {
        refused(finish(farm.command("").args(words)), 2, words);
    }
    std::fs::copy(farm.at("p.json"), farm.at(evil)).unwrap();
    let mut plan = farm.plan("p.json");
    plan["results"] = evil.into();
    farm.write("inner.json", plan.to_string());
    for engine in [&["local"][..], &["slurm"], &["slurm", "--dry-run"], &["dask"], &["print"], &["openjd"]] {
        let submit = |plan| [&["farm", "submit", plan, "--engine"], engine].concat();
        refused(finish(farm.command("").args(submit(evil))), 2, engine);
        refused(finish(farm.command("").args(submit("inner.json"))), 4, engine);
        refused(finish(farm.bare("").args(submit("p.json")).args(["--cache-dir", evil])), 2, engine);
    }
    assert!(!farm.at("x").exists() && farm.results().is_empty());
    // What only one kind of template cannot have.
    for (name, engine) in [("p{{.json", "openjd"), ("p\\.json", "slurm")] {
        std::fs::copy(farm.at("p.json"), farm.at(name)).unwrap();
        farm.run(&format!("farm submit {name} --engine {engine} --dry-run")).ended(2, &[" takes no "]);
    }
}

#[test]
fn templates_and_commands_are_what_other_farms_take() {
    let Some(farm) = Farm::planned() else { return };
    let commands = farm.good("farm submit p.json --engine print").stdout;
    assert_eq!(commands.lines().count(), MESHES);
    assert!(Command::new("sh").args(["-c", commands.lines().next().unwrap()]).output().unwrap().status.success());
    assert!(farm.results().len() == 1 && !farm.at("x").exists());
    let template = farm.good("farm submit p.json --engine openjd").stdout;
    let json: Value = serde_json::from_str(&template).unwrap();
    let range = &json["steps"][0]["parameterSpace"]["taskParameterDefinitions"][0]["range"];
    assert_eq!(*range, format!("1-{}", MESHES - 1), "only what is missing");
    if engine("OpenJD", succeeds("openjd", &["--version"]) || succeeds("openjd", &["--help"])) {
        let path = farm.at("job.template.json");
        std::fs::write(&path, template).unwrap();
        assert!(succeeds("openjd", &["check", path.to_str().unwrap()]));
        assert!(succeeds("openjd", &["run", path.to_str().unwrap(), "--step", "Slices", "--task-param", "Slice=1"]));
        assert_eq!(farm.results().len(), 2);
        std::fs::write(&path, json.to_string().replace("Task.Param.Slice", "Task.Param.Other")).unwrap();
        assert!(!succeeds("openjd", &["check", path.to_str().unwrap()]), "it tells a broken template");
    }
}

/// Slurm of one node, stopped at the end.
struct SlurmNode(tempfile::TempDir);

impl SlurmNode {
    fn script(&self, what: &str) -> bool {
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("scripts/slurm-node");
        let mut command = Command::new(script);
        // Its services outlive the script, and hold no pipe of the test.
        command.arg(self.0.path()).arg(what).env("PATH", search_path());
        command.stdin(Stdio::null()).stdout(Stdio::null()).status().unwrap().success()
    }

    fn on<'c>(&self, command: &'c mut Command) -> &'c mut Command {
        command.env("SLURM_CONF", self.0.path().join("slurm.conf")).env("PATH", search_path())
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
    if !engine("Slurm", there && root) {
        return;
    }
    let Some(farm) = Farm::planned() else { return };
    let node = SlurmNode(tempfile::tempdir().unwrap());
    assert!(node.script("start"));
    let submit = "farm submit p.json --engine slurm --workers 2";
    let dry = finish(node.on(&mut farm.command(&format!("{submit} --dry-run"))));
    assert!(dry.stdout.contains(&format!("--array=0-{}%2 '--output=", MESHES - 1)), "{}", dry.stdout);
    let ran = finish(node.on(&mut farm.command(submit)));
    assert!(ran.code == 0 && ran.stdout.starts_with("Submitted batch job "), "{} {}", ran.stdout, ran.stderr);
    let job = ran.stdout.trim().rsplit(' ').next().unwrap().to_owned();
    // The first start of slice 0 is killed; Slurm puts it back into the queue.
    let plan = farm.at("p.json");
    let words = [plan.to_str().unwrap(), "--no-progress", "--quiet", "--cache-dir", cli::cache().to_str().unwrap()];
    let first = format!("{}\0--slice\x000\0", words.join("\0")).into_bytes();
    let start = std::time::Instant::now();
    let mut killed = false;
    while farm.results().len() < MESHES {
        assert!(start.elapsed().as_secs() < 200, "{}", farm.good("farm status p.json").stdout);
        if let Some(id) = processes(&first).first().filter(|_| !killed) {
            killed = Command::new("kill").args(["-9", &id.to_string()]).status().unwrap().success();
        }
        if killed {
            // A requeued task waits for two minutes unless it is released.
            let task = format!("JobId={job}_0");
            let _ = node.on(Command::new("scontrol").args(["update", &task, "StartTime=now"])).output();
        }
        std::thread::sleep(std::time::Duration::from_millis(50));
    }
    assert!(killed && !farm.at("x").exists());
    assert!(farm.collected() == whole().files);
    let log = std::fs::read_to_string(farm.at(&format!("p.logs/{job}_0.log"))).unwrap();
    assert!(log.contains("start 0") && log.contains("start 1"), "{log}");
}
