//! Runs the program as a user does: in a folder of its own, with a cache that all tests of a binary share.

#![allow(dead_code)] // every test binary uses its own part

use super::common::{self, names};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;
use std::time::SystemTime;

/// Options that make bakes small.
pub const COARSE: &str = "--lattice cube:4x3 --face-px 16";
pub const SMALL: &str = "--lattice cube:4x3 --face-px 16 --size 96x64";

pub const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

/// What a run left behind.
pub struct Ran {
    command: String,
    pub code: i32,
    pub stdout: String,
    pub stderr: String,
}

impl Ran {
    /// Asserts how it ended and that its stderr has these words.
    #[track_caller]
    pub fn ended(self, code: i32, words: &[&str]) -> Self {
        let Ran { command, stderr, .. } = &self;
        assert_eq!(self.code, code, "{command}: {stderr}");
        words.iter().for_each(|word| assert!(stderr.contains(word), "{command}: no {word:?} in {stderr}"));
        self
    }
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

/// The program in `folder` with the words of a line and no cache that is named, not yet run.
pub fn bare(folder: &Path, line: &str) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_shadow-fields"));
    command.current_dir(folder).args(line.split(' ').filter(|word| !word.is_empty()));
    command.env_remove("RUST_LOG").env("NO_COLOR", "1");
    command
}

/// The same with the cache of the tests.
pub fn command(folder: &Path, line: &str) -> Command {
    let mut command = bare(folder, line);
    command.arg("--cache-dir").arg(cache());
    command
}

pub fn finish(command: &mut Command) -> Ran {
    let Output { status, stdout, stderr } = command.output().unwrap();
    let text = |bytes| String::from_utf8(bytes).expect("what the program says is UTF-8");
    let code = status.code().expect("it ended by itself");
    Ran { command: format!("{command:?}"), code, stdout: text(stdout), stderr: text(stderr) }
}

/// Whether a device is there, as the program sees it.
pub fn has_device() -> bool {
    static RAN: OnceLock<Ran> = OnceLock::new();
    let ran = RAN.get_or_init(|| finish(&mut command(Path::new("."), "devices")));
    if ran.code != 0 {
        common::skip(&ran.stderr);
    }
    ran.code == 0
}

pub fn without_drivers(command: &mut Command) -> &mut Command {
    for variable in ["VK_DRIVER_FILES", "VK_ICD_FILENAMES"] {
        command.env(variable, "/nowhere/no.json");
    }
    command.env_remove("VK_ADD_DRIVER_FILES")
}

/// The same command with its program and arguments run by a shell after `how`, which limits something.
pub fn limited(command: &Command, how: &str) -> Command {
    let mut shell = Command::new("sh");
    shell.current_dir(command.get_current_dir().unwrap()).args(["-c", &format!("{how}; exec \"$@\""), "sh"]);
    shell.arg(command.get_program()).args(command.get_args());
    shell
}

pub struct Folder(tempfile::TempDir);

impl Folder {
    pub fn new() -> Self {
        Folder(tempfile::tempdir().unwrap())
    }

    /// One whose name starts so.
    pub fn named(start: &str) -> Self {
        Folder(tempfile::Builder::new().prefix(start).tempdir().unwrap())
    }

    pub fn inside(outer: &Path) -> Self {
        Folder(tempfile::tempdir_in(outer).unwrap())
    }

    pub fn of(files: &[(&str, &str)]) -> Self {
        let folder = Self::new();
        files.iter().for_each(|(name, text)| folder.write(name, text));
        folder
    }

    /// `None` where there is no device.
    pub fn with_device() -> Option<Self> {
        has_device().then(Self::new)
    }

    pub fn path(&self) -> &Path {
        self.0.path()
    }

    pub fn at(&self, name: &str) -> PathBuf {
        self.path().join(name)
    }

    pub fn names(&self) -> Vec<String> {
        names(self.path())
    }

    pub fn read(&self, name: &str) -> Vec<u8> {
        std::fs::read(self.at(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
    }

    pub fn write(&self, name: &str, content: impl AsRef<[u8]>) {
        std::fs::write(self.at(name), content).unwrap();
    }

    pub fn command(&self, line: &str) -> Command {
        command(self.path(), line)
    }

    pub fn bare(&self, line: &str) -> Command {
        bare(self.path(), line)
    }

    pub fn run(&self, line: &str) -> Ran {
        finish(&mut self.command(line))
    }

    /// Runs the program with the words of a line, which must succeed.
    #[track_caller]
    pub fn good(&self, line: &str) -> Ran {
        self.run(line).ended(0, &[])
    }

    pub fn json(&self, line: &str) -> Value {
        let ran = self.good(&format!("{line} --json"));
        serde_json::from_str(&ran.stdout).unwrap_or_else(|error| panic!("no JSON ({error}): {}", ran.stdout))
    }

    /// Sizes and times of all files, by which one that comes, goes or changes is told.
    fn state(&self) -> BTreeMap<String, Option<(u64, SystemTime)>> {
        let about = |name: &String| std::fs::metadata(self.at(name)).ok().map(|m| (m.len(), m.modified().unwrap()));
        self.names().into_iter().map(|name| (name.clone(), about(&name))).collect()
    }

    /// The command ends with `code` and one line, notes aside, that has all `parts`; no file comes, goes or changes.
    pub fn refuses(&self, command: &mut Command, code: i32, parts: &[&str]) {
        let before = self.state();
        let ran = finish(command);
        let lines: Vec<&str> = ran.stderr.lines().filter(|line| !line.starts_with("note: ")).collect();
        let [line] = lines[..] else { panic!("{command:?}: {} lines: {}", lines.len(), ran.stderr) };
        assert_eq!((ran.code, ran.stdout.as_str()), (code, ""), "{command:?}: {line}");
        assert!(line.starts_with("shadow-fields: "), "{line}");
        parts.iter().for_each(|part| assert!(line.contains(part), "{command:?}: no {part:?} in {line:?}"));
        assert!(self.state() == before, "{command:?}: a file came, went or changed");
    }

    pub fn refused(&self, line: &str, code: i32, parts: &[&str]) {
        self.refuses(&mut self.command(line), code, parts);
    }
}
