//! Primitives of meshes as triangles.

use std::collections::HashMap;

use ::gltf::json::mesh::{Mode, Primitive, Semantic};
use ::gltf::json::validation::Checked;
use glam::{DAffine3, DMat3, DVec3, Vec2, Vec3};

use super::accessor;
use super::document::Document;
use super::notes::Notes;
use super::pose::Pose;
use crate::asset::mesh::{Attributes, TRIANGLE_LIMIT, area_m2, twice_area_m2};
use crate::asset::{Mesh, enclose, topology};
use crate::error::Result;

/// The triangles of a primitive. Where it has no normals, every triangle has vertices of its own with its own normal,
/// as the specification demands.
pub struct Shape {
    pub place: String,
    pub positions: Vec<Vec3>,
    normals: Vec<Vec3>,
    pub triangles: Vec<[u32; 3]>,
    /// The element of the accessors that each vertex has.
    source: Vec<u32>,
    attributes: HashMap<Semantic, usize>,
}

/// Accessors of a primitive by what they hold.
pub struct Attributed {
    pub place: String,
    attributes: HashMap<Semantic, usize>,
}

impl Attributed {
    fn new(place: String, primitive: &Primitive) -> Self {
        let valid = primitive.attributes.iter().filter_map(|(semantic, accessor)| match semantic {
            Checked::Valid(semantic) => Some((semantic.clone(), accessor.value())),
            Checked::Invalid => None,
        });
        Attributed { place, attributes: valid.collect() }
    }

    /// `width` numbers for each of `count` elements; `None` where there is no such attribute.
    pub fn numbers(&self, document: &Document, of: &Semantic, width: usize, count: usize) -> Result<Option<Vec<f32>>> {
        let Some(index) = self.attributes.get(of) else { return Ok(None) };
        let numbers = accessor::numbers(document, *index, &[width])?;
        if numbers.len() != width * count {
            return Err(document.fail(&self.place, format!("there are not as many {} as positions", of.to_string())));
        }
        Ok(Some(numbers))
    }
}

impl Shape {
    /// Reads a primitive; `None` where it is of points or lines, or has no positions or no area, which is noted.
    pub fn read(
        document: &Document,
        mesh: usize,
        at: usize,
        pose: Option<&Pose>,
        notes: &mut Notes,
    ) -> Result<Option<Self>> {
        let place = format!("meshes[{mesh}].primitives[{at}]");
        let primitive = &document.root.meshes[mesh].primitives[at];
        let attributed = Attributed::new(place.clone(), primitive);
        let attributes = &attributed.attributes;
        let Checked::Valid(mode) = primitive.mode else { return Ok(None) };
        if !matches!(mode, Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan) {
            notes.leave_out("primitives of points or lines");
            return Ok(None);
        }
        let Some(positions) = attributes.get(&Semantic::Positions) else {
            notes.leave_out("primitives without positions");
            return Ok(None);
        };
        let mut positions = accessor::triples(document, *positions)?;
        let normals = attributes.get(&Semantic::Normals).map(|index| accessor::triples(document, *index));
        let mut normals = normals.transpose()?;
        if normals.as_ref().is_some_and(|normals| normals.len() != positions.len()) {
            return Err(document.fail(&place, "there are not as many normals as positions"));
        }
        if let Some(pose) = pose {
            pose.bend(document, primitive, &attributed, &mut positions, normals.as_deref_mut())?;
        }
        let corners = match primitive.indices {
            Some(index) => accessor::indices(document, index.value())?,
            None => (0..positions.len() as u32).collect(),
        };
        if let Some(bad) = corners.iter().find(|corner| **corner as usize >= positions.len()) {
            let what = format!("index {bad} is out of range: there are {} vertices", positions.len());
            return Err(document.fail(format!("{place}.indices"), what));
        }
        let triangles = triangles(mode, &corners).map_err(|what| document.fail(&place, what))?;
        let attributes = attributed.attributes;
        let mut shape = match normals {
            Some(normals) => {
                let source = (0..positions.len() as u32).collect();
                Shape { place, positions, normals, triangles, source, attributes }
            }
            None => flat(place, &positions, &triangles, attributes),
        };
        if shape.triangles.len() > TRIANGLE_LIMIT {
            let what = format!("{} triangles are over the limit of {TRIANGLE_LIMIT}", shape.triangles.len());
            return Err(document.fail(&shape.place, what));
        }
        shape.triangles.shrink_to_fit();
        if area_m2(&shape.positions, &shape.triangles) == 0.0 {
            notes.leave_out("shapes without an area (all their triangles are points or lines)");
            return Ok(None);
        }
        Ok(Some(shape))
    }

    /// The mesh of those triangles whose numbers are kept, transformed by `bend`.
    pub fn mesh(
        &self,
        document: &Document,
        name: &str,
        bend: DMat3,
        attributes: Attributes,
        keeps: impl Fn(usize) -> bool,
    ) -> Result<Mesh> {
        let (positions, normals, mut triangles) = self.bent(bend, DVec3::ZERO);
        let mut numbers = 0..;
        triangles.retain(|_| numbers.next().is_some_and(&keeps));
        if triangles.is_empty() {
            return Err(document.fail(&self.place, "there is no such piece"));
        }
        Mesh::with_attributes(name, positions, normals, attributes, triangles)
            .map_err(|error| document.fail(&self.place, error))
    }

