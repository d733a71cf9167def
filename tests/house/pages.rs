//! The pages name keys of scene files, commands and paths that exist.

use crate::root;
use shadow_fields::scene::Data;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::process::Command;

/// The pages that a reader meets first.
const PAGES: [&str; 5] = ["README.md", "docs/scene.md", "docs/measured.md", "docs/ci.md", "docs/farm.md"];
/// Folders at the top; what starts with one of them is a path.
const FOLDERS: [&str; 7] = ["docs/", "src/", "glsl/", "assets/", "scripts/", "tests/", "examples/"];

fn page(name: &str) -> String {
    std::fs::read_to_string(root().join(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
}

/// Everything in backquotes, and every line of code.
fn code(page: &str) -> Vec<String> {
    let mut out: Vec<String> = page.lines().filter_map(|line| line.strip_prefix("    ")).map(str::to_owned).collect();
    let text = page.lines().filter(|line| !line.starts_with("    "));
    out.extend(text.flat_map(|line| line.split('`').skip(1).step_by(2)).map(str::to_owned));
    out
}

/// Standard output of the program, which must succeed.
fn printed(arguments: &[&str]) -> String {
    let output = Command::new(env!("CARGO_BIN_EXE_shadow-fields")).args(arguments).output().unwrap();
    assert!(output.status.success(), "shadow-fields {arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// The subcommands that a help text lists.
fn subcommands(help: &str) -> BTreeSet<String> {
    let listed = help.split("Commands:\n").nth(1).unwrap_or("");
    let lines = listed.lines().take_while(|line| !line.is_empty());
    let names = lines.filter_map(|line| line.strip_prefix("  ")?.split(' ').next());
    names.filter(|name| !name.is_empty()).map(str::to_owned).collect()
}

/// Keys that a scene file may have where `text` has the unknown key `zzz`: the reader lists them in its complaint.
fn keys_at(text: &str) -> BTreeSet<String> {
    let error = Data::parse(text, Path::new("keys.toml")).unwrap_err().to_string();
    // serde: "unknown field `zzz`, expected one of `a`, `b`"; toml: "... in table: zzz, available keys: a, b".
    let keys: BTreeSet<String> = match error.split_once("available keys: ") {
        Some((_, listed)) => listed.split(", ").map(|key| key.trim().to_owned()).collect(),
        None => error.split("expected").last().unwrap().split('`').skip(1).step_by(2).map(str::to_owned).collect(),
    };
    assert!(!keys.is_empty(), "{text:?} gives {error:?}");
    keys
}

/// Every key of every table of a scene file, inner tables included, by the table's name.
fn keys_that_are_read() -> BTreeMap<String, BTreeSet<String>> {
    let mut tables = BTreeMap::<String, BTreeSet<String>>::new();
    let mut add = |table: &str, text: &str| {
        let keys = keys_at(text);
        tables.entry(table.to_owned()).or_default().extend(keys.clone());
        keys
    };
    add("[camera]", "[camera]\nzzz = 1");
    add("[output]", "[output]\nzzz = 1");
    add("[[texture]]", "[[texture]]\nzzz = 1");
    add("[environment]", "[environment]\nzzz = 1");
    for part in ["gradient", "key", "sun", "sky", "image"] {
        add("[environment]", &format!("[environment]\n{part} = {{ zzz = 1 }}"));
    }
    for generator in add("[[mesh]]", "[[mesh]]\nname = 'a'\nzzz = 1") {
        add("[[mesh]]", &format!("[[mesh]]\nname = 'a'\n{generator} = {{ zzz = 1 }}"));
    }
    add("[[entity]]", "[[entity]]\nzzz = 1");
    add("[[entity]]", "[[entity]]\nrotation = { zzz = 1 }");
    for part in ["spot", "gloss", "maps"] {
        add("[[entity]]", &format!("[[entity]]\n{part} = {{ zzz = 1 }}"));
    }
    for movement in add("[[entity]]", "[[entity]]\nmotion = [{ zzz = {} }]") {
        add("[[entity]]", &format!("[[entity]]\nmotion = [{{ {movement} = {{ zzz = 1 }} }}]"));
    }
    add("[[entity]]", "[[entity]]\nmotion = [{ keyframes = { keys = [{ zzz = 1 }] } }]");
    for part in ["position", "rotation", "scale"] {
        add("[[entity]]", &format!("[[entity]]\nmotion = [{{ node = {{ {part}_keys = {{ zzz = 1 }} }} }}]"));
    }
    // These are read by hand; the complaint lists only generators.
    let of_meshes = ["name", "file", "part", "piece", "bend", "pose", "joined"].map(str::to_owned);
    tables.get_mut("[[mesh]]").unwrap().extend(of_meshes);
    tables
}

#[test]
fn the_page_of_scenes_lists_every_key_and_no_other() {
    let scenes = page("docs/scene.md");
    let table = scenes.split("| table | keys |").nth(1).expect("a table of keys");
    let mut listed = BTreeMap::<String, BTreeSet<String>>::new();
    let mut name = String::new();
    for row in table.lines().skip(2).take_while(|line| line.starts_with('|')) {
        let cells: Vec<&str> = row.trim_matches('|').split(" | ").map(str::trim).collect();
        if !cells[0].trim_matches(['|', ' ']).is_empty() {
            name = cells[0].replace('`', "");
        }
        let words = cells[1..3].iter().flat_map(|cell| cell.split('`').skip(1).step_by(2));
        let keys = words.filter(|word| {
            let begins = word.starts_with(|c: char| c.is_ascii_lowercase());
            begins && word.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_')
        });
        let keys = keys.filter(|word| !["true", "false"].contains(word)).map(str::to_owned);
        listed.entry(name.clone()).or_default().extend(keys);
    }
    assert_eq!(listed, keys_that_are_read());
    let tables: BTreeSet<String> = listed.keys().map(|table| table.replace(['[', ']'], "")).collect();
    assert_eq!(tables, keys_at("zzz = 1"));
}

#[test]
fn every_command_that_the_pages_name_exists() {
    let commands = subcommands(&printed(&["--help"]));
    assert!(commands.contains("render") && commands.contains("bench"), "{commands:?}");
    let mut helps = BTreeMap::new();
    for command in commands.iter().filter(|command| *command != "help") {
        let help = printed(&[command, "--help"]);
        for inner in subcommands(&help).iter().filter(|inner| *inner != "help") {
            helps.insert(format!("{command} {inner}"), printed(&[command, inner, "--help"]));
        }
        helps.insert(command.clone(), help);
    }
    let all: String = helps.values().cloned().collect();
    let has = |help: &str, option: &str| help.split([' ', '\n', ',', '.', ')']).any(|word| word == option);
    let mut seen = 0;
    for name in PAGES {
        for line in code(&page(name)).iter().flat_map(|line| line.split(" && ")) {
            let own = line.strip_prefix("shadow-fields ");
            let words: Vec<&str> = own.unwrap_or(line).split(' ').take_while(|word| !word.starts_with('#')).collect();
            if words[0] == "view" && !cfg!(feature = "view") {
                continue;
            }
            let two = words.get(..2).map(|two| two.join(" ")).filter(|two| helps.contains_key(two));
            let help = two.as_ref().or(Some(&words[0].to_owned())).and_then(|command| helps.get(command));
            assert!(own.is_none() || help.is_some(), "{name}: there is no command {line:?}");
            if words[0] == "bench" && words.len() > 1 && !words[1].starts_with('-') {
                assert!(two.is_some(), "{name}: there is no {line:?}");
            }
            seen += usize::from(help.is_some());
            if help.is_some() || line.starts_with("--") {
                for option in words.iter().filter(|word| word.starts_with("--")) {
                    assert!(has(help.unwrap_or(&all), option), "{name}: {line:?} has no option {option}");
                }
            }
        }
    }
    assert!(seen > 10, "only {seen} commands were found");
}

#[test]
fn every_path_that_the_pages_name_exists() {
    let mut seen = 0;
    for name in PAGES {
        let text = page(name);
        let links = text.split("](").skip(1).filter_map(|rest| rest.split(')').next()).map(str::to_owned);
        let words = code(&text).into_iter().flat_map(|line| line.split(' ').map(str::to_owned).collect::<Vec<_>>());
        for path in links.chain(words).filter(|path| FOLDERS.iter().any(|folder| path.starts_with(folder))) {
            assert!(root().join(&path).exists(), "{name} names {path}");
            seen += 1;
        }
    }
    assert!(seen > 10, "only {seen} paths were found");
}
