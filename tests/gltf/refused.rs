//! glTF files that are no good: the program ends with exit code 4 and one line that names the file and the place in its
//! JSON.

use crate::{cli, model};
use cli::{Ran, command, finish, good, names};
use model::{F32, Model, U8, glb, room};
use serde_json::{Value, json};
use tempfile::TempDir;

fn folder() -> TempDir {
    tempfile::tempdir().unwrap()
}

/// The program refuses the file with one line that has all parts, and writes nothing.
fn refused(folder: &TempDir, file: &str, parts: &[&str]) {
    let before = names(folder.path());
    let Ran { code, stdout, stderr } = finish(&mut command(folder.path(), &["import", file, "-o", "out.toml"]));
    assert_eq!((code, stderr.lines().count(), stdout.as_str()), (4, 1, ""), "{file}: {stderr}");
    assert!(stderr.starts_with(&format!("shadow-fields: {file}: ")), "{stderr}");
    parts.iter().for_each(|part| assert!(stderr.contains(part), "{file}: no {part:?} in {stderr}"));
    assert_eq!(names(folder.path()), before, "something is left behind");
}

/// As [`refused`], for a model after a change of its JSON.
fn refused_after(change: impl FnOnce(&mut Value), parts: &[&str]) {
    let folder = folder();
    let mut model = room();
    change(&mut model.json);
    model.write(folder.path(), "m");
    refused(&folder, "m.glb", parts);
}

#[test]
fn containers_that_are_cut_off_or_damaged() {
    let folder = folder();
    let whole = room().glb();
    for length in [0, 3, 4, 11, 12, 19, 20, 27, 100, whole.len() / 2, whole.len() - 1] {
        std::fs::write(folder.path().join("cut.glb"), &whole[..length]).unwrap();
        refused(&folder, "cut.glb", &[]);
    }
    let write = |bytes: &[u8]| std::fs::write(folder.path().join("m.glb"), bytes).unwrap();
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
    ] {
        write(&bytes);
        refused(&folder, "m.glb", &[part]);
    }
    let many = format!("{{\"asset\":{{\"version\":\"2.0\"}},\"nodes\":[{}{{}}]}}", "{},".repeat(1_000_001));
    write(&glb(many.as_bytes(), b""));
    refused(&folder, "m.glb", &["over the limit of 1000000 objects"]);
    std::fs::File::create(folder.path().join("large.gltf")).unwrap().set_len(300 << 20).unwrap();
    refused(&folder, "large.gltf", &["limit of 256 MiB"]);
    std::fs::write(folder.path().join("none.gltf"), "{\"asset\":{\"version\":\"2.0\"}}").unwrap();
    let ran = finish(&mut command(folder.path(), &["import", "none.gltf", "-o", "none.toml"]));
    assert_eq!(ran.code, 0, "an empty file is an empty scene: {}", ran.stderr);
}

#[test]
fn indices_out_of_range() {
    let set = |path: &'static str, value: Value| move |json: &mut Value| *json.pointer_mut(path).unwrap() = value;
    for (path, value, parts) in [
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
    ] {
        refused_after(set(path, value), &parts);
    }
    // An index of a vertex that is not there.
    let folder = folder();
    let mut model = Model::default();
    let positions = model.positions(&[0., 0., 0., 1., 0., 0., 0., 1., 0.]);
    let indices = model.indices(&[0, 1, 3]);
    let mesh = model.mesh(json!({ "POSITION": positions }), Some(indices), None);
    model.node(json!({ "mesh": mesh }));
    model.write(folder.path(), "m");
    refused(&folder, "m.glb", &["index 3 is out of range: there are 3", "meshes[0].primitives[0]"]);
}

#[test]
fn numbers_out_of_range() {
    let folder = folder();
    for bad in [f32::NAN, f32::INFINITY] {
        let mut model = Model::default();
        let positions = model.positions(&[0., 0., 0., 1., 0., 0., 0., 1., 0.]);
        model.bytes[16..20].copy_from_slice(&bad.to_le_bytes());
        let mesh = model.mesh(json!({ "POSITION": positions }), None, None);
        model.node(json!({ "mesh": mesh }));
        model.write(folder.path(), "m");
        refused(&folder, "m.glb", &["accessors[0]: a number of element 1 is not finite"]);
    }
    let set = |path: &'static str, value: Value| move |json: &mut Value| *json.pointer_mut(path).unwrap() = value;
    for (path, value, parts) in [
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
    ] {
        refused_after(set(path, value), &parts);
    }
    // Times that do not increase.
    let mut model = room();
    model.animate(0, 0, "translation", "LINEAR", &[0., 2., 1.], &[0.; 9]);
    model.write(folder.path(), "m");
    refused(&folder, "m.glb", &["animations[0].channels[1]: ", "times that increase"]);
    let mut model = room();
    model.animate(0, 0, "translation", "CUBICSPLINE", &[0., 2.], &[0.; 6]);
    model.write(folder.path(), "m");
    refused(&folder, "m.glb", &["animations[0].channels[1]: ", "2 times have 2 values, not 3 each"]);
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
    refused_after(
        |json| json["nodes"][1]["matrix"] = json!([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]),
        &["nodes[1]: ", "matrix"],
    );
}

