//! What goes wrong on machines: kills, damage, folders that cannot be written. Nothing is lost or wrong then.

use super::{Farm, MESHES, cli, common, finish, processes, whole};
use serde_json::{Value, json};
use shadow_fields::farm::{Plan, results};
use std::process::Command;

#[test]
fn damaged_results_and_slices_that_run_twice_at_once_end_well() {
    let Some(farm) = Farm::planned() else { return };
    let mut twice: Vec<_> = (0..2).map(|_| farm.command("farm run p.json --slice 0 -q").spawn().unwrap()).collect();
    assert!(twice.iter_mut().all(|process| process.wait().unwrap().success()));
    assert_eq!(farm.results().len(), 1);
    farm.good("farm submit p.json --engine local");
    assert!(farm.collected() == whole().files);
    let plan = Plan::read(&farm.at("p.json")).unwrap();
    let results: Vec<_> = (0..MESHES).map(|slice| results::path(&plan, slice)).collect();
    // One byte is turned, one file is cut, one is another slice's, one is gone.
    let bytes: Vec<Vec<u8>> = results.iter().map(|path| std::fs::read(path).unwrap()).collect();
    let mut turned = bytes[0].clone();
    *turned.last_mut().unwrap() ^= 1;
    std::fs::write(&results[0], turned).unwrap();
    std::fs::write(&results[1], &bytes[1][..bytes[1].len() / 2]).unwrap();
    std::fs::write(&results[2], &bytes[3]).unwrap();
    std::fs::remove_file(&results[4]).unwrap();
    let again = format!("4 of {MESHES} slices to run again, missing: 4, damaged: 0-2");
    let found = farm.run("farm collect p.json --into cache --json").ended(1, &[&again]);
    let said: Value = serde_json::from_str(&found.stdout).unwrap();
    assert_eq!((&said["missing"], &said["damaged"]), (&json!([4]), &json!([0, 1, 2])));
    farm.good("farm submit p.json --engine local");
    assert!(farm.collected() == whole().files);
    // A slice whose result is damaged does it anew by itself.
    std::fs::write(&results[0], b"not a result").unwrap();
    let said = farm.good("farm run p.json --slice 0").stdout;
    assert!(said.contains("done in"), "{said}");
    assert!(farm.collected() == whole().files);
}

/// A cache that cannot be written is no error of a bake, but here it is the result; nothing is left half-written.
#[test]
fn a_slice_that_cannot_be_written_fails() {
    let Some(farm) = Farm::planned() else { return };
    let run = farm.command("farm run p.json --slice 0 -q");
    let ran = finish(&mut cli::limited(&run, "ulimit -f 4"));
    assert_eq!((ran.code, ran.stdout.as_str()), (1, ""), "{}", ran.stderr);
    // The folder that the slice works in is the first that cannot be written.
    assert!(["cannot be written", "were written"].iter().any(|words| ran.stderr.contains(words)), "{}", ran.stderr);
    assert!(farm.results().is_empty());
    farm.good("farm submit p.json --engine local");
    assert!(farm.collected() == whole().files);
}

/// Slices, workers and submitters are killed at random moments: what is there is whole, and the rest is done.
#[test]
fn kills_lose_at_most_the_slice() {
    let Some(farm) = Farm::planned() else { return };
    let kills: usize = std::env::var("SHADOW_FIELDS_FARM_KILLS").map_or(4, |text| text.parse().unwrap());
    let mut random = fastrand::Rng::with_seed(7);
    let mut killed = 0;
    for kill in 0..kills {
        if kill % 4 == 0 {
            let _ = std::fs::remove_dir_all(farm.at("results"));
        }
        let before = farm.results();
        let mut command = match kill % 2 {
            0 => farm.command("farm submit p.json --engine local --workers 2 -q"),
            _ => farm.command(&format!("farm run p.json --slice {} -q", random.usize(0..MESHES))),
        };
        let mut process = command.stdout(std::process::Stdio::null()).spawn().unwrap();
        std::thread::sleep(std::time::Duration::from_millis(random.u64(50..1500)));
        let words = farm.path().as_os_str().as_encoded_bytes();
        let all = [vec![process.id()], processes(words)].concat();
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
        // Slices of a submitter that was killed end too.
        let start = std::time::Instant::now();
        while !processes(words).is_empty() {
            assert!(start.elapsed().as_secs() < 60, "slices of a killed submitter end");
            std::thread::sleep(std::time::Duration::from_millis(20));
        }
        let after = farm.results();
        assert!(before.iter().all(|path| after.contains(path)), "nothing is lost");
        let found = farm.run("farm collect p.json --into cache --json");
        let said: Value = serde_json::from_str(&found.stdout).unwrap();
        assert_eq!(said["damaged"], serde_json::json!([]), "nothing is wrong: {}", found.stderr);
        assert_eq!(said["missing"].as_array().unwrap().len(), MESHES - after.len());
    }
    farm.good("farm submit p.json --engine local");
    let _ = std::fs::remove_dir_all(farm.at("cache"));
    assert!(farm.collected() == whole().files);
    // What killed slices left is swept by the next that writes to the same folder, and is no result in any case.
    common::report(&format!("{kills} moments, {killed} processes killed"));
}
