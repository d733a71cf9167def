//! The examples, as a new user meets them: each builds in a project that is empty but for it and depends on the library
//! by path, and runs under the validation layer. The wgpu one is such a project in itself.

mod common;

use shadow_fields::asset::decode::Picture;
use std::path::{Path, PathBuf};
use std::process::Command;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn read(path: impl AsRef<Path>) -> String {
    let path = root().join(path);
    std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// The folder that the library's own tests compile into, so that nothing is compiled again.
fn target() -> &'static Path {
    Path::new(env!("CARGO_TARGET_TMPDIR")).parent().unwrap()
}

/// Builds the programs of a package and returns the folder that they lie in.
fn build(package: &Path) -> PathBuf {
    let mut cargo = Command::new(env!("CARGO"));
    cargo.args(["build", "--quiet", "--color", "never"]).current_dir(package).env("CARGO_TARGET_DIR", target());
    // What scripts/setup tells this repository's own builds by .cargo/config.toml.
    let shaderc = root().join(".build/shaderc");
    if std::env::var_os("SHADERC_LIB_DIR").is_none() && shaderc.exists() {
        cargo.env("SHADERC_LIB_DIR", shaderc);
    }
    let output = cargo.output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && !said.contains("warning"), "{}: {said}", package.display());
    target().join("debug")
}

/// Runs a program under the validation layer with synchronisation checks, and returns what it prints.
fn run(program: &Path, arguments: &[&str], folder: &Path) -> String {
    let mut command = Command::new(program);
    command.args(arguments).current_dir(folder).env("XDG_CACHE_HOME", common::cache_dir());
    command.env("VK_INSTANCE_LAYERS", "VK_LAYER_KHRONOS_validation").env("VK_LOADER_DEBUG", "layer");
    command.env("VK_LAYER_ENABLES", "VK_VALIDATION_FEATURE_ENABLE_SYNCHRONIZATION_VALIDATION_EXT");
    let output = command.output().unwrap();
    let out = String::from_utf8_lossy(&output.stdout);
    let log = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{}: {out}{log}", program.display());
    assert!(log.contains("Insert instance layer \"VK_LAYER_KHRONOS_validation\""), "the layer is not there: {log}");
    for said in [&out, &log] {
        assert!(!["VUID-", "SYNC-HAZARD", "Validation Error"].iter().any(|word| said.contains(word)), "{said}");
    }
    common::report(out.trim());
    out.into_owned()
}

#[test]
fn examples_build_from_an_empty_project_and_run() {
    if let Err(error) = common::open() {
        return common::skip(&error.to_string());
    }
    let folder = tempfile::tempdir().unwrap();
    let names = ["picture", "own_device", "export"];
    std::fs::create_dir_all(folder.path().join("src/bin")).unwrap();
    for name in names {
        std::fs::copy(root().join(format!("examples/{name}.rs")), folder.path().join(format!("src/bin/{name}.rs")))
            .unwrap();
    }
    // The versions and the profile that the library is tested with, so that nothing is compiled twice.
    let profile = read("examples/wgpu/Cargo.toml").split_once("[profile.dev]").unwrap().1.to_owned();
    let profile: Vec<&str> = profile.lines().take_while(|line| !line.starts_with("# And what only wgpu")).collect();
    let manifest = format!(
        "[package]\nname = \"empty\"\nversion = \"0.1.0\"\nedition = \"2024\"\n[dependencies]\n\
         shadow-fields = {{ path = {:?}, default-features = false }}\n[profile.dev]{}\n",
        root(),
        profile.join("\n")
    );
    std::fs::write(folder.path().join("Cargo.toml"), manifest).unwrap();
    std::fs::write(folder.path().join("Cargo.lock"), read("Cargo.lock")).unwrap();
    let programs = build(folder.path());

    let lines = run(&programs.join("own_device"), &[], folder.path());
    let is_step = |line: &&str| line.starts_with("step ") && line.contains(" vertices, ");
    assert_eq!(lines.lines().filter(is_step).count(), 3, "{lines}");

    run(&programs.join("picture"), &["p.png"], folder.path());
    let picture = Picture::read(&folder.path().join("p.png")).unwrap();
    let light = |x: usize, y: usize| picture.rgb[3 * (y * 480 + x)..][..3].iter().sum::<f32>();
    assert_eq!((picture.width, picture.height), (480, 320));
    assert!(light(235, 190) < 0.85 * light(360, 210), "the ring's shadow: {} {}", light(235, 190), light(360, 210));

    run(&programs.join("export"), &["torus_over_plane", "light.glb"], folder.path());
    let model = gltf::Gltf::open(folder.path().join("light.glb")).unwrap();
    let names: Vec<_> = model.nodes().map(|node| node.name().unwrap().to_owned()).collect();
    assert_eq!(names, ["floor", "torus", "light"]);
    for mesh in model.meshes() {
        let primitive = mesh.primitives().next().unwrap();
        let colors = primitive.get(&gltf::Semantic::Colors(0)).unwrap();
        assert_eq!(colors.count(), primitive.get(&gltf::Semantic::Positions).unwrap().count());
        let first = colors.view().unwrap().offset();
        let bytes = &model.blob.as_ref().unwrap()[first..first + 12 * colors.count()];
        let colors: Vec<f32> = bytes.chunks(4).map(|word| f32::from_le_bytes(word.try_into().unwrap())).collect();
        let green = || colors.chunks(3).map(|c| c[1]);
        let dark = green().fold(f32::MAX, f32::min);
        let bright = green().fold(0.0, f32::max);
        assert!(dark >= 0.0 && bright.is_finite() && bright > 0.05 && dark < 0.7 * bright, "{dark} to {bright}");
        let transfers = primitive.attributes().filter(|(name, _)| name.to_string().contains("TRANSFER")).count();
        assert_eq!(transfers, 3, "nine coefficients of three bands");
    }
}

#[test]
fn a_wgpu_program_shares_its_device() {
    if let Err(error) = common::open() {
        return common::skip(&error.to_string());
    }
    let folder = tempfile::tempdir().unwrap();
    let programs = build(&root().join("examples/wgpu"));
    let line = run(&programs.join("shadow-fields-wgpu"), &["w.png"], folder.path());
    assert!(line.contains("by at most 0 of 255") || line.contains("by at most 1 of 255"), "{line}");
    assert!(Picture::read(&folder.path().join("w.png")).is_ok());
}
