//! Chunks are neighbouring triangles that are drawn or left out together. Each has the bounds that decide it.

use crate::error::{Error, Result};
use crate::sh::cube::FACE_COUNT;
use glam::{DVec3, Vec3, Vec3Swizzles};
use meshopt::{VertexDataAdapter, build_meshlets, extract_meshlet_indices};
use std::ops::Range;

/// Triangles in a chunk. It is small enough to be culled on its own, and large enough that its draw call costs little.
const CHUNK_TRIANGLES: usize = 128;
/// Weight of the distance between normals against the distance between places, when chunks are made.
const CONE_WEIGHT: f32 = 0.5;
/// Neighbouring triangles with the sphere around them, in r, and the cone around their normals.
#[derive(Clone, Debug)]
pub(super) struct Chunk {
    pub indices: Range<u32>,
    pub centre: Vec3,
    pub radius: f32,
    axis: Vec3,
    /// Sine of the cone's half-angle, or 2 where normals point everywhere.
    sine: f32,
}

impl Chunk {
    fn new(indices: Range<u32>, triangles: &[[Vec3; 3]]) -> Self {
        let corners = || triangles.iter().flatten();
        let (low, high) = corners().fold((Vec3::MAX, Vec3::MIN), |(l, h), p| (l.min(*p), h.max(*p)));
        let centre = (low + high) / 2.0;
        let radius = corners().map(|p| p.distance(centre)).fold(0.0, f32::max);
        let normals =
            || triangles.iter().filter_map(|[a, b, c]| (b - a).as_dvec3().cross((c - a).as_dvec3()).try_normalize());
        let axis = normals().sum::<DVec3>().normalize_or_zero();
        let cosine = normals().map(|n| n.dot(axis)).fold(1.0, f64::min);
        let sine = if cosine > 0.0 { (1.0 - cosine * cosine).max(0.0).sqrt() as f32 } else { 2.0 };
        Chunk { indices, centre, radius, axis: axis.as_vec3(), sine }
    }

    /// Whether only backs are seen from `eye`. It is never true where a front is seen.
    ///
    /// The direction to any of its points is within asin(radius / distance) of the direction to the centre, and any
    /// normal is within the cone around the axis. If these two angles and the one between centre and axis sum to less
    /// than a right angle, all triangles show their backs. The bound a . q >= sine |q| + radius implies that.
    pub fn turned_away(&self, eye: Vec3) -> bool {
        let q = self.centre - eye;
        // The margin covers rounding.
        self.axis.dot(q) > (self.sine * q.length() + self.radius) * 1.0001 + 1e-5
    }
}

/// A mesh cut into chunks, one after another along a space-filling curve.
#[derive(Default)]
pub(super) struct Chunked {
    /// The vertices of one chunk after another. A vertex on the rim of a chunk comes again in the neighbouring chunks.
    pub vertices: Vec<u32>,
    pub triangles: Vec<[u32; 3]>,
    pub chunks: Vec<Chunk>,
}

impl Chunked {
    pub fn triangles_of(&self, chunk: usize) -> &[[u32; 3]] {
        let Range { start, end } = self.chunks[chunk].indices;
        &self.triangles[start as usize / 3..end as usize / 3]
    }

    /// Adds a chunk of triangles that are given by the mesh's vertices.
    pub fn add(&mut self, positions: &[Vec3], corners: &[u32]) {
        let first = self.vertices.len();
        let start = self.triangles.len();
        let (vertices, local) = extract_meshlet_indices(corners);
        self.vertices.extend(vertices);
        self.triangles
            .extend(local.chunks_exact(3).map(|t| [t[0], t[1], t[2]].map(|i| (first + usize::from(i)) as u32)));
        let of_vertex = |i: u32| positions[self.vertices[i as usize] as usize];
        let triangles: Vec<_> = self.triangles[start..].iter().map(|t| t.map(of_vertex)).collect();
        self.chunks.push(Chunk::new(3 * start as u32..3 * self.triangles.len() as u32, &triangles));
    }
}

pub(super) fn adapter(positions: &[Vec3]) -> Result<VertexDataAdapter<'_>> {
    VertexDataAdapter::new(bytemuck::cast_slice(positions), size_of::<Vec3>(), 0)
        .map_err(|error| Error::Failed(format!("the mesh cannot be cut into chunks: {error}")))
}

