//! Primitives at rest that become one mesh: all of a file, or neighbours of one material where a file has more than a
//! scene holds.

use glam::{DAffine3, DVec3, Vec3};

use super::document::Document;
use super::shape::Shape;
use crate::asset::Mesh;
use crate::asset::enclose::around_boxes;
use crate::asset::mesh::Attributes;
use crate::error::Result;

/// Largest number of triangles of all meshes of a scene.
const TRIANGLES_LIMIT: usize = 16_000_000;

/// Triangles of several shapes in the world.
#[derive(Default)]
pub struct Joined {
    positions: Vec<Vec3>,
    normals: Vec<Vec3>,
    attributes: Attributes,
    triangles: Vec<[u32; 3]>,
}

impl Joined {
    /// Adds a shape where it stands. All shapes have the same kinds of attributes.
    pub fn add(&mut self, document: &Document, shape: &Shape, place: DAffine3, attributes: &Attributes) -> Result<()> {
        let (positions, normals, triangles) = shape.bent(place.matrix3, place.translation);
        let first = self.positions.len() as u32;
        self.positions.extend(positions);
        self.normals.extend(normals);
        self.attributes.extend(attributes);
        self.triangles.extend(triangles.iter().map(|t| t.map(|i| i + first)));
        check_triangles(document, shape, self.triangles.len())
    }

    pub fn mesh(self, name: &str) -> Result<Mesh> {
        Mesh::with_attributes(name, self.positions, self.normals, self.attributes, self.triangles)
    }
}

/// Refuses a shape with which a scene has more triangles than it may have.
pub fn check_triangles(document: &Document, shape: &Shape, count: usize) -> Result<()> {
    if count > TRIANGLES_LIMIT {
        return Err(document.fail(&shape.place, format!("over the limit of {TRIANGLES_LIMIT} triangles in all")));
    }
    Ok(())
}

/// A primitive that may be joined with others.
pub struct Candidate<K> {
    /// Number of its part.
    pub part: usize,
    /// Only equal kinds are joined.
    pub kind: K,
    pub centre: DVec3,
    pub radius_m: f64,
    pub triangle_count: usize,
}

/// Largest radius of what is joined, over the edge of the box around all centres: a ground stays alone.
const WIDEST: f64 = 0.1;

/// Groups of neighbours of one kind, `count` to twice as many in all and one more a kind, each of at most
/// `triangle_limit` triangles or of one candidate. Wide ones are in none.
pub fn neighbours<K: Ord>(mut candidates: Vec<Candidate<K>>, count: usize, triangle_limit: usize) -> Vec<Vec<usize>> {
    let edge = extent(&candidates).max_element();
    candidates.retain(|c| c.radius_m <= WIDEST * edge);
    candidates.sort_by(|a, b| a.kind.cmp(&b.kind));
    let size = candidates.len().div_ceil(count);
    let mut groups = Vec::new();
    for alike in candidates.chunk_by_mut(|a, b| a.kind == b.kind) {
        halve(alike, &mut groups, &|group| {
            group.len() <= size && group.iter().map(|c| c.triangle_count).sum::<usize>() <= triangle_limit
        });
    }
    groups
}

/// Halves candidates across their longest extent until each group fits.
pub fn halve<K>(group: &mut [Candidate<K>], out: &mut Vec<Vec<usize>>, fits: &impl Fn(&[Candidate<K>]) -> bool) {
    if group.len() == 1 || fits(group) {
        return out.push(group.iter().map(|c| c.part).collect());
    }
    let axis = extent(group).max_position();
    group.sort_by(|a, b| a.centre[axis].total_cmp(&b.centre[axis]));
    let (before, behind) = group.split_at_mut(group.len() / 2);
    halve(before, out, fits);
    halve(behind, out, fits);
}

/// Edges of the box around all centres.
fn extent<K>(candidates: &[Candidate<K>]) -> DVec3 {
    around_boxes(candidates.iter().map(|c| [c.centre; 2])).map_or(DVec3::ZERO, |[low, high]| high - low)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbours_of_one_kind_are_joined() {
        let candidate = |part: usize| Candidate {
            part,
            kind: part % 2,
            centre: DVec3::new(if part < 8 { 0.0 } else { 100.0 } + part as f64, 0.0, -3.0),
            radius_m: if part == 16 { 200.0 } else { 0.5 },
            triangle_count: if part == 15 { 90 } else { 12 },
        };
        let groups = neighbours((0..17).rev().map(candidate).collect(), 4, 100);
        assert_eq!(groups, [vec![0, 2, 4, 6], vec![8, 10, 12, 14], vec![1, 3, 5, 7], vec![9, 11], vec![13], vec![15]]);
        let two = neighbours(vec![candidate(3), candidate(15)], 4, 10);
        assert_eq!(two, [vec![3], vec![15]], "one alone may have more triangles");
    }
}