    /// For each vertex the mean, over the triangles around it, of a value that a triangle has between corners with these
    /// coordinates.
    pub fn vertex_means(&self, uvs: &[Vec2], of_triangle: impl Fn([Vec2; 3]) -> Vec3) -> Vec<Vec3> {
        let mut sums = vec![(Vec3::ZERO, 0.0); self.positions.len()];
        for triangle in &self.triangles {
            let area = area_m2(&self.positions, &[*triangle]) as f32;
            let value = of_triangle(triangle.map(|v| uvs[v as usize]));
            for &v in triangle {
                sums[v as usize].0 += area * value;
                sums[v as usize].1 += area;
            }
        }
        sums.into_iter().map(|(sum, area)| if area > 0.0 { sum / area } else { Vec3::ZERO }).collect()
    }

    /// The corners of each triangle where the shape stands.
    pub fn corners(&self, place: DAffine3) -> impl Iterator<Item = [Vec3; 3]> {
        let (positions, _, triangles) = self.bent(place.matrix3, place.translation);
        triangles.into_iter().map(move |triangle| triangle.map(|v| positions[v as usize]))
    }

    /// Positions, normals and triangles after a transformation; a mirrored surface keeps its outside.
    pub fn bent(&self, bend: DMat3, shift: DVec3) -> (Vec<Vec3>, Vec<Vec3>, Vec<[u32; 3]>) {
        if bend == DMat3::IDENTITY && shift == DVec3::ZERO {
            return (self.positions.clone(), self.normals.clone(), self.triangles.clone());
        }
        let positions = self.positions.iter().map(|p| (bend * p.as_dvec3() + shift).as_vec3()).collect();
        let upright = bend.inverse().transpose();
        let normals = self.normals.iter().map(|n| (upright * n.as_dvec3()).normalize_or_zero().as_vec3()).collect();
        let mirrored = bend.determinant() < 0.0;
        let turned = |t: &[u32; 3]| if mirrored { [t[0], t[2], t[1]] } else { *t };
        (positions, normals, self.triangles.iter().map(turned).collect())
    }

    /// Numbers of an attribute for every vertex, as many as the largest of `widths`, with 1 where an element has fewer;
    /// `None` where the primitive has no such attribute.
    pub fn attribute(&self, document: &Document, of: &Semantic, widths: &[usize]) -> Result<Option<Vec<f32>>> {
        let Some(index) = self.attributes.get(of) else { return Ok(None) };
        let width = widths.iter().copied().max().unwrap_or(0);
        let numbers = accessor::numbers(document, *index, widths)?;
        let count = document.root.accessors[*index].count.0 as usize;
        let stored = numbers.len() / count.max(1);
        if self.source.iter().max().is_some_and(|last| *last as usize >= count) {
            return Err(document.fail(&self.place, format!("there are fewer {} than positions", of.to_string())));
        }
        let at = |element: &u32, k: usize| if k < stored { numbers[*element as usize * stored + k] } else { 1.0 };
        Ok(Some(self.source.iter().flat_map(|element| (0..width).map(move |k| at(element, k))).collect()))
    }

    /// Centre and radius of a sphere around it where it stands.
    pub fn sphere(&self, place: DAffine3) -> (DVec3, f64) {
        let points: Vec<_> = self.positions.iter().map(|p| (place.transform_point3(p.as_dvec3()), 0.0)).collect();
        enclose::around_spheres(&points).unwrap_or_default()
    }
}

fn triangles(mode: Mode, corners: &[u32]) -> std::result::Result<Vec<[u32; 3]>, String> {
    if corners.len() < 3 || mode == Mode::Triangles && !corners.len().is_multiple_of(3) {
        return Err(format!("{} corners are no whole triangles", corners.len()));
    }
    Ok(match mode {
        Mode::TriangleStrip => {
            let odd_first = |(i, t): (usize, &[u32])| if i % 2 == 0 { [t[0], t[1], t[2]] } else { [t[1], t[0], t[2]] };
            corners.windows(3).enumerate().map(odd_first).collect()
        }
        Mode::TriangleFan => corners[1..].windows(2).map(|pair| [corners[0], pair[0], pair[1]]).collect(),
        _ => corners.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect(),
    })
}

/// Triangles that share no vertex.
fn flat(place: String, positions: &[Vec3], triangles: &[[u32; 3]], attributes: HashMap<Semantic, usize>) -> Shape {
    let normal = |triangle| [twice_area_m2(positions, triangle).normalize_or_zero().as_vec3(); 3];
    let normals = triangles.iter().flat_map(normal).collect();
    let source = triangles.as_flattened().to_vec();
    let (positions, triangles) = topology::apart(positions, triangles);
    Shape { place, positions, normals, triangles, source, attributes }
}
