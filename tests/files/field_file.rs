//! Field files: what was written comes back, and nothing else is ever taken for a field.

use crate::common::generate;
use fastrand::Rng;
use serde::Serialize;
use shadow_fields::field::file::{self, FIELD_MAGIC, SURFACES_MAGIC};
use shadow_fields::field::{FieldHeader, FieldKind, Lattice, ShadowField, Storage};
use shadow_fields::{Error, bake};
use std::path::Path;

/// Offsets of the prologue, as the module's table states them.
const VERSION_AT: usize = 8;
const HEADER_LENGTH_AT: usize = 12;
const PAYLOAD_LENGTH_AT: usize = 16;

fn header(kind: FieldKind, storage: Storage, lattice: &str) -> FieldHeader {
    let options =
        bake::Options { storage, lattice: lattice.parse().unwrap(), bands: 2, face_px: 16, ..Default::default() };
    bake::header(&generate::sphere(0.7, 1), kind, &options)
}

fn field(kind: FieldKind, storage: Storage, lattice: &str, seed: u64) -> ShadowField {
    let header = header(kind, storage, lattice);
    let mut rng = Rng::with_seed(seed);
    let payload = (0..header.payload_bytes()).map(|_| rng.u8(..)).collect();
    ShadowField { header, payload }
}

fn small() -> ShadowField {
    field(FieldKind::Occlusion, Storage::F16, "cube:2x1", 1)
}

/// The refusal of a file: bad input, one line, that names the file.
fn refusal(path: &Path) -> String {
    let error = ShadowField::read(path).expect_err("a bad file was read");
    assert!(matches!(error, Error::Input(_)) && error.exit_code() == 4, "{error:?}");
    let message = error.to_string();
    assert!(message.contains(path.file_name().unwrap().to_str().unwrap()), "{message}");
    assert!(!message.contains('\n'), "{message}");
    message
}

#[test]
fn round_trip() {
    let folder = tempfile::tempdir().unwrap();
    let kinds = [
        (FieldKind::Occlusion, Storage::F16, "cube:3x3,inner=1.02"),
        (FieldKind::Occlusion, Storage::F32, "cube:3x3,edges,inner=0.3,outer=5.5"),
        (FieldKind::Radiance, Storage::F16, "cube:3x5"),
        (FieldKind::Radiance, Storage::F32, "cube:1x1"),
    ];
    for (i, (kind, storage, lattice)) in kinds.into_iter().enumerate() {
        let path = folder.path().join(format!("below/that/{i}.sf"));
        let mut written = field(kind, storage, lattice, i as u64);
        written.header.radiance_scale = 0.1 + i as f32;
        written.header.centre_m = [0.1, -1e-7, 3e6];
        written.header.mesh = "na\"me \u{e9}\n".into();
        written.write(&path).unwrap();
        assert_eq!(ShadowField::read(&path).unwrap(), written);
    }
}

/// A scene of thousands of entities has a header of megabytes.
#[test]
fn a_long_header_comes_back() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("long.view");
    let header: Vec<u32> = (0..1_000_000).collect();
    file::write(&path, SURFACES_MAGIC, &header, &[1, 2, 3]).unwrap();
    assert_eq!(file::read::<Vec<u32>>(&path, SURFACES_MAGIC).unwrap(), (header, vec![1, 2, 3]));
}

#[test]
fn every_cut_and_every_flipped_bit_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("damaged.sf");
    small().write(&path).unwrap();
    let whole = std::fs::read(&path).unwrap();
    for at in 0..whole.len() {
        std::fs::write(&path, &whole[..at]).unwrap();
        refusal(&path);
        for bit in 0..8 {
            let mut damaged = whole.clone();
            damaged[at] ^= 1 << bit;
            std::fs::write(&path, &damaged).unwrap();
            refusal(&path);
        }
    }
    std::fs::write(&path, &whole).unwrap();
    assert_eq!(ShadowField::read(&path).unwrap(), small(), "the whole file is good");
}

