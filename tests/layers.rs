//! The shape of the source tree: who may use whom, where `unsafe` stands, how long files are, what is embedded.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// A module may use only modules that stand before it.
///
/// `field` stands before `shaders` because a shader's STRIDE is the stride of stored channels, and before `asset` and `bake`
/// because it is plain data; `scene_buffers` stands behind the passes because it keeps what each of them reads in its form.
const ORDER: &[&str] = &[
    "error",
    "files",
    "text",
    "sh",
    "layout",
    "gpu",
    "field",
    "shaders",
    "asset",
    "scene",
    "bake",
    "lists",
    "merge",
    "sharp",
    "draw",
    "scene_buffers",
    "frame",
    "renderer",
    "truth",
    "check",
    "bench",
    "farm",
    "view",
    "app",
    "prelude",
    "main",
];

/// The only modules that `gpu` may use: it knows nothing of what it is for.
const GPU_USES: &[&str] = &["error", "files"];

/// Lines that a file may have. A longer file stands in [`LONG_FILES`] with the reason.
const LINE_LIMIT: usize = 400;

/// Files over the limit, with the reason.
const LONG_FILES: &[(&str, &str)] = &[];

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn files(folder: &str, endings: &[&str]) -> Vec<PathBuf> {
    let mut out = Vec::new();
    let mut folders = vec![root().join(folder)];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display())) {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| endings.iter().any(|ending| e == *ending)) {
                out.push(path.strip_prefix(root()).unwrap().to_path_buf());
            }
        }
    }
    out.sort();
    assert!(!out.is_empty(), "nothing found in {folder}");
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

