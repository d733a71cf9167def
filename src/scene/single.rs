//! A mesh alone as a scene: on a floor, before a camera that sees all of it, under a generated sky.

use super::data::{Camera, EntityData};
use super::{Scene, SceneBuilder};
use crate::asset::environment::EnvironmentData;
use crate::asset::sky::Sky;
use crate::asset::{Generator, Mesh};
use crate::error::Result;
use glam::Vec3;
use std::path::{Path, PathBuf};

/// Edge of the floor, in radii of the mesh.
const FLOOR_RADII: f32 = 8.0;
/// Squares along an edge of the floor.
const FLOOR_CELLS: u32 = 64;
/// Position of the eye from the mesh's centre, in radii: from before, above and the right, at a distance from which a
/// view of 40 degrees holds the bounding sphere with a margin.
const EYE_RADII: Vec3 = Vec3::new(1.4, 1.5, 3.0);

/// Whether a path names an OBJ file, by its ending.
pub fn is_obj(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("obj"))
}

/// Reads an OBJ file as a scene.
pub(super) fn load(path: &Path) -> Result<Scene> {
    let mesh = Mesh::load(path)?;
    let (centre, radius_m) = mesh.bounding_sphere();
    let lowest = mesh.positions.iter().map(|p| p.y).fold(f32::INFINITY, f32::min);
    let floor = Generator::Plane { size_m: FLOOR_RADII * radius_m, cells: FLOOR_CELLS };
    let object = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let names = [object.as_str(), if object == "floor" { "ground" } else { "floor" }];
    let below = Vec3::new(centre.x, lowest, centre.z);
    let mut scene = SceneBuilder::default()
        .camera(Camera::new(centre + radius_m * EYE_RADII, centre))
        .environment(EnvironmentData { sky: Some(Sky::default()), ..EnvironmentData::default() })
        .mesh(names[0], mesh)
        .mesh(names[1], floor)
        .entity(EntityData { name: Some(names[0].to_owned()), ..EntityData::of_mesh(names[0]) })
        .entity(EntityData { name: Some(names[1].to_owned()), position: below, ..EntityData::of_mesh(names[1]) })
        .build()
        .map_err(|error| error.context(path.display()))?;
    scene.data.meshes[0].file = path.file_name().map(PathBuf::from);
    Ok(scene)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_obj_file_stands_on_a_floor_in_view() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("floor.OBJ");
        std::fs::write(&path, "v 10 5 0\nv 12 5 0\nv 10 9 0\nv 10 5 3\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n").unwrap();
        let scene = Scene::load(&path).unwrap();
        assert_eq!(scene.entities.len(), 3, "the object, the floor, and the sky's sun");
        assert_eq!(scene.data.entities[1].position.y, 5.0, "the floor lies under it");
        assert!(scene.entities[0].occludes && scene.entities[1].occludes);
        let camera = &scene.data.camera;
        let (centre, radius_m) = scene.meshes[0].bounding_sphere();
        let half_deg = (radius_m / camera.eye.distance(centre)).asin().to_degrees();
        assert!((12.0..20.0).contains(&half_deg), "{half_deg} of the 20 degrees above the middle");
        // Saved as a scene file beside it, it is the same scene.
        let saved = folder.path().join("saved.toml");
        std::fs::write(&saved, scene.to_toml().unwrap()).unwrap();
        let again = Scene::load(&saved).unwrap();
        assert_eq!(again.data, scene.data);
        assert_eq!(again.meshes[0].content_hash(), scene.meshes[0].content_hash());
    }

    #[test]
    fn a_mesh_outside_a_scene_s_lengths_is_refused_in_one_line() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("dust.obj");
        std::fs::write(&path, "v 0 0 0\nv 1e-9 0 0\nv 0 1e-9 0\nf 1 2 3\n").unwrap();
        let error = Scene::load(&path).unwrap_err();
        assert!(error.exit_code() == 4 && error.to_string().starts_with(&path.display().to_string()), "{error}");
    }
}
