//! `check`: every pass against its twin, from anywhere, and exit code 1 where one is off.

use crate::cli::{Folder, finish};
use serde_json::Value;
use shadow_fields::check::PASSES;
use shadow_fields::shaders::FILES;
use std::path::Path;

/// Checks one pass or all, with the folder's shaders or the built-in ones.
fn check(folder: &Folder, pass: &str, shaders: Option<&Path>) -> (i32, Value, String) {
    let mut command = folder.command(&format!("check {pass} --json --no-progress"));
    if let Some(shaders) = shaders {
        command.arg("--shader-dir").arg(shaders);
    }
    let ran = finish(&mut command);
    (ran.code, serde_json::from_str(&ran.stdout).unwrap_or(Value::Null), ran.stderr)
}

#[test]
fn every_pass_is_compared_and_passes() {
    let Some(folder) = Folder::with_device() else { return };
    let (code, report, stderr) = check(&folder, "", None);
    assert_eq!((code, &report["passed"]), (0, &Value::Bool(true)), "{stderr}");
    let rows = report["rows"].as_array().unwrap();
    for (pass, _) in PASSES {
        assert!(rows.iter().any(|row| row["pass"] == pass), "{pass} is not compared");
    }
    assert!(rows.iter().all(|row| row["worst"].as_f64().unwrap() <= row["tolerance"].as_f64().unwrap()));
    assert!(!report["origin"]["device"].as_str().unwrap().is_empty());
    assert!(folder.names().is_empty(), "it leaves nothing where it ran");
}

/// A hair's breadth wrong in one shader at a time: the pass that runs it must be named.
#[test]
fn a_wrong_shader_is_found() {
    let Some(folder) = Folder::with_device() else { return };
    let wrong = [
        ("capture.vert", "position.xyz - push.eye.xyz", "position.xyz - push.eye.xyz + 0.02", "capture"),
        ("silhouette_field.glsl", "foot + near.depth * along", "foot + 0.9 * near.depth * along", "sharp"),
        ("merge.comp", "float weight = above_horizon", "float weight = 0.999 * above_horizon", "merge"),
        ("draw.frag", "vec4(finish(shown", "vec4(1.01 * finish(shown", "draw"),
    ];
    for (file, from, to, pass) in wrong {
        let text = FILES.iter().find(|(name, _)| *name == file).unwrap().1;
        assert!(text.contains(from), "{file} no longer says \"{from}\"");
        let shaders = tempfile::tempdir().unwrap();
        std::fs::write(shaders.path().join(file), text.replace(from, to)).unwrap();
        let (code, report, stderr) = check(&folder, pass, Some(shaders.path()));
        assert_eq!((code, &report["passed"]), (1, &Value::Bool(false)), "{file}: {stderr}");
        let rows = report["rows"].as_array().unwrap().iter().filter(|row| row["passed"] == false);
        let failed: Vec<&Value> = rows.map(|row| &row["pass"]).collect();
        assert!(!failed.is_empty() && failed.iter().all(|row| **row == pass), "{file}: {failed:?}");
        assert!(stderr.contains("comparisons failed"), "{stderr}");
    }
}
