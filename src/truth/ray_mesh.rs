//! Meshes for ray casting, in units of the bounding radius from the bounding sphere's centre.

use crate::asset::mesh::Mesh;
use crate::bake::triangles::unit_positions;
use crate::bake::{bakes_transfer, first_shell};
use crate::field::Fit;
use crate::field::lattice::ROOMY_INNER;
use crate::scene::Scene;
use glam::{DVec3, Vec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::cwbvh::{CwBvh, builder::build_cwbvh_from_tris};
use obvhs::ray::{Ray, RayHit};
use obvhs::triangle::Triangle;
use rayon::prelude::*;
use std::sync::Arc;
use std::time::Duration;

/// Lengths in a hierarchy over bounding radii. [`CwBvh`] leaves out every box that a ray has left 1e-4 after its start:
/// of a flat mesh, whose boxes have no depth, all that lies so near. This makes it 1e-7 bounding radii. A power of two
/// rounds nothing.
const ENLARGED: f32 = 1024.0;

/// One mesh with its bounding volume hierarchy.
pub struct RayMesh {
    hierarchy: CwBvh,
    /// Triangles in the order of the hierarchy's leaves, [`ENLARGED`] as those are.
    triangles: Vec<Triangle>,
    /// Colours of the corners of the mesh's triangles, where it has any.
    colors: Option<Vec<[Vec3; 3]>>,
    /// Radius (in bounding radii) of a sphere around the centre that lies within a convex mesh; 0 for all other meshes.
    pub inner_radius: f32,
    /// Whether it can shadow itself.
    pub self_shadowing: bool,
    /// Unit normal of its plane, of a flat mesh.
    pub normal: Option<DVec3>,
}

/// The meshes of a scene, in its order.
pub struct RayMeshes(pub Vec<Arc<RayMesh>>);

impl RayMeshes {
    /// Builds every hierarchy, which takes milliseconds per mesh.
    pub fn new(scene: &Scene) -> Self {
        RayMeshes(scene.meshes.par_iter().map(|mesh| Arc::new(RayMesh::new(mesh))).collect())
    }
}

impl RayMesh {
    /// Builds the hierarchy of one mesh.
    pub fn new(mesh: &Mesh) -> Self {
        let positions = unit_positions(mesh);
        let corner = |i: u32| ENLARGED * Vec3A::from(positions[i as usize]);
        let unsorted: Vec<Triangle> =
            mesh.triangles.iter().map(|t| Triangle { v0: corner(t[0]), v1: corner(t[1]), v2: corner(t[2]) }).collect();
        let hierarchy = build_cwbvh_from_tris(&unsorted, BvhBuildParams::slow_build(), &mut Duration::default());
        let of_triangle = |colors: &Vec<Vec3>| mesh.triangles.iter().map(|t| t.map(|v| colors[v as usize])).collect();
        let inner = if mesh.is_convex() { first_shell(&Fit::ROUND, &positions, &mesh.triangles) } else { ROOMY_INNER };
        RayMesh {
            triangles: hierarchy.primitive_indices.iter().map(|&i| unsorted[i as usize]).collect(),
            hierarchy,
            colors: mesh.colors.as_ref().map(of_triangle),
            // `first_shell` answers with a shell off the surface where the mesh nearly fills its sphere.
            inner_radius: if inner > ROOMY_INNER { inner.min(0.93) as f32 } else { 0.0 },
            self_shadowing: bakes_transfer(mesh),
            normal: mesh.plane_normal(),
        }
    }

    /// Whether a ray (unit direction) meets the mesh nearer than `limit` bounding radii; infinity is no limit. The
    /// first triangle found ends the search.
    pub fn blocks(&self, origin: Vec3A, direction: Vec3A, limit: f32) -> bool {
        if limit <= 0.0 {
            return false;
        }
        let ray = Ray::new(ENLARGED * origin, direction, 0.0, ENLARGED * limit);
        // The distance that `intersect_embree` returns has a scale that depends on the triangle, but its test of the
        // limit has not.
        let met = |ray: &Ray, id: usize| {
            if self.triangles[id].intersect_embree(ray).is_finite() { 0.0 } else { f32::INFINITY }
        };
        !self.hierarchy.ray_traverse_miss(ray, met)
    }

    /// Distance along a ray to its first intersection with the mesh.
    pub fn first_hit(&self, origin: Vec3A, direction: Vec3A) -> Option<f32> {
        self.nearest(origin, direction).map(|hit| hit.t / ENLARGED)
    }

    /// A ray's first intersection: its distance, the triangle's number in the mesh, and the weights of the triangle's
    /// corners there.
    pub fn corners_hit(&self, origin: Vec3A, direction: Vec3A) -> Option<(f32, usize, [f32; 3])> {
        let hit = self.nearest(origin, direction)?;
        let weights = self.weights(hit.primitive_id as usize, ENLARGED * origin + hit.t * direction);
        Some((hit.t / ENLARGED, self.hierarchy.primitive_indices[hit.primitive_id as usize] as usize, weights))
    }

    /// Areas of the three parts that a point, [`ENLARGED`], cuts a triangle into, as shares; of a triangle without
    /// area, its first corner.
    fn weights(&self, triangle: usize, at: Vec3A) -> [f32; 3] {
        let triangle = &self.triangles[triangle];
        let a = triangle.v0 - at;
        let b = triangle.v1 - at;
        let c = triangle.v2 - at;
        let areas = [b.cross(c).length(), c.cross(a).length(), a.cross(b).length()];
        let total: f32 = areas.iter().sum();
        if total > 0.0 { areas.map(|area| area / total) } else { [1.0, 0.0, 0.0] }
    }

    /// A ray's first intersection, whose distance is [`ENLARGED`].
    fn nearest(&self, origin: Vec3A, direction: Vec3A) -> Option<RayHit> {
        let ray = Ray::new_inf(ENLARGED * origin, direction);
        let mut hit = RayHit::none();
        // `intersect_embree` is no alternative: its distance has a scale that depends on the triangle.
        self.hierarchy.ray_traverse(ray, &mut hit, |ray, id| self.triangles[id].intersect(ray)).then_some(hit)
    }

    /// Whether its emission is constant over the surface.
    pub fn is_plain(&self) -> bool {
        self.colors.is_none()
    }

    /// Emission pattern at a ray's first intersection: 1 for a mesh without colours, `None` if the ray misses.
    pub fn emission(&self, origin: Vec3A, direction: Vec3A) -> Option<Vec3> {
        let Some(colors) = &self.colors else {
            return self.blocks(origin, direction, f32::INFINITY).then_some(Vec3::ONE);
        };
        let (_, triangle, weights) = self.corners_hit(origin, direction)?;
        Some(colors[triangle].iter().zip(weights).map(|(color, weight)| *color * weight).sum())
    }
}
