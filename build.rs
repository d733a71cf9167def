//! Records the source revision for result files, lists the shaders and scenes to embed, and refuses to build where no
//! shader compiler can be linked.

use std::path::{Path, PathBuf};
use std::process::Command;

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    record_revision();
    list_files("shaders", "include_str", "glsl", &[""]);
    list_files("assets", "include_bytes", "assets", &["meshes/", "scenes/"]);
    check_shaderc();
}

/// Builds without git or outside a checkout say "unknown".
fn record_revision() {
    let git = |arguments: &[&str]| output("git", arguments);
    let revision = git(&["rev-parse", "--short=12", "HEAD"]).unwrap_or_else(|| "unknown".into());
    println!("cargo::rustc-env=SHADOW_FIELDS_REVISION={revision}");
    if let Some(head) = git(&["rev-parse", "--git-path", "HEAD"]) {
        println!("cargo::rerun-if-changed={head}");
    }
    // The branch that HEAD names moves with every commit.
    if let Some(branch) = git(&["symbolic-ref", "-q", "HEAD"])
        && let Some(path) = git(&["rev-parse", "--git-path", &branch])
        && Path::new(&path).exists()
    {
        println!("cargo::rerun-if-changed={path}");
    }
}

/// Writes a table of files to embed, TABLE.rs: the name below `root` and the content of each, in the order of names.
fn list_files(table: &str, content: &str, root: &str, folders: &[&str]) {
    println!("cargo::rerun-if-changed={root}");
    let mut names = Vec::new();
    for folder in folders {
        let entries = std::fs::read_dir(Path::new(root).join(folder)).expect("a folder of files to embed can be read");
        names.extend(entries.flatten().map(|entry| format!("{folder}{}", entry.file_name().display())));
    }
    names.retain(|name| [".comp", ".vert", ".frag", ".glsl", ".obj", ".toml"].iter().any(|kind| name.ends_with(kind)));
    names.sort();
    let row = |name| format!("(\"{name}\", {content}!(concat!(env!(\"CARGO_MANIFEST_DIR\"), \"/{root}/{name}\"))),\n");
    let rows = names.iter().map(row).collect::<String>();
    let to = std::env::var_os("OUT_DIR").expect("cargo names a folder for what is generated");
    std::fs::write(Path::new(&to).join(format!("{table}.rs")), format!("&[\n{rows}]"))
        .expect("the table can be written");
}

/// A combined archive has several times as many bytes; Debian's has a fifth.
const COMBINED_BYTES: u64 = 1 << 20;

/// The shaderc crate links libshaderc_combined.a alone. Debian's holds only a part and would end in pages of undefined
/// symbols, and without the library the crate compiles its own copy, which takes 12 minutes on two cores and cmake.
/// Where the build cannot end well, one line says what to run.
fn check_shaderc() {
    println!("cargo::rerun-if-env-changed=SHADERC_LIB_DIR");
    println!("cargo::rerun-if-env-changed=VULKAN_SDK");
    let named = ["SHADERC_LIB_DIR", "VULKAN_SDK"].iter().any(|name| std::env::var_os(name).is_some());
    if named || std::env::var("CARGO_CFG_TARGET_OS").as_deref() != Ok("linux") {
        return;
    }
    let bytes = archive("shaderc_combined").and_then(|path| Some(std::fs::metadata(path).ok()?.len()));
    let ends_well = match bytes {
        Some(bytes) => bytes >= COMBINED_BYTES,
        None => output("cmake", &["--version"]).is_some() || output("pkg-config", &["--exists", "shaderc"]).is_some(),
    };
    if !ends_well {
        // A program that depends on this crate by its path does not read this folder's .cargo/config.toml.
        let here = std::env::var("CARGO_MANIFEST_DIR").unwrap_or_else(|_| ".".into());
        println!(
            "cargo::error=no whole shader compiler (libshaderc) is here; run {here}/scripts/setup, and to build another program \
             set SHADERC_LIB_DIR={here}/.build/shaderc"
        );
    }
}

/// A static library where the compiler finds it.
fn archive(name: &str) -> Option<PathBuf> {
    let file = format!("lib{name}.a");
    let path = output("cc", &[&format!("-print-file-name={file}")]).filter(|path| *path != file)?;
    std::fs::canonicalize(path).ok()
}

/// What a command prints, if it succeeds.
fn output(program: &str, arguments: &[&str]) -> Option<String> {
    let output = Command::new(program).args(arguments).output().ok().filter(|o| o.status.success())?;
    Some(String::from_utf8_lossy(&output.stdout).trim().to_owned())
}