#[test]
fn files_outside_the_folder_are_refused() {
    let outer = folder();
    let inner = outer.path().join("inner");
    std::fs::create_dir(&inner).unwrap();
    let model = room();
    let secret = outer.path().join("secret.bin");
    model.write_beside(&inner, "m", "ok.bin", &secret);
    std::fs::copy(&secret, inner.join("own.bin")).unwrap();
    #[cfg(unix)]
    std::os::unix::fs::symlink(&secret, inner.join("link.bin")).unwrap();
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
        model.write_beside(&inner, "m", uri, &inner.join("own.bin"));
        let ran = finish(&mut command(&inner, &["import", "m.gltf", "-o", "out.toml"]));
        assert_eq!((ran.code, ran.stderr.lines().count()), (4, 1), "{uri}: {}", ran.stderr);
        assert!(ran.stderr.contains("m.gltf: buffers[0]") && ran.stderr.contains(part), "{uri}: {}", ran.stderr);
        assert!(!inner.join("out.toml").exists());
    }
    model.write_beside(&inner, "m", "own.bin", &inner.join("own.bin"));
    good(&inner, &["import", "m.gltf", "-o", "out.toml"]);
}

/// Every command that takes a scene or a mesh refuses a bad file alike.
#[test]
fn commands_agree() {
    let folder = folder();
    let whole = room().glb();
    std::fs::write(folder.path().join("cut.glb"), &whole[..whole.len() / 2]).unwrap();
    let mut commands = vec![
        vec!["import", "cut.glb", "-o", "out.toml"],
        vec!["render", "cut.glb", "-o", "out.png"],
        vec!["bake", "cut.glb", "-o", "out.sf"],
        vec!["bake", "cut.glb", "-o", "out.sf", "--silhouette"],
        vec!["bench", "time-error", "cut.glb", "--out", "out"],
    ];
    if cfg!(feature = "view") {
        commands.push(vec!["view", "cut.glb"]);
    }
    for arguments in commands {
        let ran = finish(&mut command(folder.path(), &arguments));
        assert_eq!((ran.code, ran.stderr.lines().count()), (4, 1), "{arguments:?}: {}", ran.stderr);
        assert!(ran.stderr.starts_with("shadow-fields: cut.glb: a GLB file of"), "{arguments:?}: {}", ran.stderr);
    }
    assert_eq!(names(folder.path()), ["cut.glb"]);
}

/// Small files that ask for much: told before anything of that size is made.
#[test]
fn bombs() {
    let folder = folder();
    let started = std::time::Instant::now();
    // Elements of a sparse accessor take no bytes in the file.
    let mut model = Model::default();
    let indices = model.view(&[0]);
    let values = model.view(&[0; 12]);
    let sparse = json!({ "count": 1, "indices": { "bufferView": indices, "componentType": U8 }, "values": { "bufferView": values } });
    let bounds = json!([0, 0, 0]);
    let json = json!({ "componentType": F32, "count": 4_000_000_000_u64, "type": "VEC3", "sparse": sparse, "min": bounds, "max": bounds });
    let positions = model.push("accessors", json);
    let mesh = model.mesh(json!({ "POSITION": positions }), None, None);
    model.node(json!({ "mesh": mesh }));
    model.write(folder.path(), "m");
    refused(&folder, "m.glb", &["accessors[0]: a count of 4000000000"]);
    // The same, within the limit but used by many.
    model.json["accessors"][positions]["count"] = json!(3_000_000);
    let primitive = model.json["meshes"][mesh]["primitives"][0].clone();
    model.json["meshes"][mesh]["primitives"] = json!(vec![primitive; 1000]);
    model.json["meshes"][mesh]["primitives"][0]["mode"] = json!(0);
    model.write(folder.path(), "m");
    refused(&folder, "m.glb", &[]);
    // A texture that states a huge size.
    let mut model = room();
    let mut picture = b"\x89PNG\r\n\x1a\n\0\0\0\x0dIHDR".to_vec();
    picture.extend([0, 0, 255, 255, 0, 0, 255, 255, 8, 2, 0, 0, 0]);
    let crc = picture[12..].iter().fold(!0_u32, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |crc, _| (crc >> 1) ^ (0xedb8_8320 & (crc & 1).wrapping_neg()))
    });
    picture.extend((!crc).to_be_bytes());
    picture.extend(b"\0\0\0\0IDAT\x35\xaf\x06\x1e\0\0\0\0IEND\xae\x42\x60\x82");
    let view = model.view(&picture);
    let image = model.push("images", json!({ "bufferView": view, "mimeType": "image/png" }));
    let texture = model.push("textures", json!({ "source": image }));
    model.json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = json!({ "index": texture });
    model.write(folder.path(), "m");
    refused(&folder, "m.glb", &["images[0]: 65535 x 65535 pixels"]);
    // One node for each of more entities than a scene has.
    let mut model = room();
    for _ in 0..4200 {
        model.node(json!({ "mesh": 0 }));
    }
    model.write(folder.path(), "m");
    refused(&folder, "m.glb", &["over the limit of 4096 entities"]);
    // Keys count for every node that they carry.
    let mut model = room();
    let times: Vec<f32> = (0..60_000_u16).map(f32::from).collect();
    model.animate(0, 0, "translation", "STEP", &times, &vec![0.0; 180_000]);
    for _ in 0..20 {
        model.child(0, json!({ "mesh": 0 }));
    }
    model.write(folder.path(), "m");
    refused(&folder, "m.glb", &["over the limit of 1000000 keys"]);
    assert!(started.elapsed().as_secs() < 60, "{:?}", started.elapsed());
}
