//! What is refused before any work is done: other programs, devices and inputs; works and options that make no plan.

use super::{DRAFT, Farm, common};
use serde_json::{Value, json};
use shadow_fields::farm::Plan;
use shadow_fields::farm::results::{self, SliceResult};
use shadow_fields::field::file;

#[test]
fn other_programs_devices_and_inputs_are_refused_with_both_names() {
    let Some(farm) = Farm::planned() else { return };
    let good = farm.plan("p.json");
    let refused = |edit: &dyn Fn(&mut Value)| {
        let mut plan = good.clone();
        edit(&mut plan);
        farm.write("p.json", plan.to_string());
        let ran = farm.run("farm run p.json --slice 0 -q");
        assert!(farm.results().is_empty());
        ran
    };
    refused(&|plan| plan["plan_of"] = "shadow-fields 0.0.1 0123456".into())
        .ended(3, &["a plan of shadow-fields 0.0.1 0123456, and this is shadow-fields "]);
    refused(&|plan| plan["meshes"][0]["hash"] = "00".into())
        .ended(4, &["a.obj: it has changed since the plan was made"]);
    refused(&|plan| plan["slices"] = json!([])).ended(4, &["p.json: it has no slices"]);
    for (key, value) in [
        ("slices", json!([{ "meshes": { "first": 5, "count": 2 } }])),
        ("slices", json!([{ "meshes": { "first": 0, "count": 0 } }])),
        ("slices", json!([{ "pictures": { "film": 0, "first": 0, "count": 1 } }])),
        ("slices", json!([{ "meshes": { "first": 4_294_967_295_u32, "count": 4_294_967_295_u32 } }])),
    ] {
        let outside = ["p.json: slice 0 is of things that are not there"];
        refused(&|plan| plan[key] = value.clone()).ended(4, &outside);
    }
    let other = ["Mesa 1.2), and this device is "];
    refused(&|plan| plan["device"] = "llvmpipe (Mesa 1.2)".into()).ended(3, &other);
    // An engine says the same, and tries it once.
    let ran = farm.run("farm submit p.json --engine local -v").ended(1, &["and this device is", "slice 0, try 1"]);
    assert!(!ran.stderr.contains("try 2"), "{}", ran.stderr);
}

#[test]
fn works_and_options_that_make_no_plan_are_refused_in_a_line() {
    let Some(farm) = Farm::with_meshes() else { return };
    std::fs::create_dir(farm.at("other")).unwrap();
    std::fs::copy(farm.at("film.toml"), farm.at("other/film.toml")).unwrap();
    farm.write("notes.txt", "");
    for (words, code, what) in [
        ("nothing", 4, "nothing: cannot be read: No such file"),
        ("notes.txt", 4, "notes.txt: expected a folder, a mesh"),
        ("other", 4, "other: a folder without meshes"),
        ("film.toml", 2, "film.toml: a scene needs --frames and --pictures"),
        ("meshes --frames 2 --pictures o_#.png", 2, "are for scenes, and there is none"),
        ("film.toml --frames 2 --pictures o.png", 2, "--pictures o.png: the name needs a run of #"),
        ("film.toml --frames 2 --pictures o_#.exr", 2, "--pictures o_#.exr: the name must end in .png"),
        ("film.toml --frames 2 other/film.toml --pictures $_#.png", 2, "the names of all scenes have to differ"),
        ("film.toml --frames 2 --pictures #.png --seed 2", 2, "farm does not take --shader-dir and --seed"),
        ("meshes --shader-dir .", 2, "--shader-dir and"),
        ("meshes --size 9x9", 2, "are for scenes, and there is none"),
    ] {
        let ran = farm.run(&format!("farm plan -o p.json -q {words}")).ended(code, &[what]);
        assert!(ran.stderr.lines().count() == 1 && !ran.stderr.contains("\\n"), "{words:?}: {}", ran.stderr);
        assert!(!farm.at("p.json").exists(), "{words:?}");
    }
}

#[test]
fn equal_meshes_are_planned_once() {
    let Some(farm) = Farm::with_meshes() else { return };
    std::fs::copy(farm.at("meshes/b.obj"), farm.at("meshes/c.obj")).unwrap();
    farm.good(&format!("farm plan meshes -o p.json {DRAFT}"));
    let plan = farm.plan("p.json");
    let paths: Vec<&str> = plan["meshes"].as_array().unwrap().iter().filter_map(|i| i["path"].as_str()).collect();
    assert_eq!(paths, ["a", "b", "d", "e", "f"].map(|name| format!("meshes/{name}.obj")));
    assert_eq!(plan["slices"][0], json!({ "meshes": { "first": 0, "count": 5 } }));
}

