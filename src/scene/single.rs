//! A mesh alone as a scene: on a floor, before a camera that sees all of it, under a generated sky.

use super::data::{Camera, EntityData};
use super::gltf::pieces;
use super::{Scene, SceneBuilder};
use crate::asset::environment::EnvironmentData;
use crate::asset::sky::Sky;
use crate::asset::{Generator, Mesh};
use crate::error::{Error, Result};
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

/// A mesh that may consist of pieces, see [`pieces::solids`].
pub(super) struct Apart {
    whole: Mesh,
    numbers: Vec<u32>,
}

impl Apart {
    pub fn new(whole: Mesh) -> Self {
        Apart { numbers: pieces::solids(&whole.positions, &whole.triangles), whole }
    }

    /// How many pieces there are, at least 1.
    fn count(&self) -> u32 {
        self.numbers.iter().max().map_or(1, |last| last + 1)
    }

    /// The piece of that number, if there is one.
    pub fn piece(&self, piece: u32) -> Result<Mesh> {
        let Mesh { name, positions, normals, .. } = &self.whole;
        let numbered = self.whole.triangles.iter().zip(&self.numbers);
        let own: Vec<[u32; 3]> = numbered.filter(|(_, number)| **number == piece).map(|(of, _)| *of).collect();
        if own.is_empty() {
            return Err(Error::Input(format!("there is no piece {piece}: it has {}", self.count())));
        }
        Mesh::with_attributes(name, positions.clone(), normals.clone(), self.whole.attributes(), own)
    }
}

/// Reads an OBJ file as a scene, its pieces as entities of their own.
pub(super) fn load(path: &Path) -> Result<Scene> {
    let apart = Apart::new(Mesh::load(path)?);
    let mesh = &apart.whole;
    let (centre, radius_m) = mesh.bounding_sphere();
    let lowest = mesh.positions.iter().map(|p| p.y).fold(f32::INFINITY, f32::min);
    let floor = Generator::Plane { size_m: FLOOR_RADII * radius_m, cells: FLOOR_CELLS };
    let object = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let ground = if object == "floor" { "ground" } else { "floor" };
    let below = Vec3::new(centre.x, lowest, centre.z);
    let mut builder = SceneBuilder::default()
        .camera(Camera::new(centre + radius_m * EYE_RADII, centre))
        .environment(EnvironmentData { sky: Some(Sky::default()), ..EnvironmentData::default() });
    let count = apart.count();
    for piece in 0..count {
        let name = if count == 1 { object.clone() } else { format!("{object}, piece {piece}") };
        builder = builder
            .mesh(&name, apart.piece(piece)?)
            .entity(EntityData { name: Some(name.clone()), ..EntityData::of_mesh(&name) });
    }
    let mut scene = builder
        .mesh(ground, floor)
        .entity(EntityData { name: Some(ground.to_owned()), position: below, ..EntityData::of_mesh(ground) })
        .build()
        .map_err(|error| error.context(path.display()))?;
    for (piece, mesh) in (0..count).zip(&mut scene.data.meshes) {
        mesh.file = path.file_name().map(PathBuf::from);
        mesh.piece = (count > 1).then_some(piece);
    }
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

    /// Two boxes of one file are two entities, also where a scene names a piece.
    #[test]
    fn solids_of_an_obj_file_are_entities() {
        let folder = tempfile::tempdir().unwrap();
        let mut text = String::new();
        let solid = Generator::Cuboid { size_m: Vec3::ONE, cells: 1 }.build().unwrap();
        for (first, x) in [(1, 0.0), (1 + solid.positions.len(), 5.0)] {
            solid.positions.iter().for_each(|p| text += &format!("v {} {} {}\n", p.x + x, p.y, p.z));
            let corners = solid.triangles.iter().map(|triangle| triangle.map(|v| first + v as usize));
            corners.for_each(|[a, b, c]| text += &format!("f {a} {b} {c}\n"));
        }
        std::fs::write(folder.path().join("two.obj"), text).unwrap();
        let scene = Scene::load(&folder.path().join("two.obj")).unwrap();
        assert_eq!(scene.entities.len(), 4, "two boxes, the floor, and the sky's sun");
        assert_eq!(scene.entities[1].name, "two, piece 1");
        assert!(scene.meshes[1].cuboid().is_some());
        let saved = folder.path().join("saved.toml");
        let text = scene.to_toml().unwrap();
        std::fs::write(&saved, &text).unwrap();
        let again = Scene::load(&saved).unwrap();
        assert_eq!(again.data, scene.data);
        assert_eq!(again.meshes[1].content_hash(), scene.meshes[1].content_hash());
        std::fs::write(&saved, text.replace("piece = 1", "piece = 2")).unwrap();
        let error = Scene::load(&saved).unwrap_err().to_string();
        assert!(error.ends_with("there is no piece 2: it has 2"), "{error}");
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
