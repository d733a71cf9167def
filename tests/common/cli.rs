//! Runs the program as a user does: in a folder of its own, with a cache that all tests of a binary share.

#![allow(dead_code)] // every test binary uses its own part

use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;

/// What a run left behind.
pub struct Ran {
    pub code: i32,
    pub stdout: String,
    pub stderr: String,
}

/// Folder of fields and shaders; emptied when a test binary starts, so that nothing of an earlier build is found.
pub fn cache() -> &'static Path {
    static FOLDER: OnceLock<PathBuf> = OnceLock::new();
    FOLDER.get_or_init(|| {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("cli-{}", env!("CARGO_CRATE_NAME")));
        let _ = std::fs::remove_dir_all(&folder);
        folder
    })
}

/// The program with arguments, in `folder`, not yet run.
pub fn command(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_shadow-fields"));
    command.current_dir(folder).args(arguments).arg("--cache-dir").arg(cache());
    command.env_remove("RUST_LOG").env("NO_COLOR", "1");
    command
}

/// Runs a command to its end.
pub fn finish(command: &mut Command) -> Ran {
    let Output { status, stdout, stderr } = command.output().unwrap();
    let text = |bytes| String::from_utf8(bytes).expect("what the program says is UTF-8");
    Ran { code: status.code().expect("it ended by itself"), stdout: text(stdout), stderr: text(stderr) }
}

/// Runs the program, which must succeed.
pub fn good(folder: &Path, arguments: &[&str]) -> Ran {
    let ran = finish(&mut command(folder, arguments));
    assert_eq!(ran.code, 0, "{arguments:?}: {}", ran.stderr);
    ran
}

/// Names in a folder, sorted.
pub fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).unwrap();
    let mut names: Vec<_> = entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

/// Whether a device is there, as the program sees it.
pub fn has_device() -> bool {
    static RAN: OnceLock<Ran> = OnceLock::new();
    let ran = RAN.get_or_init(|| finish(&mut command(Path::new("."), &["devices"])));
    if ran.code != 0 {
        super::common::skip(&ran.stderr);
    }
    ran.code == 0
}

/// Arguments that make every bake and picture small.
pub const SMALL: [&str; 6] = ["--lattice", "cube:4x3", "--face-px", "16", "--size", "96x64"];
