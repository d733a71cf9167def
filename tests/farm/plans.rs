//! What is refused before any work is done: other programs, devices and inputs, and works and options that make no plan.

use super::{DRAFT, Farm, has_device};
use serde_json::{Value, json};

#[test]
fn other_programs_devices_and_inputs_are_refused_with_both_names() {
    if !has_device() {
        return;
    }
    let farm = Farm::new();
    farm.plan(1);
    let good = farm.read("p.json");
    let refused = |edit: &dyn Fn(&mut Value)| {
        let mut plan = good.clone();
        edit(&mut plan);
        farm.write(&plan);
        let ran = farm.run(&["farm", "run", "p.json", "--slice", "0", "-q"]);
        assert!(farm.results().is_empty());
        (ran.code, ran.stderr)
    };
    let (code, said) = refused(&|plan| plan["program"] = "shadow-fields 0.0.1 0123456".into());
    assert!(code == 3 && said.contains("a plan of shadow-fields 0.0.1 0123456, and this is shadow-fields "), "{said}");
    let (code, said) = refused(&|plan| plan["inputs"][0]["hash"] = "00".into());
    assert!(code == 4 && said.contains("a.obj: it has changed since the plan was made"), "{said}");
    let (code, said) = refused(&|plan| plan["slices"] = json!([]));
    assert!(code == 4 && said.contains("p.json: it has no slices"), "{said}");
    let (code, said) = refused(&|plan| plan["device"]["driver"] = "llvmpipe, Mesa 1.2".into());
    assert!(code == 3 && said.contains("Mesa 1.2), and this device is "), "{said}");
    // An engine says the same, and tries it once.
    let ran = farm.run(&["farm", "submit", "p.json", "--engine", "local", "-v"]);
    assert!(ran.code == 1 && ran.stderr.contains("and this device is"), "{}", ran.stderr);
    assert!(ran.stderr.contains("slice 0, try 1") && !ran.stderr.contains("try 2"), "{}", ran.stderr);
}

/// A plan whose parts do not make up a bake is not whole, though every slice has its result.
#[test]
fn parts_that_no_slice_has_are_told() {
    if !has_device() {
        return;
    }
    let farm = Farm::new();
    farm.plan(2);
    let mut plan = farm.read("p.json");
    plan["tasks"] = json!([plan["tasks"][0]]);
    plan["slices"] = json!([plan["slices"][0]]);
    farm.write(&plan);
    farm.good(&["farm", "run", "p.json", "--slice", "0"]);
    let ran = farm.run(&["farm", "collect", "p.json", "--into", "cache"]);
    assert!(ran.code == 4 && ran.stderr.contains("1 bakes have parts that are in no slice"), "{}", ran.stderr);
}

#[test]
fn works_and_options_that_make_no_plan_are_refused_in_a_line() {
    if !has_device() {
        return;
    }
    let farm = Farm::new();
    std::fs::create_dir(farm.path("other")).unwrap();
    std::fs::copy(farm.path("film.toml"), farm.path("other/film.toml")).unwrap();
    std::fs::write(farm.path("notes.txt"), "").unwrap();
    let film = |words: &[&'static str]| [&["film.toml", "--frames", "2"][..], words].concat();
    for (words, code, what) in [
        (vec!["nothing"], 4, "nothing: cannot be read: No such file"),
        (vec!["notes.txt"], 4, "notes.txt: expected a folder, a mesh"),
        (vec!["other"], 4, "other: a folder without meshes"),
        (vec!["film.toml"], 2, "film.toml: a scene needs --frames and --pictures"),
        (vec!["meshes", "--frames", "2", "--pictures", "o_#.png"], 2, "are for scenes, and there is none"),
        (film(&["--pictures", "o.png"]), 2, "--pictures o.png: the name needs a run of #"),
        (film(&["--pictures", "o_#.exr"]), 2, "o_#.exr: the name of this picture must end in .png"),
        (film(&["other/film.toml", "--pictures", "$_#.png"]), 2, "the names of all scenes have to differ"),
        (film(&["--pictures", "#.png", "--", "--exr", "a.exr"]), 2, "writes pictures alone"),
        (film(&["--pictures", "#.png", "--seed", "2"]), 2, "farm does not take --shader-dir and --seed"),
        (vec!["meshes", "--shader-dir", "."], 2, "--shader-dir and"),
        (vec!["meshes", "--", "--quality"], 2, "the options after --: a value is required for '--quality"),
        (vec!["meshes", "--", "--seed", "2"], 2, "options of every command go before"),
        (vec!["meshes", "--", "--size", "9x9"], 2, "the options after --: unexpected argument '--size'"),
    ] {
        let ran = farm.run(&[&["farm", "plan", "-o", "p.json", "-q"], &words[..]].concat());
        assert!(ran.code == code && ran.stderr.contains(what), "{words:?}: {} {}", ran.code, ran.stderr);
        assert!(ran.stderr.lines().count() == 1 && !ran.stderr.contains("\\n"), "{words:?}: {}", ran.stderr);
        assert!(!farm.path("p.json").exists(), "{words:?}");
    }
}

/// Meshes of equal content are baked once.
#[test]
fn equal_meshes_are_planned_once() {
    if !has_device() {
        return;
    }
    let farm = Farm::new();
    std::fs::copy(farm.path("meshes/b.obj"), farm.path("meshes/c.obj")).unwrap();
    farm.good(&[&["farm", "plan", "meshes", "-o", "p.json"][..], &DRAFT].concat());
    let plan = farm.read("p.json");
    let paths: Vec<&str> = plan["inputs"].as_array().unwrap().iter().filter_map(|i| i["path"].as_str()).collect();
    assert_eq!(paths, ["meshes/a.obj", "meshes/b.obj"]);
    assert_eq!(
        plan["tasks"].as_array().unwrap().len(),
        5,
        "field and outlines of both, vertices of the one that is not convex"
    );
}
