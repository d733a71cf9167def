//! glTF files that are no good: exit code 4 and one line that names the file and the place in its JSON.

use crate::cli::Folder;
use crate::model::{F32, Model, U8, glb, read, refusal, room};
use serde_json::{Value, json};

/// The program refuses the file with one line that has all parts, and writes nothing.
fn refused(folder: &Folder, file: &str, parts: &[&str]) {
    let start = format!("shadow-fields: {file}: ");
    folder.refused(&format!("import {file} -o out.toml"), 4, &[&[start.as_str()], parts].concat());
}

/// The reader refuses a model with one line that has all parts.
fn refused_model(model: &Model, parts: &[&str]) {
    let line = refusal(read(model, &Default::default()));
    parts.iter().for_each(|part| assert!(line.contains("m.glb: ") && line.contains(part), "no {part:?} in {line:?}"));
}

/// As [`refused_model`], after a change of its JSON.
fn refused_after(change: impl FnOnce(&mut Value), parts: &[&str]) {
    let mut model = room();
    change(&mut model.json);
    refused_model(&model, parts);
}

/// The same of the room with one value of its JSON after another replaced.
fn refused_values(rows: &[(&str, Value, [&str; 2])]) {
    for (path, value, parts) in rows {
        refused_after(|json| *json.pointer_mut(path).unwrap() = value.clone(), parts);
    }
}

#[test]
fn containers_that_are_cut_off_or_damaged() {
    let folder = Folder::new();
    let whole = room().glb();
    for length in [0, 3, 4, 11, 12, 19, 20, 27, 100, whole.len() / 2, whole.len() - 1] {
        folder.write("cut.glb", &whole[..length]);
        refused(&folder, "cut.glb", &[]);
    }
    let changed = |at: usize, word: u32| {
        let mut bytes = whole.clone();
        bytes[at..at + 4].copy_from_slice(&word.to_le_bytes());
        bytes
    };
    for (bytes, part) in [
        (changed(4, 1), "expected version 2 of GLB, got 1"),
        (changed(8, 3), "that states 3"),
        (changed(8, u32::MAX), "that states 4294967295"),
        (changed(12, u32::MAX), "cut off"),
        (changed(16, 0), "without JSON"),
        (glb(b"{\"asset\":{\"version\":\"2.0\"}", b""), "its JSON: EOF"),
        (glb(b"{\"asset\":{}}", b""), "missing field `version`"),
        (glb(b"{\"asset\":{\"version\":\"1.0\"}}", b""), "asset: version \"1.0\""),
        (glb("[".repeat(5000).as_bytes(), b""), "its JSON: "),
        (glb(b"\xff\xfe", b""), "its JSON: "),
        (b"\x93\x11GLB".to_vec(), "begins neither as GLB nor as JSON"),
    ] {
        folder.write("m.glb", bytes);
        refused(&folder, "m.glb", &[part]);
    }
    let many = format!("{{\"asset\":{{\"version\":\"2.0\"}},\"nodes\":[{}{{}}]}}", "{},".repeat(1_000_001));
    folder.write("m.glb", glb(many.as_bytes(), b""));
    refused(&folder, "m.glb", &["over the limit of 1000000 objects"]);
    std::fs::File::create(folder.at("large.gltf")).unwrap().set_len(300 << 20).unwrap();
    refused(&folder, "large.gltf", &["limit of 256 MiB"]);
    // An empty file is an empty scene.
    folder.write("none.gltf", "{\"asset\":{\"version\":\"2.0\"}}");
    folder.good("import none.gltf -o none.toml");
}

