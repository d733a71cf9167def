//! What bakes store: fields and outlines.

use super::common::generate;
use super::targets::{NAME, framed, unframed, with_file};
use glam::DVec3;
use serde::de::DeserializeOwned;
use shadow_fields::field::file::{self, FIELD_MAGIC};
use shadow_fields::field::silhouette::{SILHOUETTE_MAGIC, SilhouetteField, SilhouetteHeader};
use shadow_fields::field::{FieldKind, ShadowField, Storage};
use shadow_fields::{Error, Result, bake};
use std::path::Path;

fn written(write: impl FnOnce(&Path)) -> Vec<u8> {
    with_file(&[], |path| {
        write(path);
        unframed(&std::fs::read(path).unwrap())
    })
}

fn field_of(kind: FieldKind, storage: Storage, lattice: &str) -> ShadowField {
    let options =
        bake::Options { storage, lattice: lattice.parse().unwrap(), bands: 2, face_px: 16, ..Default::default() };
    let header = bake::header(&generate::sphere(0.7, 0), kind, &options);
    let payload = (0..header.payload_bytes()).map(|i| (i * 37) as u8 & 0x3f).collect();
    ShadowField { header, payload }
}

pub fn fields() -> Vec<Vec<u8>> {
    let one = field_of(FieldKind::Occlusion, Storage::F16, "cube:2x3");
    let other = field_of(FieldKind::Radiance, Storage::F32, "cube:2x1,edges,inner=0.3,outer=5");
    [one, other].map(|field| written(|path| field.write(path).unwrap())).into()
}

/// What [`file::read`] says to a file of such content, without the file, which would take twice as long.
fn stored_file<H: DeserializeOwned>(bytes: &[u8], magic: [u8; 8]) -> Result<(H, Vec<u8>)> {
    let bytes = framed(bytes, magic);
    file::read_from(&*bytes, bytes.len() as u64, Path::new(NAME), magic)
}

pub fn field(bytes: &[u8]) -> Result<()> {
    let (header, payload) = stored_file(bytes, FIELD_MAGIC)?;
    let field = ShadowField::new(header, payload).map_err(|error| Error::input(Path::new(NAME), error))?;
    let mut out = vec![0.0; field.header.bands * field.header.bands];
    for at in [DVec3::new(0.0, 1.5, 0.2), DVec3::new(-30.0, 1.0, 4.0), DVec3::ZERO] {
        field.lookup(at, 0, &mut out);
    }
    Ok(())
}

fn outline_field() -> SilhouetteField {
    let header = SilhouetteHeader {
        cells: 1,
        map_px: 8,
        view_px: 16,
        half_px: 4,
        level_pixels: 0.0,
        centre_m: [0.0; 3],
        radius_m: 1.0,
        extent: [[-0.5; 3], [0.5; 3]],
        faces: vec![[0.6, 0.8, 0.0, 0.7]],
        mesh: "m".into(),
        mesh_hash: String::new(),
    };
    let map: Vec<u8> = [0.0_f32, 0.0, 0.5, 0.5].iter().flat_map(|x| x.to_le_bytes()).chain([9; 128 + 2 * 32]).collect();
    let payload = map.repeat(header.map_count());
    SilhouetteField::new(header, payload).unwrap()
}

pub fn outlines() -> Vec<Vec<u8>> {
    vec![written(|path| outline_field().write(path).unwrap())]
}

pub fn outline(bytes: &[u8]) -> Result<()> {
    let (header, payload) = stored_file(bytes, SILHOUETTE_MAGIC)?;
    let field = SilhouetteField::new(header, payload).map_err(|error| Error::input(Path::new(NAME), error))?;
    for direction in [DVec3::X, DVec3::new(0.3, -0.8, 0.52).normalize()] {
        let near = field.near(DVec3::new(0.4, 2.0, -0.1), direction);
        let blocked = field.blocked(&near, direction, 1.0, 0.1);
        assert!((0.0..=1.0).contains(&blocked), "{blocked} of a light is blocked");
    }
    Ok(())
}
