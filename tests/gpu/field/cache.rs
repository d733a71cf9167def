//! Baked fields and transfers through the cache.

use super::{quiet, small, torus};
use crate::common::{generate, gpu, library};
use glam::Vec3;
use shadow_fields::asset::Mesh;
use shadow_fields::bake::cache::Cache;
use shadow_fields::bake::surfaces::GroupPlan;
use shadow_fields::bake::{self, Baker, Wanted};
use shadow_fields::field::{FieldHeader, FieldKind, ShadowField, Storage};
use shadow_fields::gpu::Device;
use std::path::{Path, PathBuf};
use std::sync::Arc;

fn files(folder: &Path, ending: &str) -> Vec<PathBuf> {
    let Ok(entries) = std::fs::read_dir(folder.join("fields")) else { return Vec::new() };
    let mut paths: Vec<_> = entries.map(|e| e.unwrap().path()).collect();
    paths.retain(|path| path.extension().is_some_and(|e| e == ending));
    paths.sort();
    paths
}

/// A field that comes through the cache, and whether it was baked.
fn cached(device: &Arc<Device>, folder: &Path, mesh: &Mesh, header: &FieldHeader) -> (bool, ShadowField) {
    let cache = Cache::new(Some(folder));
    let (field, report) = cache.field(&Baker::new(device, &library()), mesh, header, &quiet).unwrap();
    (report.is_some(), ShadowField::clone(&field))
}

#[test]
fn the_cache_finds_what_it_holds_and_replaces_what_is_damaged() {
    let Some(gpu) = gpu() else { return };
    let folder = tempfile::tempdir().unwrap();
    let mesh = torus();
    let options = small("cube:10x5", Storage::F16, 4);
    let header = bake::header(&mesh, FieldKind::Occlusion, &options);
    let run = |mesh: &Mesh, header: &FieldHeader| cached(&gpu.device, folder.path(), mesh, header);
    let (baked, first) = run(&mesh, &header);
    assert!(baked && first.header.filled_samples > 0);
    // The header again, and as it came back, with its count of filled samples.
    for header in [&header, &first.header] {
        assert!(run(&mesh, header) == (false, first.clone()), "the count of filled samples comes from the file");
    }
    // The name of a mesh is for people; equal content is found under any name.
    let mut renamed = mesh.clone();
    renamed.name = "other".into();
    assert!(!run(&renamed, &bake::header(&renamed, FieldKind::Occlusion, &options)).0);

    let paths = files(folder.path(), "sf");
    assert_eq!(paths.len(), 1);
    let whole = std::fs::read(&paths[0]).unwrap();
    let mut flipped = whole.clone();
    flipped[whole.len() / 2] ^= 4;
    for bad in [&flipped[..], &whole[..whole.len() - 1], &[]] {
        std::fs::write(&paths[0], bad).unwrap();
        assert!(run(&mesh, &header) == (true, first.clone()), "baked anew");
        assert!(std::fs::read(&paths[0]).unwrap() == whole, "and replaced");
    }
    // Everything that changes a field has a file of its own.
    let others = [
        bake::Options { bands: 3, ..options },
        bake::Options { face_px: 16, ..options },
        bake::Options { storage: Storage::F32, ..options },
        small("cube:4x3,outer=7", Storage::F16, 4),
    ];
    for (i, other) in others.iter().enumerate() {
        assert!(run(&mesh, &bake::header(&mesh, FieldKind::Occlusion, other)).0, "{other:?}");
        assert_eq!(files(folder.path(), "sf").len(), 2 + i);
    }
}

#[test]
fn a_file_under_another_name_is_not_believed() {
    let Some(gpu) = gpu() else { return };
    let folder = tempfile::tempdir().unwrap();
    let options = small("cube:3x3,inner=1.02", Storage::F16, 4);
    let meshes = [torus(), generate::cuboid(Vec3::ONE, 2)];
    let run =
        |mesh: &Mesh| cached(&gpu.device, folder.path(), mesh, &bake::header(mesh, FieldKind::Occlusion, &options));
    let (_, first) = run(&meshes[0]);
    let name = files(folder.path(), "sf").remove(0);
    let (_, second) = run(&meshes[1]);
    assert!(first != second);
    let other = files(folder.path(), "sf").into_iter().find(|path| *path != name).unwrap();
    std::fs::copy(&other, &name).unwrap();
    assert!(run(&meshes[0]) == (true, first), "a whole file, but another mesh's");
}

#[test]
fn the_cache_keeps_surfaces_and_bakes_damaged_ones_anew() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = generate::torus(1.0, 0.3, 12, 8);
    let cache = Cache::new(Some(folder.path()));
    let mesh = Arc::new(mesh);
    let run = |bands| {
        let options = bake::Options { bands, ..Default::default() };
        let (found, baked) = cache.surfaces(&GroupPlan::alone(&mesh, &options, Wanted::BOTH), &quiet);
        let surface = found[0].clone();
        ((surface.transfer.unwrap(), surface.self_visibility.unwrap()), baked)
    };
    let (first, baked) = run(3);
    assert!(baked.is_some());
    let (second, found) = run(3);
    assert!(found.is_none() && second == first);
    let paths = files(folder.path(), "view");
    assert_eq!(paths.len(), 1);
    let bytes = std::fs::read(&paths[0]).unwrap();
    let altered = |at: usize| bytes.iter().enumerate().map(|(i, b)| if i == at { b ^ 1 } else { *b }).collect();
    let damaged: [Vec<u8>; 5] =
        [bytes[..bytes.len() - 5].to_vec(), altered(bytes.len() - 1), altered(2), altered(60), Vec::new()];
    for content in damaged {
        std::fs::write(&paths[0], &content).unwrap();
        let (again, baked) = run(3);
        assert!(baked.is_some() && again == first, "{} bytes are baked anew", content.len());
        assert_eq!(std::fs::read(&paths[0]).unwrap(), bytes, "and kept");
    }
    assert!(run(3).1.is_none(), "replaced");
    assert!(run(4).1.is_some(), "other bands have their own");
}

#[test]
fn without_a_folder_a_bake_is_kept_in_memory() {
    let Some(gpu) = gpu() else { return };
    let mesh = generate::torus(1.0, 0.3, 12, 8);
    let options = small("cube:2x1", Storage::F16, 2);
    let baker = gpu.baker();
    let header = bake::header(&mesh, FieldKind::Occlusion, &options);
    let alone = GroupPlan::alone(&Arc::new(mesh.clone()), &options, Wanted::TRANSFER);
    for _ in 0..2 {
        let cache = Cache::new(None);
        let run = || {
            let (field, baked) = cache.field(&baker, &mesh, &header, &quiet).unwrap();
            let (surfaces, seen) = cache.surfaces(&alone, &quiet);
            (field, surfaces[0].transfer.clone(), [baked.is_some(), seen.is_some()])
        };
        assert!(!cache.has_field(&header) && !cache.has_surfaces(&alone));
        let (first, second) = (run(), run());
        assert!(cache.has_field(&header) && cache.has_surfaces(&alone));
        assert_eq!([first.2, second.2], [[true; 2], [false; 2]], "another cache knows nothing of it");
        assert!(first.0 == second.0 && first.1 == second.1);
    }
}
