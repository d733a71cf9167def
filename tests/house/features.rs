//! What the library brings with it: without the program's features no crate that only a program needs.

use std::collections::BTreeSet;
use std::process::Command;

/// Crates of the program (argument parser, progress bar, log output, plots, lettering) and of the window.
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
    let [alone, program, all] =
        [&["--no-default-features"][..], &["--no-default-features", "--features", "cli"], &[]].map(crates);
    for (names, in_program) in [(&PROGRAM[..], true), (&WINDOW, false)] {
        for name in names {
            let found = [&alone, &program, &all].map(|crates| crates.contains(*name));
            assert_eq!(found, [false, in_program, true], "{name}: the library alone, the program, all");
        }
    }
    assert!(alone.contains("ash"));
}
