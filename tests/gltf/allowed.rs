//! glTF files that few programs write and the specification allows are read; what is left out of them is said.

use crate::model::{self, F32, Model, load, read, robot, room};
use serde_json::{Value, json};
use shadow_fields::scene::gltf;

/// Reads a model with other JSON.
fn read_text(text: &str, model: &Model) -> shadow_fields::Result<gltf::Import> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("m.glb");
    std::fs::write(&path, model::glb(text.as_bytes(), &model.bytes)).unwrap();
    gltf::load(&path, &Default::default())
}

/// Accessors may lack a bufferView: their numbers are zeros.
#[test]
fn accessors_without_a_view_are_zeros() {
    for model in [room(), robot()] {
        let whole = load(&model).data;
        let count = model.json["accessors"].as_array().unwrap().len();
        for index in 0..count {
            let mut changed = model.clone();
            changed.json["accessors"][index].as_object_mut().unwrap().remove("bufferView");
            let found = read(&changed, &Default::default()).unwrap_or_else(|error| panic!("accessor {index}: {error}"));
            assert!(found.data.entities.len() <= whole.entities.len(), "accessor {index}");
        }
        assert!(count > 5);
        let mut changed = Model { json: model.whole(), bytes: Vec::new() };
        for accessor in changed.json["accessors"].as_array_mut().unwrap() {
            accessor.as_object_mut().unwrap().remove("bufferView");
        }
        let found = load(&changed);
        assert!(found.data.entities.iter().all(|entity| entity.mesh == "lamp"), "nothing has an area");
        let notes = found.notes.left_out().join("\n");
        assert!(notes.contains("shapes without an area"), "{notes}");
    }
}

/// A channel without a node moves nothing: each is left out, and the others stay.
#[test]
fn channels_without_a_node_are_left_out() {
    let mut copies = 0;
    for model in [room(), robot()] {
        let count = model.json["animations"][0]["channels"].as_array().map_or(0, Vec::len);
        for left in (0..count).map(|i| i..i + 1).chain([0..count]).filter(|left| !left.is_empty()) {
            let mut changed = model.clone();
            let dropped = left.len();
            for i in left {
                let channel = &mut changed.json["animations"][0]["channels"][i];
                channel["target"].as_object_mut().unwrap().remove("node");
            }
            let found = load(&changed);
            let note = format!("left out ({dropped}): channels of animations that move no node");
            assert!(found.notes.left_out().contains(&note), "{:?}", found.notes.left_out());
            copies += 1;
        }
    }
    assert_eq!(copies, 6);
}

#[test]
fn scenes_may_have_no_nodes() {
    let mut model = room();
    model.json["scenes"] = json!([{ "name": "empty" }, model.json["scenes"][0].clone()]);
    assert_eq!(load(&model).data.entities.len(), 0);
    model.json["scene"] = json!(1);
    assert_eq!(load(&model).data.entities.len(), load(&room()).data.entities.len());
    model.json["scene"] = json!(2);
    assert!(read(&model, &Default::default()).is_err());
    model.json["scenes"] = json!([{}, {}, {}]);
    assert_eq!(load(&model).data.entities.len(), 0);
}

/// Calls `each` with the place of every whole number below a value.
fn whole_numbers(value: &Value, place: &str, each: &mut dyn FnMut(String)) {
    match value {
        Value::Number(number) if number.is_u64() => each(place.to_owned()),
        Value::Array(values) => {
            values.iter().enumerate().for_each(|(i, value)| whole_numbers(value, &format!("{place}/{i}"), each));
        }
        Value::Object(map) => map.iter().for_each(|(key, value)| whole_numbers(value, &format!("{place}/{key}"), each)),
        _ => {}
    }
}

/// JSON with the numbers at places written in another way: 4, 4.0, 4e0 and 40e-1 are one number.
fn written(json: &Value, places: &[String], way: &dyn Fn(u64) -> String) -> String {
    let mut json = json.clone();
    for place in places {
        let value = json.pointer_mut(place).unwrap();
        *value = json!(format!("<{}>", way(value.as_u64().unwrap())));
    }
    json.to_string().replace("\"<", "").replace(">\"", "")
}

#[test]
fn whole_numbers_may_have_a_point_or_an_exponent() {
    let ways: [&dyn Fn(u64) -> String; 4] = [
        &|x| format!("{x}.0"),
        &|x| format!("{x}e0"),
        &|x| if x == 0 { "0E-1".into() } else { format!("{x}0E-1") },
        &|x| format!("{x}.000e+0"),
    ];
    for model in [room(), robot()] {
        let json = model.whole();
        let mut places = Vec::new();
        whole_numbers(&json, "", &mut |place| places.push(place));
        assert!(places.len() > 50, "{places:?}");
        let whole = load(&model);
        for way in ways {
            let found = read_text(&written(&json, &places, way), &model).unwrap_or_else(|error| panic!("{error}"));
            assert!(found.data == whole.data && found.notes == whole.notes, "as {}", way(4));
        }
    }
    // Broken numbers and negative ones are no indices.
    for bad in ["0.5", "-1.0", "1e99", "-0.0"] {
        let text = written(&room().whole(), &["/nodes/0/mesh".into()], &|_| bad.to_owned());
        assert!(read_text(&text, &room()).is_err(), "{bad}");
    }
}