#[test]
fn indices_out_of_range() {
    refused_values(&[
        ("/nodes/0/mesh", json!(99), ["nodes[0].mesh: ", "out of range"]),
        ("/scenes/0/nodes/0", json!(99), ["scenes[0].nodes[0]: ", "out of range"]),
        (
            "/meshes/0/primitives/0/attributes/POSITION",
            json!(99),
            ["meshes[0].primitives[0].attributes.POSITION: ", "no accessor 99"],
        ),
        ("/meshes/0/primitives/0/indices", json!(99), ["meshes[0].primitives[0].indices: ", "out of range"]),
        ("/meshes/0/primitives/0/material", json!(99), ["meshes[0].primitives[0].material: ", "out of range"]),
        ("/accessors/0/bufferView", json!(99), ["accessors[0].bufferView: ", "out of range"]),
        ("/accessors/0/count", json!(25), ["accessors[0]: ", "leave a buffer view"]),
        ("/accessors/0/count", json!(0), ["accessors[0]: ", "a count of 0"]),
        ("/accessors/0/count", json!(u64::MAX), ["accessors[0]: ", "a count of 18446744073709551615"]),
        ("/accessors/0/type", json!("VEC5"), ["accessors[0].type: ", "not a valid one"]),
        ("/accessors/0/type", json!("MAT3"), ["accessors[0]: ", "matrices"]),
        ("/accessors/0/componentType", json!(5124), ["accessors[0].componentType: ", "not a valid one"]),
        ("/accessors/2/componentType", json!(5126), ["accessors[2]: ", ""]),
        ("/bufferViews/0/byteOffset", json!(u64::MAX), ["bufferViews[0]: ", "leave a buffer"]),
        ("/bufferViews/0/byteLength", json!(1_000_000), ["bufferViews[0]: ", "leave a buffer"]),
        ("/bufferViews/0/buffer", json!(3), ["bufferViews[0].buffer: ", "out of range"]),
        ("/animations/0/channels/0/target/node", json!(99), ["animations[0].channels[0].target: ", "no node 99"]),
        ("/animations/0/channels/0/target/path", json!("colour"), ["animations[0].channels[0].target: ", "path"]),
        ("/animations/0/channels/0/sampler", json!(9), ["animations[0].channels[0].sampler: ", "out of range"]),
        ("/animations/0/samplers/0/input", json!(99), ["animations[0].samplers[0].input: ", "out of range"]),
        ("/nodes/3/extensions/KHR_lights_punctual/light", json!(9), ["nodes[3]", "out of range"]),
        ("/nodes/4/camera", json!(9), ["nodes[4].camera: ", "out of range"]),
    ]);
    // An index of a vertex that is not there.
    let mut model = Model::default();
    let positions = model.positions(&[0., 0., 0., 1., 0., 0., 0., 1., 0.]);
    let indices = model.indices(&[0, 1, 3]);
    model.placed(json!({ "POSITION": positions }), Some(indices), None);
    refused_model(&model, &["index 3 is out of range: there are 3", "meshes[0].primitives[0]"]);
}

#[test]
fn numbers_out_of_range() {
    for bad in [f32::NAN, f32::INFINITY] {
        let mut model = Model::default();
        let positions = model.positions(&[0., 0., 0., 1., 0., 0., 0., 1., 0.]);
        model.bytes[16..20].copy_from_slice(&bad.to_le_bytes());
        model.placed(json!({ "POSITION": positions }), None, None);
        refused_model(&model, &["accessors[0]: a number of element 1 is not finite"]);
    }
    refused_values(&[
        ("/nodes/1/translation", json!([0, 1e9, 0]), ["nodes[1]: ", "too large"]),
        ("/nodes/1/translation", json!([0, 1e300, 0]), ["its JSON: ", "out of range"]),
        ("/nodes/4/rotation", json!([0, 0, 0, 0]), ["nodes[4]: ", "its rotation is 0"]),
        ("/nodes/0", json!({ "mesh": 0, "scale": [1e-9, 1e-9, 1e-9] }), ["nodes[0]: ", "scale is not within"]),
        ("/cameras/0/perspective/yfov", json!(4), ["cameras[0].perspective: ", "1 to 170"]),
        ("/cameras/0/perspective/aspectRatio", json!(1e6), ["cameras[0].perspective: ", "aspectRatio"]),
        ("/materials/2/emissiveFactor", json!([-1, 0, 0]), ["materials[2]: ", "emission"]),
        ("/materials/0/pbrMetallicRoughness/baseColorFactor", json!([-1, 0, 0, 1]), ["materials[0]: ", "base colour"]),
        ("/extensions/KHR_lights_punctual/lights/0/intensity", json!(-1), ["lights[0]: ", "intensity"]),
        (
            "/extensions/KHR_lights_punctual/lights/0/type",
            json!("spot"),
            ["extensions.KHR_lights_punctual.lights[0].spot: ", "it is missing"],
        ),
    ]);
    // Times that do not increase.
    let mut model = room();
    model.animate(0, 0, "translation", "LINEAR", &[0., 2., 1.], &[0.; 9]);
    refused_model(&model, &["animations[0].channels[1]: ", "times that increase"]);
    let mut model = room();
    model.animate(0, 0, "translation", "CUBICSPLINE", &[0., 2.], &[0.; 6]);
    refused_model(&model, &["animations[0].channels[1]: ", "2 times have 2 values, not 3 each"]);
}

#[test]
fn nodes_in_circles_and_extensions_that_are_not_known() {
    refused_after(|json| json["nodes"][0]["children"] = json!([0]), &["nodes[0]: ", "in itself"]);
    refused_after(
        |json| {
            json["nodes"][0]["children"] = json!([1]);
            json["nodes"][2]["children"] = json!([1]);
        },
        &["nodes[1]: ", "in two nodes"],
    );
    refused_after(
        |json| {
            let first = json["nodes"].as_array().unwrap().len();
            let chain = (first..first + 300).map(|i| json!({ "children": [i + 1] }));
            let chain: Vec<Value> = chain.chain([json!({})]).collect();
            json["nodes"].as_array_mut().unwrap().extend(chain);
            json["scenes"][0]["nodes"].as_array_mut().unwrap().push(json!(first));
        },
        &["over the limit of 256 nodes in one another"],
    );
    refused_after(
        |json| json["extensionsRequired"] = json!(["KHR_animation_pointer"]),
        &["extensionsRequired[0]: KHR_animation_pointer is not supported"],
    );
    let unit = json!([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]);
    refused_after(|json| json["nodes"][1]["matrix"] = unit, &["nodes[1]: ", "matrix"]);
}