#[test]
fn other_kinds_versions_and_lengths_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("other.sf");
    small().write(&path).unwrap();
    let whole = std::fs::read(&path).unwrap();
    let with = |edit: &dyn Fn(&mut Vec<u8>)| {
        let mut bytes = whole.clone();
        edit(&mut bytes);
        std::fs::write(&path, bytes).unwrap();
        refusal(&path)
    };
    assert!(with(&|b| b[..8].copy_from_slice(&SURFACES_MAGIC)).contains("magic"));
    assert!(with(&|b| b[..8].copy_from_slice(b"\x89PNG\r\n\x1a\n")).contains("magic"));
    for other in [file::VERSION - 1, file::VERSION + 1] {
        let said = with(&|b| b[VERSION_AT..VERSION_AT + 4].copy_from_slice(&other.to_le_bytes()));
        assert!(said.contains(&format!("version {other}")), "{said}");
    }
    assert!(with(&|b| b.push(0)).contains("claims"));
    assert!(with(&|b| b.extend([7; 4096])).contains("claims"));
    // Lengths that would overflow or exhaust memory if they were believed.
    for length in [u64::MAX, u64::MAX - 55, 1 << 62, 4 << 30] {
        with(&|b| b[PAYLOAD_LENGTH_AT..PAYLOAD_LENGTH_AT + 8].copy_from_slice(&length.to_le_bytes()));
    }
    for length in [u32::MAX, 1 << 30, 0, 3] {
        with(&|b| b[HEADER_LENGTH_AT..HEADER_LENGTH_AT + 4].copy_from_slice(&length.to_le_bytes()));
    }
}

/// A file whose hash is right, whatever it holds: only the check of its header can refuse it.
fn sealed(path: &Path, header: &impl Serialize, payload: &[u8]) -> String {
    file::write(path, FIELD_MAGIC, header, payload).unwrap();
    refusal(path)
}

#[test]
fn headers_are_not_believed() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("sealed.sf");
    let good = small();
    let json = |edit: &dyn Fn(&mut serde_json::Value)| {
        let mut value = serde_json::to_value(&good.header).unwrap();
        edit(&mut value);
        value
    };
    // The way itself is sound: an unchanged header is accepted.
    file::write(&path, FIELD_MAGIC, &json(&|_| ()), &good.payload).unwrap();
    assert_eq!(ShadowField::read(&path).unwrap(), good);

    let lattice = |edit: &dyn Fn(&mut serde_json::Value)| json(&|header| edit(&mut header["lattice"]));
    let cells = |n: u32| lattice(&|l| l["cells"] = n.into());
    let message = sealed(&path, &cells(4083), &good.payload);
    assert!(message.contains("200050668 samples"), "{message}");
    for n in [u32::MAX, (1 << 31) + 1, 3_037_000_501, 4, 0] {
        sealed(&path, &cells(n), &good.payload);
    }
    // Within every limit, but not what the payload holds.
    assert!(sealed(&path, &cells(501), &good.payload).contains("claims"));
    assert!(sealed(&path, &json(&|_| ()), &good.payload[1..]).contains("claims"));
    assert!(sealed(&path, &json(&|_| ()), &[]).contains("claims"));

    let set = |name: &'static str, value: serde_json::Value| json(&move |h| h[name] = value.clone());
    for header in [
        set("bands", 1.into()),
        set("bands", 8.into()),
        set("bands", u64::MAX.into()),
        set("bands", (-1).into()),
        set("face_px", 0.into()),
        set("face_px", 2000.into()),
        set("radius_m", 0.into()),
        set("radius_m", (-1.0).into()),
        set("radius_m", 1e300.into()),
        set("radiance_scale", (-1.0).into()),
        set("radius_m", serde_json::Value::Null),
        set("kind", "elsewhere".into()),
        set("storage", 16.into()),
        set("centre_m", serde_json::json!([0.0, 0.0])),
        lattice(&|l| l["shells"] = 0.into()),
        lattice(&|l| l["inner"] = (-1.0).into()),
        lattice(&|l| l["outer"] = 0.0.into()),
        lattice(&|l| l["outer"] = 1e9.into()),
        serde_json::json!({}),
        serde_json::json!(17),
    ] {
        sealed(&path, &header, &good.payload);
    }
}

/// Names in the cache are hashes of headers.
#[test]
fn headers_are_what_they_were() {
    let text = r#"{"shells":20,"inner":0.0,"outer":8.0,"cells":7,"fit":null,"edges":null}"#;
    assert_eq!(serde_json::to_string(&Lattice::default()).unwrap(), text);
}
