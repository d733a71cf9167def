//! The shape of the source tree: which module may use which.

use crate::common::paths_below;
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

/// All files of Rust below `src/`.
fn files() -> impl Iterator<Item = PathBuf> {
    let paths = paths_below(&root().join("src")).into_iter();
    let rust = paths.filter(|path| path.extension().is_some_and(|ending| ending == "rs"));
    rust.map(|path| path.strip_prefix(root()).unwrap().to_path_buf())
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
fn names_after<'c>(code: &'c str, prefix: &'c str) -> impl Iterator<Item = &'c str> {
    let is_whole = |(at, _): &(usize, &str)| !code[..*at].ends_with(|c: char| is_word(c) || c == ':');
    code.match_indices(prefix).filter(is_whole).map(move |(at, _)| {
        let rest = &code[at + prefix.len()..];
        assert!(!rest.starts_with('{'), "{prefix}{}: modules are used one a line", rest.lines().next().unwrap_or(""));
        rest.split(|c: char| !is_word(c)).next().unwrap_or("")
    })
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
        let code = code(&text(&path));
        let up = "super::".repeat(depth);
        for name in names_after(&code, "crate::").chain(names_after(&code, &up)).filter(|name| *name != own) {
            let Some(other) = place(name) else { continue };
            assert!(other < own_place, "{} uses crate::{name}, which stands below {own}", path.display());
            let is_known = own != "gpu" || GPU_USES.contains(&name);
            assert!(is_known, "{} uses crate::{name}: gpu knows nothing of it", path.display());
        }
        seen.insert(own);
    }
    assert_eq!(seen.len(), order.len(), "only files of these modules were read: {seen:?}");
}
