//! The shape of the source tree: which module may use which.

use crate::root;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Modules in the order of the table in `lib.rs`. A module may use only modules that stand before it.
///
/// `field` stands before `shaders` because a shader's STRIDE is the stride of stored channels, and before `asset` and
/// `bake` because it is plain data; `scene_buffers` stands behind the passes because it keeps what each of them reads
/// in its form.
fn order() -> Vec<String> {
    let table = text(Path::new("src/lib.rs"));
    let rows = table.lines().filter_map(|line| line.strip_prefix("//! | ")?.split(" | ").next());
    let names = rows.flat_map(|cell| cell.split('`').skip(1).step_by(2)).chain(["prelude", "main"]);
    names.map(str::to_owned).collect()
}

/// The only modules that `gpu` may use: it knows nothing of what it is for.
const GPU_USES: &[&str] = &["error", "files"];

/// All files of Rust.
fn files() -> Vec<PathBuf> {
    let mut out = Vec::new();
    let mut folders = vec![root().join("src")];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display())) {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|ending| ending == "rs") {
                out.push(path.strip_prefix(root()).unwrap().to_path_buf());
            }
        }
    }
    out.sort();
    out
}

fn text(path: &Path) -> String {
    std::fs::read_to_string(root().join(path)).unwrap()
}

/// The text without what stands behind `//` outside a string.
fn code(text: &str) -> String {
    let strip = |line: &str| {
        let cut = line.match_indices("//").find(|(at, _)| line[..*at].matches('"').count().is_multiple_of(2));
        cut.map_or(line, |(at, _)| &line[..at]).to_owned()
    };
    text.lines().map(strip).collect::<Vec<_>>().join("\n")
}

fn is_word(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}

/// Names right behind `prefix`.
fn names_after(code: &str, prefix: &str) -> BTreeSet<String> {
    let mut names = BTreeSet::new();
    for (at, _) in code.match_indices(prefix) {
        if code[..at].chars().next_back().is_some_and(|c| is_word(c) || c == ':') {
            continue;
        }
        let rest = &code[at + prefix.len()..];
        assert!(!rest.starts_with('{'), "{prefix}{}: modules are used one a line", rest.lines().next().unwrap_or(""));
        names.insert(rest.chars().take_while(|c| is_word(*c)).collect());
    }
    names.remove("");
    names
}

/// The module below `src/` that a file belongs to, and how many `super` lead from it to the crate.
fn module(path: &Path) -> (String, usize) {
    let parts: Vec<_> = path.iter().skip(1).map(|p| p.to_string_lossy().into_owned()).collect();
    let depth = parts.len() - usize::from(parts.last().is_some_and(|file| file == "mod.rs"));
    (parts[0].trim_end_matches(".rs").to_owned(), depth)
}

#[test]
fn modules_use_only_what_stands_above_them() {
    let order = order();
    let place = |name: &str| order.iter().position(|module| module == name);
    let mut seen = BTreeSet::new();
    for path in files() {
        let (own, depth) = module(&path);
        // Binaries besides the program stand on top of the library; lib.rs lists the modules.
        if own == "bin" || own == "lib" {
            continue;
        }
        let own_place = place(&own).unwrap_or_else(|| panic!("{}: no layer", path.display()));
        seen.insert(own.clone());
        let code = code(&text(&path));
        let mut used = names_after(&code, "crate::");
        let up = names_after(&code, &"super::".repeat(depth));
        used.extend(up);
        if own == "main" {
            continue;
        }
        for name in used.iter().filter(|name| **name != own) {
            let Some(other) = place(name) else { continue };
            assert!(other < own_place, "{} uses crate::{name}, which stands below {own}", path.display());
            assert!(
                own != "gpu" || GPU_USES.contains(&name.as_str()),
                "{} uses crate::{name}: gpu knows nothing of it",
                path.display()
            );
        }
    }
    for needed in ["sh", "gpu", "field", "bake", "shaders"] {
        assert!(seen.contains(needed), "no file of {needed} was read");
    }
}