/// Cuts a mesh into chunks of neighbouring triangles that face alike.
pub(super) fn chunk(positions: &[Vec3], triangles: &[[u32; 3]]) -> Result<Chunked> {
    let adapter = adapter(positions)?;
    let flat: &[u32] = bytemuck::cast_slice(triangles);
    let meshlets = build_meshlets(flat, &adapter, CHUNK_TRIANGLES, CHUNK_TRIANGLES, CONE_WEIGHT);
    let mut order: Vec<_> = meshlets.iter().collect();
    order.sort_by_cached_key(|meshlet| {
        let sum: Vec3 = meshlet.vertices.iter().map(|&v| positions[v as usize]).sum();
        morton(sum / meshlet.vertices.len().max(1) as f32)
    });
    let mut out = Chunked::default();
    for meshlet in order {
        let corners: Vec<u32> = meshlet.triangles.iter().map(|&i| meshlet.vertices[usize::from(i)]).collect();
        out.add(positions, &corners);
    }
    Ok(out)
}

/// The interleaved bits of a point in [-1, 1]^3, ten bits for each axis.
pub fn morton(p: Vec3) -> u32 {
    let spread = |x: f32| {
        let cell = ((x + 1.0) * 512.0).clamp(0.0, 1023.0) as u32;
        (0..10).fold(0, |bits, i| bits | (cell >> i & 1) << (3 * i))
    };
    spread(p.x) | spread(p.y) << 1 | spread(p.z) << 2
}

/// For every cube face seen from `eye`, in the order of [`crate::sh::cube::face_basis`], whether a sphere reaches into
/// its pyramid. It is never false where the sphere does.
pub(super) fn faces_reached(eye: Vec3, centre: Vec3, radius: f32) -> [bool; FACE_COUNT] {
    let q = centre - eye;
    // Planes through the eye at 45 degrees: their unit normals are (forward +- side) / sqrt 2. The margin covers
    // rounding.
    let reach = -1.0001 * radius * std::f32::consts::SQRT_2 - 1e-6;
    let behind = -1.0001 * radius - 1e-6;
    let abs = q.abs();
    let side = abs.yxx().max(abs.zzy());
    let ahead = (q - side).cmpge(Vec3::splat(reach)) & q.cmpge(Vec3::splat(behind));
    let back = (-q - side).cmpge(Vec3::splat(reach)) & (-q).cmpge(Vec3::splat(behind));
    [ahead.x, back.x, ahead.y, back.y, ahead.z, back.z]
}

/// Joins ranges where one begins at the end of another.
pub(super) fn joined(ranges: impl Iterator<Item = Range<u32>>) -> Vec<Range<u32>> {
    let mut out: Vec<Range<u32>> = Vec::new();
    for range in ranges {
        match out.last_mut() {
            Some(last) if last.end == range.start => last.end = range.end,
            _ => out.push(range),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::generate;
    use crate::bake::triangles::unit_positions;

    #[test]
    fn chunks_hold_every_triangle_once_and_only_backs_are_turned_away() {
        let mesh = generate::torus(1.0, 0.4, 240, 120);
        let unit = unit_positions(&mesh);
        let Chunked { vertices, triangles, chunks } = chunk(&unit, &mesh.triangles).unwrap();
        let canonical = |mut t: [u32; 3]| {
            let least = (0..3).min_by_key(|&i| t[i]).unwrap();
            t.rotate_left(least);
            t
        };
        let mut found: Vec<_> = triangles.iter().map(|t| canonical(t.map(|i| vertices[i as usize]))).collect();
        let mut expected: Vec<_> = mesh.triangles.iter().map(|t| canonical(*t)).collect();
        found.sort_unstable();
        expected.sort_unstable();
        assert_eq!(found, expected);
        let mut rng = fastrand::Rng::with_seed(4);
        let mut away = 0;
        let mut all = 0;
        for _ in 0..300 {
            let eye = 4.0 * Vec3::new(rng.f32() - 0.5, rng.f32() - 0.5, rng.f32() - 0.5);
            for chunk in chunks.iter().filter(|c| c.turned_away(eye)) {
                away += chunk.indices.len() / 3;
                for t in &triangles[chunk.indices.start as usize / 3..chunk.indices.end as usize / 3] {
                    let [a, b, c] = t.map(|i| unit[vertices[i as usize] as usize].as_dvec3());
                    assert!((b - a).cross(c - a).dot(a - eye.as_dvec3()) >= 0.0, "a front is seen from {eye}");
                }
            }
            all += mesh.triangles.len();
        }
        // From most places nearly half of the surface is turned away; chunks at its rim are not.
        assert!(5 * away > all, "{away} of {all}");
    }
}