/// A plan replaces a plan, and nothing else unless it is told to; never an input.
#[test]
fn a_plan_replaces_no_other_file() {
    let Some(farm) = Farm::with_meshes() else { return };
    std::fs::create_dir(farm.at("meshes/more")).unwrap();
    for _ in 0..2 {
        let ran = farm.run(&format!("farm plan meshes -o p.json {DRAFT}"));
        assert!(ran.code == 0 && ran.stdout.starts_with("p.json: 1 slice\n"), "{}{}", ran.stdout, ran.stderr);
        assert!(ran.stderr.contains("note: meshes: 1 folder in it left out"), "{}", ran.stderr);
    }
    farm.write("other.json", "{}");
    std::fs::hard_link(farm.at("meshes/a.obj"), farm.at("a.json")).unwrap();
    for (output, words, what) in [
        ("meshes/a.obj", "", "must end in .json"),
        ("other.json", "", "is no plan; --force replaces it"),
        ("a.json", "--force", "the input meshes/a.obj"),
    ] {
        let before = farm.read(output);
        farm.run(&format!("farm plan meshes -q -o {output} {words}")).ended(2, &[what]);
        assert!(before == farm.read(output), "{output}");
    }
    farm.write("out_1.png", "");
    std::fs::hard_link(farm.at("film.toml"), farm.at("f_2.png")).unwrap();
    for (pattern, code) in [("out_#.png", 0), ("f_#.png", 2)] {
        let ran = farm.run(&format!("farm plan film.toml -q -o f.json --frames 3 --pictures {pattern}"));
        assert!(ran.code == code && (code == 0 || ran.stderr.contains("the input film.toml")), "{}", ran.stderr);
    }
    farm.good("farm plan meshes -o other.json --force");
    assert!(farm.plan("other.json")["slices"].is_array());
}

#[test]
fn names_of_results_differ_where_anything_differs() {
    let base = common::plan();
    let mut keys: Vec<String> = (0..4).map(|slice| base.key(slice)).collect();
    let edits: [(usize, fn(&mut Plan)); 9] = [
        (0, |p| p.plan_of.push('x')),
        (0, |p| p.device.push('x')),
        (0, |p| p.bake.face_px += 1),
        (0, |p| p.meshes[0].hash.push('x')),
        (2, |p| p.device.push('x')),
        (2, |p| p.films[0].scene.hash.push('x')),
        (2, |p| p.films[0].options.size[0] += 1),
        (2, |p| p.films[0].first_s = 0.5),
        (2, |p| p.films[0].fps += 1),
    ];
    for (slice, edit) in edits {
        let mut other = base.clone();
        edit(&mut other);
        keys.push(other.key(slice));
    }
    let distinct: std::collections::HashSet<_> = keys.iter().collect();
    assert_eq!(distinct.len(), keys.len());
    let mut moved = base.clone();
    moved.meshes[0].path = "elsewhere/m.obj".into();
    moved.films[0].pictures = "g_#.png".into();
    assert_eq!([0, 2].map(|slice| moved.key(slice)), [0, 2].map(|slice| base.key(slice)), "where files lie");
}

/// A result whose seal is right, but not its words, is damaged: a name leads nowhere else.
#[test]
fn results_with_other_names_are_damaged() {
    let folder = tempfile::tempdir().unwrap();
    let plan = Plan { folder: folder.path().to_owned(), ..common::plan() };
    let found = |key: &str, files: Value, payload: &[u8]| {
        file::write(&results::path(&plan, 0), *b"SHSLICE\n", &json!({ "key": key, "files": files }), payload).unwrap();
        results::find(&plan, 0)
    };
    let key = plan.key(0);
    assert!(matches!(found(&key, json!([["a.sf", 3]]), b"abc"), SliceResult::Whole(files) if files[0].1 == b"abc"));
    assert!(matches!(found("other", json!([["a.sf", 3]]), b"abc"), SliceResult::Damaged(_)));
    for files in
        [json!([["a.sf", 4]]), json!([["a.sf", 2]]), json!([["../a", 3]]), json!([["", 3]]), json!([[".a", 3]])]
    {
        assert!(matches!(found(&key, files.clone(), b"abc"), SliceResult::Damaged(_)), "{files}");
    }
}
