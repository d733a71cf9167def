//! `scripts/package`: the archive, unpacked into an empty folder, renders; and it holds what it should.

mod common;

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn text(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

fn good(command: &mut Command) -> Output {
    let output = command.output().unwrap();
    assert!(output.status.success(), "{command:?}: {}", String::from_utf8_lossy(&output.stderr));
    output
}

/// The package of the binary that is tested, unpacked.
fn unpacked(folder: &Path) -> PathBuf {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("scripts/package");
    let archive = folder.join("package.tar.gz");
    good(Command::new(script).args(["--binary", env!("CARGO_BIN_EXE_shadow-fields"), "--out"]).arg(&archive));
    good(Command::new("tar").arg("-xzf").arg(&archive).current_dir(folder));
    std::fs::remove_file(archive).unwrap();
    let entries: Vec<_> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    assert_eq!(entries.len(), 1, "one folder: {entries:?}");
    entries[0].clone()
}

#[test]
fn a_package_runs_where_it_is_unpacked() {
    let folder = tempfile::tempdir().unwrap();
    let package = unpacked(folder.path());
    let share = package.join("share");

    // Manual pages and completions of every command.
    let help = good(Command::new(package.join("bin/shadow-fields")).arg("--help"));
    let help = String::from_utf8(help.stdout).unwrap();
    let commands = help.split("Commands:\n").nth(1).unwrap().lines().take_while(|line| !line.is_empty());
    let names = commands.filter_map(|line| line.strip_prefix("  ")?.split(' ').next().filter(|name| !name.is_empty()));
    let names: Vec<&str> = names.filter(|name| *name != "help").collect();
    assert!(names.len() >= 10, "{names:?}");
    let completions = [
        "bash-completion/completions/shadow-fields",
        "zsh/site-functions/_shadow-fields",
        "fish/vendor_completions.d/shadow-fields.fish",
    ];
    for name in &names {
        let page = text(&share.join(format!("man/man1/shadow-fields-{name}.1")));
        assert!(page.contains(".SH SYNOPSIS") && page.contains("cache\\-dir"), "{name}: {page}");
        for file in completions {
            assert!(text(&share.join(file)).contains(name), "{file} does not know {name}");
        }
    }
    assert!(text(&share.join("man/man1/shadow-fields.1")).contains("Precomputed shadow fields"));
    if Command::new("bash").arg("--version").output().is_ok() {
        good(Command::new("bash").arg("-n").arg(share.join(completions[0])));
    }

    // Licences of what is linked, with their texts.
    let licences = text(&share.join("doc/shadow-fields/LICENCES.txt"));
    for part in
        ["==== ash ", "==== glam ", "==== winit ", "==== clap ", "Permission is hereby granted", "Apache License"]
    {
        assert!(licences.contains(part), "no {part:?}");
    }
    // Each block has a text: a copyright line, or a standard licence that needs none.
    for block in licences.split("\n==== ").skip(1) {
        let (head, text) = block.split_once('\n').unwrap();
        let is_text = text.starts_with("---- ") || head.ends_with("(Debian)");
        assert!(is_text && text.len() > 200 && !text.contains("[name of crate]"), "{head}: {text}");
    }
    let mit = licences
        .split("==== pulp-wasm-simd-flag ")
        .nth(1)
        .expect("a crate with no text of its own")
        .split("\n====")
        .next();
    assert!(mit.unwrap().contains("Copyright (c) sarah qui"), "its authors: {mit:?}");
    assert!(!licences.contains("==== proptest"), "a crate of tests is not linked");
    for file in ["README.md", "CHANGELOG.md", "LICENSE-MIT", "LICENSE-APACHE"] {
        assert!(share.join("doc/shadow-fields").join(file).exists(), "{file}");
    }

    // Each example scene is there with its meshes.
    let scenes = std::fs::read_dir(share.join("shadow-fields/scenes")).unwrap().map(|entry| entry.unwrap().path());
    let scenes: Vec<_> = scenes.map(|path| shadow_fields::scene::Scene::load(&path).unwrap()).collect();
    assert!(scenes.len() >= 6, "{} scenes", scenes.len());

    if let Err(error) = common::open() {
        return common::skip(&error.to_string());
    }
    let mut render = Command::new(package.join("bin/shadow-fields"));
    render.current_dir(&package).args(["render", "share/shadow-fields/scenes/sphere_over_plane.toml", "-o", "p.png"]);
    render.args(["--quality", "draft", "--size", "96x64", "--cache-dir", "cache"]);
    good(&mut render);
    let picture = shadow_fields::asset::decode::Picture::read(&package.join("p.png")).unwrap();
    let (low, high) = picture.rgb.iter().fold((1.0_f32, 0.0_f32), |(low, high), c| (low.min(*c), high.max(*c)));
    assert!((picture.width, picture.height) == (96, 64) && high - low > 0.3, "from {low} to {high}");
}