#[test]
fn files_outside_the_folder_are_refused() {
    let outer = tempfile::tempdir().unwrap();
    let secret = outer.path().join("secret.bin");
    let folder = Folder::inside(outer.path());
    let model = room();
    model.write_beside(folder.path(), "m", "ok.bin", &secret);
    std::fs::copy(&secret, folder.at("own.bin")).unwrap();
    #[cfg(unix)]
    std::os::unix::fs::symlink(&secret, folder.at("link.bin")).unwrap();
    let absolute = secret.to_str().unwrap();
    for (uri, part) in [
        ("../secret.bin", "outside the folder"),
        ("%2e%2e/secret.bin", "outside the folder"),
        ("sub/../../secret.bin", "outside the folder"),
        (absolute, "outside the folder"),
        #[cfg(unix)]
        ("link.bin", "outside the folder"),
        ("file:///etc/passwd", "refused"),
        ("https://example.org/a.bin", "refused"),
        ("gone.bin", "o such file"),
        ("data:application/octet-stream;base64,AA*A", "not base64"),
        ("data:application/octet-stream;base64,AAAA", "there are 3 bytes"),
        ("data:text/plain,AAAA", "expected data in base64"),
    ] {
        model.write_beside(folder.path(), "m", uri, &folder.at("own.bin"));
        refused(&folder, "m.gltf", &["buffers[0]", part]);
    }
    model.write_beside(folder.path(), "m", "own.bin", &folder.at("own.bin"));
    folder.good("import m.gltf -o out.toml");
}

/// Every command that takes a scene or a mesh refuses a bad file alike.
#[test]
fn commands_agree() {
    let folder = Folder::new();
    let whole = room().glb();
    folder.write("cut.glb", &whole[..whole.len() / 2]);
    for line in [
        "import cut.glb -o out.toml",
        "render cut.glb -o out.png",
        "bake cut.glb -o out.sf",
        "bench time-error cut.glb --out out",
        #[cfg(feature = "view")]
        "view cut.glb",
    ] {
        folder.refused(line, 4, &["shadow-fields: cut.glb: a GLB file of"]);
    }
}

/// Small files that ask for much: told before anything of that size is made.
#[test]
fn bombs() {
    let started = std::time::Instant::now();
    // Elements of a sparse accessor take no bytes in the file.
    let mut model = Model::default();
    let indices = model.view(&[0]);
    let values = model.view(&[0; 12]);
    let sparse = json!({ "count": 1, "indices": { "bufferView": indices, "componentType": U8 }, "values": { "bufferView": values } });
    let bounds = json!([0, 0, 0]);
    let json = json!({ "componentType": F32, "count": 4_000_000_000_u64, "type": "VEC3", "sparse": sparse, "min": bounds, "max": bounds });
    let positions = model.push("accessors", json);
    let mesh = model.placed(json!({ "POSITION": positions }), None, None);
    refused_model(&model, &["accessors[0]: a count of 4000000000"]);
    // The same, within the limit but used by many.
    model.json["accessors"][positions]["count"] = json!(3_000_000);
    let primitive = model.json["meshes"][mesh]["primitives"][0].clone();
    model.json["meshes"][mesh]["primitives"] = json!(vec![primitive; 1000]);
    model.json["meshes"][mesh]["primitives"][0]["mode"] = json!(0);
    refused_model(&model, &[]);
    // A texture that states a huge size.
    let mut model = room();
    let texture = model.texture("image/png", &crate::common::huge_png());
    model.json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = json!({ "index": texture });
    refused_model(&model, &["images[0]: 65535 x 65535 pixels"]);
    // One node for each of more entities than a scene has.
    let mut model = room();
    for _ in 0..4200 {
        model.node(json!({ "mesh": 0 }));
    }
    refused_model(&model, &["over the limit of 4096 entities"]);
    // Keys count for every node that they carry.
    let mut model = room();
    let times: Vec<f32> = (0..60_000_u16).map(f32::from).collect();
    model.animate(0, 0, "translation", "STEP", &times, &vec![0.0; 180_000]);
    for _ in 0..20 {
        model.child(0, json!({ "mesh": 0 }));
    }
    refused_model(&model, &["over the limit of 1000000 keys"]);
    assert!(started.elapsed().as_secs() < 60, "{:?}", started.elapsed());
}