/// Buffers that nothing reads need no bytes, whether a bufferView names them or not; those that are read do.
#[test]
fn buffers_that_nothing_reads_need_no_bytes() {
    let model = room();
    let length = model.bytes.len();
    let with = |buffers: Value, more: &dyn Fn(&mut Value)| {
        let mut changed = model.clone();
        changed.json["buffers"] = buffers;
        more(&mut changed.json);
        read(&changed, &Default::default())
    };
    let view = |json: &mut Value| {
        let views = json["bufferViews"].as_array_mut().unwrap();
        views.push(json!({ "buffer": 1, "byteOffset": 8, "byteLength": 8 }));
    };
    let unread = |json: &mut Value| {
        view(json);
        let last = json["bufferViews"].as_array().unwrap().len() - 1;
        let accessor = json!({ "bufferView": last, "componentType": F32, "count": 2, "type": "SCALAR" });
        json["accessors"].as_array_mut().unwrap().push(accessor);
    };
    let drawn = |json: &mut Value| {
        unread(json);
        let last = json["accessors"].as_array().unwrap().len() - 1;
        json["meshes"][0]["primitives"][0]["indices"] = json!(last);
    };
    let two = json!([{ "byteLength": length }, { "byteLength": 16 }]);
    let changes: [&dyn Fn(&mut Value); 3] = [&|_| (), &view, &unread];
    for more in changes {
        assert_eq!(with(two.clone(), more).unwrap().data, load(&model).data);
    }
    let error = with(two, &drawn).err().unwrap().line();
    assert!(error.contains("buffers[1]: only the first buffer may have no uri"), "{error}");
    let mut bare = Model::default();
    bare.json["buffers"] = json!([{ "byteLength": 4 }]);
    assert_eq!(load(&bare).data.entities.len(), 0, "there is no binary part");
}

/// Lights of another type, and accessors of another type that nothing draws, are left out.
#[test]
fn unknown_types_are_left_out() {
    let whole = load(&room()).data.entities.len();
    for kind in ["area", "Point", "", "ambient", "spot "] {
        let mut model = room();
        model.json["extensions"]["KHR_lights_punctual"]["lights"][0]["type"] = json!(kind);
        let import = load(&model);
        assert_eq!(import.data.entities.len(), whole - 1, "{kind}");
        assert!(import.notes.left_out().contains(&"left out (1): lights of unknown types".to_owned()), "{kind}");
    }
    for (component, kind) in [(F32, "VEC5"), (5124, "SCALAR"), (5130, "VEC2"), (0, ""), (F32, "vec3")] {
        let mut model = room();
        let unknown = json!({ "bufferView": 0, "componentType": component, "count": 1, "type": kind });
        model.push("accessors", unknown.clone());
        assert_eq!(load(&model).data.entities.len(), whole, "{kind}");
        model.json["accessors"][0] = unknown;
        let error = read(&model, &Default::default()).err().unwrap().line();
        assert!(error.contains("accessors[0].") && error.contains("ype: the value is not a valid one"), "{error}");
    }
}

/// Words that a later version may add, and primitives without positions, do not keep a file from being read.
#[test]
fn unlisted_words_and_primitives_without_positions_are_left_out() {
    let whole = load(&room()).data;
    for (list, item) in [
        ("materials", json!({ "alphaMode": "DITHER" })),
        ("samplers", json!({ "wrapS": 1, "wrapT": 2, "magFilter": 3, "minFilter": 4 })),
        ("bufferViews", json!({ "buffer": 0, "byteLength": 4, "target": 5 })),
        ("cameras", json!({ "type": "fisheye", "perspective": { "yfov": 1, "znear": 1 } })),
    ] {
        let mut model = room();
        model.push(list, item);
        assert_eq!(load(&model).data, whole, "{list}");
    }
    let mut model = room();
    model.json["meshes"][0]["primitives"][0]["attributes"].as_object_mut().unwrap().remove("POSITION");
    let import = load(&model);
    assert!(import.data.entities.len() < whole.entities.len());
    let note = "left out (1): primitives without positions".to_owned();
    assert!(import.notes.left_out().contains(&note), "{:?}", import.notes.left_out());
}

/// A matrix beside other transformations counts alone, and rotations are brought to unit length: both are said.
#[test]
fn odd_transformations_are_noted() {
    let unit = json!([0, 0, 0, 1]);
    let matrix = json!([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 2, 0, 0, 1]);
    let one = |rotation: Value| json!({ "mesh": 0, "rotation": rotation });
    for (node, note) in [
        (json!({ "mesh": 0, "matrix": matrix, "translation": [9, 0, 0] }), "nodes that have a matrix"),
        (json!({ "mesh": 0, "matrix": matrix, "rotation": unit }), "nodes that have a matrix"),
        (json!({ "mesh": 0, "matrix": matrix, "scale": [2, 2, 2] }), "nodes that have a matrix"),
        (json!({ "mesh": 0, "matrix": matrix }), ""),
        (one(json!([0, 0, 0, 2])), "rotations that are not 1"),
        (one(json!([0, 0.5, 0, 0.5])), "rotations that are not 1"),
        (one(json!([0, 0, 0, 0.99])), "rotations that are not 1"),
        (one(json!([0, 0.7071, 0, 0.7071])), ""),
        (one(unit.clone()), ""),
    ] {
        let mut model = Model::default();
        model.cuboid([-0.5; 3], [0.5; 3], None);
        model.node(node.clone());
        let import = load(&model);
        let notes = import.notes.left_out().join("\n");
        assert!(if note.is_empty() { !notes.contains("rotations") } else { notes.contains(note) }, "{node}: {notes}");
        let entity = &import.data.entities[0];
        let expected = if node.get("matrix").is_some() { 2.0 } else { 0.0 };
        assert!(entity.position.x == expected && entity.scale == 1.0, "{node}: {entity:?}");
    }
}
