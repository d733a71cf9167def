//! What the library brings with it: without the program's features no crate that only a program needs.

use std::collections::BTreeSet;
use std::process::Command;

/// Crates of the program, by what they are: argument parser, progress bar, log output, plots, lettering; and of the
/// window.
const PROGRAM: [&str; 6] = ["clap", "clap_builder", "indicatif", "env_logger", "colorous", "font8x8"];
const WINDOW: [&str; 4] = ["winit", "egui", "ash-window", "raw-window-handle"];

/// Names of all crates that a build of the library with these features links, the library's own left out.
fn crates(features: &[&str]) -> BTreeSet<String> {
    let mut command = Command::new(env!("CARGO"));
    command.args(["tree", "--edges", "normal", "--prefix", "none", "--locked"]).args(features);
    let output = command.current_dir(env!("CARGO_MANIFEST_DIR")).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8(output.stdout).unwrap();
    text.lines().filter_map(|line| line.split(' ').next()).map(str::to_owned).collect()
}

#[test]
fn the_library_alone_has_no_crate_of_the_program_or_the_window() {
    let has = |all: &BTreeSet<String>, name: &&str| all.contains(*name);
    let (alone, program, all) =
        (crates(&["--no-default-features"]), crates(&["--no-default-features", "--features", "cli"]), crates(&[]));
    for name in PROGRAM.iter().chain(&WINDOW) {
        assert!(!has(&alone, name), "the library alone brings {name}");
        assert!(has(&all, name), "{name} is gone: take it off the list");
    }
    assert!(PROGRAM.iter().all(|name| has(&program, name)) && !WINDOW.iter().any(|name| has(&program, name)));
    assert!(alone.contains("ash") && alone.len() < program.len() && program.len() < all.len());
}