/// Names right behind `prefix`: one, or the first of each part of a braced list.
fn names_after(code: &str, prefix: &str) -> BTreeSet<String> {
    let mut names = BTreeSet::new();
    for (at, _) in code.match_indices(prefix) {
        if code[..at].chars().next_back().is_some_and(|c| is_word(c) || c == ':') {
            continue;
        }
        let rest = &code[at + prefix.len()..];
        let first = |part: &str| part.trim().chars().take_while(|c| is_word(*c)).collect::<String>();
        if let Some(list) = rest.strip_prefix('{') {
            let (mut depth, mut part) = (0, String::new());
            for c in list.chars() {
                match c {
                    '{' => depth += 1,
                    '}' if depth == 0 => break,
                    '}' => depth -= 1,
                    ',' if depth == 0 => {
                        names.insert(first(&std::mem::take(&mut part)));
                        continue;
                    }
                    _ => {}
                }
                part.push(c);
            }
            names.insert(first(&part));
        } else {
            names.insert(first(rest));
        }
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
    let mut seen = BTreeSet::new();
    for path in files("src", &["rs"]) {
        let (own, depth) = module(&path);
        // Binaries besides the program stand on top of the library; lib.rs lists the modules.
        if own == "bin" || own == "lib" {
            continue;
        }
        let place = ORDER.iter().position(|m| *m == own).unwrap_or_else(|| panic!("{}: no layer", path.display()));
        seen.insert(own.clone());
        let code = code(&text(&path));
        let mut used = names_after(&code, "crate::");
        let up = names_after(&code, &"super::".repeat(depth));
        used.extend(up.into_iter().filter(|name| ORDER.contains(&name.as_str())));
        if own == "main" {
            continue;
        }
        for name in used.iter().filter(|name| **name != own && ORDER.contains(&name.as_str())) {
            let other = ORDER.iter().position(|m| m == name).unwrap();
            assert!(other < place, "{} uses crate::{name}, which stands below {own}", path.display());
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

/// Files of one folder that use each other in a circle, with the reason. The test below keeps the list complete and short.
const CIRCLES: &[(&[&str], &str)] = &[(
    &["src/field/directions.rs", "src/field/lattice.rs"],
    "a lattice is its directions on shells, in two files of methods",
)];

/// Files beside `path` whose module it uses, not counting its tests.
fn siblings(path: &Path) -> BTreeSet<PathBuf> {
    let text = text(path);
    let body = text.split("\n#[cfg(test)]\nmod ").next().unwrap_or_default();
    let folder: Vec<_> =
        path.parent().into_iter().flat_map(|p| p.iter().skip(1)).map(|p| p.to_string_lossy()).collect();
    let mut names = names_after(&code(body), "super::");
    names.extend(names_after(&code(body), &format!("crate::{}::", folder.join("::"))));
    let files = names.into_iter().map(|name| path.with_file_name(format!("{name}.rs")));
    files.filter(|file| file != path && root().join(file).exists()).collect()
}

/// All files beside `path` that it uses, itself or through others.
fn reached(path: &Path) -> BTreeSet<PathBuf> {
    let mut found = BTreeSet::new();
    let mut open = vec![path.to_path_buf()];
    while let Some(next) = open.pop() {
        open.extend(siblings(&next).into_iter().filter(|file| found.insert(file.clone())));
    }
    found
}

#[test]
fn files_of_one_folder_do_not_use_each_other_in_circles() {
    let mut circles = BTreeSet::new();
    // `super` of a mod.rs is the folder above; its children may use it through its parent only.
    for path in files("src", &["rs"]).iter().filter(|path| !path.ends_with("mod.rs")) {
        let mut circle = reached(path);
        circle.retain(|other| other == path || reached(other).contains(path));
        if !circle.is_empty() {
            circles.insert(circle);
        }
    }
    let known: BTreeSet<BTreeSet<PathBuf>> =
        CIRCLES.iter().map(|(circle, _)| circle.iter().map(PathBuf::from).collect()).collect();
    assert_eq!(circles, known, "circles that stand (left) and circles that are known (right)");
}

#[test]
fn the_reader_of_paths_finds_what_is_there() {
    let source = "use crate::gpu::{Buffer, Device};\nuse crate::{field::{Lattice, Lookup}, scene};\n\
                  let x = crate::sh::basis; // crate::app\nmycrate::truth; \"http://frame\" // crate::frame";
    let found = names_after(&code(source), "crate::");
    assert_eq!(found.into_iter().collect::<Vec<_>>(), ["field", "gpu", "scene", "sh"]);
    assert_eq!(module(Path::new("src/gpu/mod.rs")), ("gpu".into(), 1));
    assert_eq!(module(Path::new("src/gpu/access.rs")), ("gpu".into(), 2));
    assert_eq!(module(Path::new("src/layout.rs")), ("layout".into(), 1));
}

#[test]
fn unsafe_code_is_in_gpu_only() {
    let mut in_gpu = 0;
    for path in files("src", &["rs"]) {
        let code = code(&text(&path));
        let count = code
            .match_indices("unsafe")
            .filter(|(at, word)| {
                let around = [code[..*at].chars().next_back(), code[at + word.len()..].chars().next()];
                !around.into_iter().flatten().any(is_word)
            })
            .count();
        if path.starts_with("src/gpu") {
            in_gpu += count;
        } else {
            assert_eq!(count, 0, "{} holds unsafe code", path.display());
        }
    }
    assert!(in_gpu > 10, "the search for unsafe code finds nothing");
}

#[test]
fn files_are_short() {
    let mut paths = files("src", &["rs"]);
    paths.extend(files("glsl", &["glsl", "comp", "vert", "frag"]));
    for path in &paths {
        let lines = text(path).lines().count();
        let listed = LONG_FILES.iter().any(|(name, _)| path == Path::new(name));
        assert!(lines <= LINE_LIMIT || listed, "{} has {lines} lines: split it, or give a reason here", path.display());
        assert!(lines > LINE_LIMIT || !listed, "{} is short now: take it off the list", path.display());
        // rustfmt wraps code, and leaves comments as they are.
        let comments = text(path).lines().filter(|line| line.trim_start().starts_with("//")).map(str::len).max();
        assert!(
            comments.is_none_or(|longest| longest <= 140),
            "{} has a comment of {comments:?} bytes",
            path.display()
        );
    }
    for (name, _) in LONG_FILES {
        assert!(paths.iter().any(|path| path == Path::new(name)), "{name} is gone: take it off the list");
    }
}

#[test]
fn every_shader_file_is_embedded() {
    let on_disk: BTreeSet<String> = files("glsl", &["glsl", "comp", "vert", "frag"])
        .iter()
        .map(|path| path.file_name().unwrap().to_string_lossy().into_owned())
        .collect();
    let embedded: BTreeSet<String> = shadow_fields::shaders::FILES.iter().map(|(name, _)| (*name).to_owned()).collect();
    assert_eq!(on_disk, embedded);
    let all = std::fs::read_dir(root().join("glsl")).unwrap().count();
    assert_eq!(all, on_disk.len(), "glsl/ holds files of an unknown kind");
}

/// Every pass by its one word, in the order of execution, and the Rust file that holds it. From the word follow its shaders
/// `glsl/WORD.*`, its struct, its timer and the debug name of its pipeline.
const PASSES: &[(&str, &str)] = &[
    ("capture", "src/bake/capture.rs"),
    ("project", "src/bake/project.rs"),
    ("self_visibility", "src/bake/self_visibility.rs"),
    ("assemble", "src/bake/assemble.rs"),
    ("silhouette", "src/bake/silhouette.rs"),
    ("gather", "src/lists/gather.rs"),
    ("merge", "src/merge/mod.rs"),
    ("sharp", "src/sharp/mod.rs"),
    ("draw", "src/draw/mod.rs"),
    ("smooth", "src/draw/smooth.rs"),
    ("show", "src/draw/show.rs"),
];

/// Timers of passes that copy and have no shader.
const COPIES: &[&str] = &["read back"];

/// Shaders that are no pass of their own: other parts of pass "draw", pass "capture" by computation, and what only benches run.
const OTHER_SHADERS: &[&str] = &["grid", "triangle", "raster", "product", "ceiling", "shadow_map"];

/// Folders whose files record passes for a test or a bench, outside the sequences.
const NO_SEQUENCE: &[&str] = &["src/bench", "src/check"];

/// Words that follow `prefix` up to the next quotation mark.
fn quoted_after(code: &str, prefix: &str) -> BTreeSet<String> {
    let quoted = |(at, _): (usize, _)| code[at + prefix.len()..].split('"').next().unwrap().to_owned();
    code.match_indices(prefix).map(quoted).collect()
}

#[test]
fn each_pass_is_found_by_one_word() {
    let of_check = shadow_fields::check::PASSES.map(|(pass, _)| pass);
    assert_eq!(PASSES.iter().map(|(pass, _)| *pass).collect::<Vec<_>>(), of_check, "check has a row for each pass");
    let shaders = files("glsl", &["comp", "vert", "frag"]);
    let stem = |path: &Path| path.file_stem().unwrap().to_string_lossy().into_owned();
    let in_sequence = |path: &PathBuf| !NO_SEQUENCE.iter().any(|folder| path.starts_with(folder));
    let timers: BTreeSet<String> = files("src", &["rs"])
        .iter()
        .filter(|path| in_sequence(path))
        .flat_map(|path| quoted_after(&code(&text(path)), ".pass(\""))
        .collect();
    for (word, file) in PASSES {
        let path = Path::new(file);
        let is_module = path.file_name().is_some_and(|name| name == "mod.rs");
        let named = if is_module { stem(path.parent().unwrap()) } else { stem(path) };
        assert_eq!(named, *word, "{file} is named by the word of its pass");
        let source = text(path);
        assert!(source.starts_with(&format!("//! Pass \"{word}\":")), "{file} begins with its pass");
        let code = code(&source);
        let type_name: String = word.split('_').map(|part| part[..1].to_uppercase() + &part[1..]).collect();
        assert!(code.contains(&format!("pub struct {type_name} {{")), "{file}: no struct {type_name}");
        let own: Vec<_> = shaders.iter().filter(|shader| stem(shader) == *word).collect();
        assert!(!own.is_empty(), "no shader glsl/{word}.*");
        // A pass in a folder of its own may choose its permutation in another file there.
        let beside =
            if is_module { files(path.parent().unwrap().to_str().unwrap(), &["rs"]) } else { vec![path.into()] };
        let named = format!("\"{word}\"");
        assert!(
            beside.iter().any(|path| text(path).contains(&named)),
            "{file}: no pipeline has the debug name {named}"
        );
        for shader in own {
            let name = format!("\"{}\"", shader.file_name().unwrap().to_string_lossy());
            assert!(beside.iter().any(|path| text(path).contains(&name)), "{file} does not use the shader {name}");
        }
        assert!(timers.contains(*word), "no sequence times pass \"{word}\"");
    }
    let is_pass = |word: &str| PASSES.iter().any(|(pass, _)| *pass == word);
    for timer in &timers {
        assert!(is_pass(timer) || COPIES.contains(&timer.as_str()), "timer \"{timer}\" is not of a pass in the table");
    }
    for shader in shaders.iter().map(|path| stem(path)) {
        assert!(is_pass(&shader) || OTHER_SHADERS.contains(&shader.as_str()), "glsl/{shader}.* is not of a pass");
    }
}

/// Files of the frame's rooms that hold barriers: the sequence, and passes of several steps between their own steps.
const BARRIERS: &[&str] = &["src/draw/mod.rs", "src/draw/smooth.rs", "src/frame/record.rs", "src/lists/gather.rs"];

#[test]
fn barriers_of_a_frame_stand_in_its_sequence() {
    let rooms =
        ["src/draw", "src/frame", "src/lists", "src/merge", "src/sharp", "src/scene_buffers", "src/view", "src/app"];
    let found: Vec<PathBuf> = rooms
        .iter()
        .flat_map(|room| files(room, &["rs"]))
        .filter(|path| code(&text(path)).contains("barrier("))
        .collect();
    let mut found: Vec<_> = found.iter().map(|path| path.to_str().unwrap()).collect();
    found.sort_unstable();
    assert_eq!(found, BARRIERS);
    let sequence = code(&text(Path::new("src/frame/record.rs")));
    for pass in ["gather", "merge", "sharp", "draw", "smooth", "read back", "show"] {
        assert!(sequence.contains(&format!(".pass(\"{pass}\"")), "the sequence does not record \"{pass}\"");
    }
}

/// A row whose line was rewritten would change nothing, and so say nothing of the test that is to find it.
#[test]
fn every_mutation_has_its_line() {
    let table = text(Path::new("scripts/mutations.tsv"));
    let rows = table.lines().filter(|line| !line.starts_with('#')).map(|line| line.split('\t').collect::<Vec<_>>());
    for row in rows {
        assert!((4..=5).contains(&row.len()), "{row:?}");
        let count = text(Path::new(row[0])).lines().filter(|line| line.contains(row[1])).count();
        assert_eq!(count, 1, "lines of {} with {:?}", row[0], row[1]);
    }
}
