//! Silhouette fields: an object as parallel light sees it from every node of a grid, reduced to maps of distance and
//! depth, on all cores.
//!
//! Each view holds the nearest and the farthest depth of what its pixels show. The outline is known at points between
//! neighbouring pixels of which one is covered; these points lie in columns half a pixel apart, alternately between
//! vertical and between horizontal neighbours. A map's distances are those to the nearest of them: the exact two-pass
//! distance transform of Meijster, Roerdink and Hesselink, *A General Algorithm for Computing Distance Transforms in
//! Linear Time*, 2000, with a plain minimum in the second pass.

use super::triangles::unit_positions;
use super::{BakeReport, Baker, Progress, hash_text, levels};
use crate::asset::mesh::Mesh;
use crate::error::Result;
use crate::field::silhouette::{
    FACES_LIMIT, MapFrame, REACH, SURFACE, Side, SilhouetteField, SilhouetteHeader, encode,
};
use crate::field::silhouette_nodes::NodeGrid;
use glam::{DVec3, Vec2, Vec3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::time::Instant;

/// Maps that are made before progress is told.
const MAPS_AT_ONCE: usize = 32;

/// What decides a silhouette field besides the mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SilhouetteOptions {
    /// Cells along an edge of a cube face of the node grid.
    pub cells: u32,
    pub map_px: u32,
    /// Pixels along an edge of the view that a map is reduced from.
    pub view_px: u32,
    /// Whether a large mesh is drawn with fewer triangles, which miss it by a share of a view's pixel (see
    /// [`super::levels`]).
    pub levels: bool,
}

impl Default for SilhouetteOptions {
    /// 193 maps of 32 x 32 texels: 389 KiB, and 193 KiB for the halves of a mesh that is not convex. With 4 and 16 cells
    /// they are 98 and 1 542 KiB, and half as much again.
    fn default() -> Self {
        SilhouetteOptions { cells: 8, map_px: 32, view_px: 128, levels: true }
    }
}

/// Header of the silhouette field that a bake of `mesh` would make.
pub fn silhouette_header(mesh: &Mesh, options: SilhouetteOptions) -> SilhouetteHeader {
    let (centre, radius_m) = mesh.bounding_sphere();
    SilhouetteHeader {
        cells: options.cells,
        map_px: options.map_px,
        view_px: options.view_px,
        half_px: if mesh.is_convex() { 0 } else { options.map_px / 2 },
        level_pixels: if options.levels { levels::texels(mesh) } else { 0.0 },
        centre_m: centre.to_array(),
        radius_m,
        extent: extent(mesh),
        faces: faces(mesh),
        mesh: mesh.name.clone(),
        mesh_hash: hash_text(mesh),
    }
}

/// Least and largest coordinates of a mesh about its bounding sphere's centre, in bounding radii.
fn extent(mesh: &Mesh) -> [[f32; 3]; 2] {
    let positions = unit_positions(mesh);
    let start = (positions[0], positions[0]);
    let (low, high) = positions.iter().fold(start, |(low, high), p| (low.min(*p), high.max(*p)));
    [low.to_array(), high.to_array()]
}

/// Normals and distances of the faces of a convex mesh, but for those of the box of its extent; none where there are more
/// than [`FACES_LIMIT`].
fn faces(mesh: &Mesh) -> Vec<[f32; 4]> {
    const SAME: f32 = 1.0 - 1e-5;
    let mut found: Vec<[f32; 4]> = Vec::new();
    if !mesh.is_convex() {
        return found;
    }
    let positions = unit_positions(mesh);
    for triangle in &mesh.triangles {
        let [a, b, c] = triangle.map(|v| positions[v as usize]);
        let Some(normal) = (b - a).cross(c - a).try_normalize() else { continue };
        let is_same = |face: &[f32; 4]| normal.dot(Vec3::from_slice(face)) > SAME;
        if normal.abs().max_element() > SAME || found.iter().any(is_same) {
            continue;
        }
        let distance = positions.iter().map(|p| normal.dot(*p)).fold(f32::MIN, f32::max);
        found.push(normal.extend(distance).to_array());
        if found.len() > FACES_LIMIT {
            return Vec::new();
        }
    }
    found
}

/// What parallel light sees of an object, or of half of it.
struct View {
    /// Pixels along an edge.
    px: usize,
    /// Of every pixel, row by row, in r: positive infinity where nothing covers its middle.
    nearest: Vec<f32>,
    /// The same, negative infinity where nothing does.
    farthest: Vec<f32>,
}

impl View {
    /// `places` has each vertex on the map, -1 to 1 from edge to edge, and its depth.
    fn new(places: &[Vec3], triangles: &[[u32; 3]], side: Side, px: usize) -> Self {
        let mut view = View { px, nearest: vec![f32::INFINITY; px * px], farthest: vec![f32::NEG_INFINITY; px * px] };
        let half = 0.5 * px as f32;
        // Whole numbers are the middles of pixels.
        let pixels: Vec<Vec3> = places.iter().map(|p| ((p.truncate() + 1.0) * half - 0.5).extend(p.z)).collect();
        for triangle in triangles {
            let corners = triangle.map(|v| pixels[v as usize]);
            view.add(corners, side.sign());
        }
        view
    }

    /// Adds what a triangle shows of depths with this sign, or of all where it is 0: row by row from edge to edge.
    /// Triangles that share an edge find the same places on it, so no pixel between them stays empty.
    fn add(&mut self, [a, b, c]: [Vec3; 3], sign: f32) {
        let low = a.min(b).min(c);
        let high = a.max(b).max(c);
        let rows = low.y.max(0.0).ceil() as usize..(high.y.min(self.px as f32 - 1.0).floor() + 1.0) as usize;
        if rows.is_empty() || low.x.ceil() > high.x {
            return;
        }
        let [to_b, to_c] = [b - a, c - a];
        let area = to_b.truncate().perp_dot(to_c.truncate());
        let slope = Vec2::new(to_b.z * to_c.y - to_c.z * to_b.y, to_c.z * to_b.x - to_b.z * to_c.x) / area;
        if !slope.is_finite() {
            return;
        }
        for y in rows {
            let row = y as f32;
            let mut from = f32::INFINITY;
            let mut to = f32::NEG_INFINITY;
            for (p, q) in [(a, b), (b, c), (c, a)] {
                let (p, q) = if (p.y, p.x) <= (q.y, q.x) { (p, q) } else { (q, p) };
                if p.y <= row && row <= q.y && p.y < q.y {
                    let x = p.x + (row - p.y) / (q.y - p.y) * (q.x - p.x);
                    from = from.min(x);
                    to = to.max(x);
                }
            }
            let from = from.max(0.0).ceil();
            let to = to.min(self.px as f32 - 1.0).floor();
            if from > to {
                continue;
            }
            let first = a.z + slope.dot(Vec2::new(from, row) - a.truncate());
            let pixels = y * self.px + from as usize..y * self.px + to as usize + 1;
            let nearest = &mut self.nearest[pixels.clone()];
            let farthest = &mut self.farthest[pixels];
            // Indices and selections: other forms of this loop get no vector instructions.
            for i in 0..nearest.len().min(farthest.len()) {
                let depth = first + i as i32 as f32 * slope.x;
                // That of a triangle seen from its edge runs beyond its corners.
                let depth = if depth < low.z { low.z } else { depth };
                let depth = if depth > high.z { high.z } else { depth };
                let counts = depth * sign >= 0.0;
                nearest[i] = if counts & (depth < nearest[i]) { depth } else { nearest[i] };
                farthest[i] = if counts & (depth > farthest[i]) { depth } else { farthest[i] };
            }
        }
    }

    /// Middle between the nearest and the farthest surface of a pixel: at an outline both are near it.
    fn depth(&self, x: usize, y: usize) -> Option<f32> {
        let nearest = self.nearest[y * self.px + x];
        let farthest = self.farthest[y * self.px + x];
        (nearest <= farthest).then_some(0.5 * (nearest + farthest))
    }

    /// Depth of the outline between two pixels of which one is covered.
    fn outline(&self, one: (usize, usize), other: (usize, usize)) -> Option<f32> {
        self.depth(one.0, one.1).xor(self.depth(other.0, other.1))
    }

    /// The points of the outline in a column, from above: how far down they lie, in pixels, and their depths.
    fn points(&self, column: usize) -> impl Iterator<Item = (f32, f32)> {
        let x = column / 2;
        let is_beside = column % 2 == 1;
        (0..self.px).filter_map(move |y| match (is_beside, y) {
            (true, _) => Some((y as f32 + 0.5, self.outline((x, y), (x + 1, y))?)),
            (false, 0) => None,
            (false, _) => Some((y as f32, self.outline((x, y - 1), (x, y))?)),
        })
    }

    /// The map of `map_px` that the view is reduced to: bytes of distance and depth, row by row. `half` is half of the
    /// map's size in r.
    fn map(&self, map_px: usize, half: Vec2, is_half: bool) -> Vec<u8> {
        let columns = 2 * self.px - 1;
        let at = |i: usize| (i as f32 + 0.5) * (self.px as f32 / map_px as f32);
        let pixel = 2.0 * half / self.px as f32;
        // For every row of the map and every column how far up or down its nearest point lies, squared, and its depth.
        let mut nearest = vec![(f32::INFINITY, 0.0); map_px * columns];
        for column in 0..columns {
            for (place, depth) in self.points(column) {
                // The mean of points that are equally near makes mirrored views mirrored maps.
                for row in 0..map_px {
                    let squared = ((place - at(row)) * pixel.y).powi(2);
                    let known = &mut nearest[row * columns + column];
                    if squared < known.0 {
                        *known = (squared, depth);
                    } else if squared == known.0 {
                        known.1 = 0.5 * (known.1 + depth);
                    }
                }
            }
        }
        let texel = |i: usize| {
            let place = Vec2::new(at(i % map_px), at(i / map_px));
            let mut least = f32::INFINITY;
            let mut depths = (0.0, 0.0);
            for (column, (down, depth)) in nearest[i / map_px * columns..][..columns].iter().enumerate() {
                let squared = ((0.5 * (column as f32 + 1.0) - place.x) * pixel.x).powi(2) + down;
                if squared < least {
                    least = squared;
                    depths = (*depth, 1.0);
                } else if squared == least && least < f32::INFINITY {
                    depths = (depths.0 + depth, depths.1 + 1.0);
                }
            }
            let around = [-0.25, 0.25].map(|dy| [-0.25, 0.25].map(|dx| (place + Vec2::new(dx, dy)).as_usizevec2()));
            let covered = around.iter().flatten().filter_map(|p| self.depth(p.x, p.y));
            let (surface, count) = covered.fold((0.0, 0.0), |(sum, count), depth| (sum + depth, count + 1.0));
            // Inside where most of the pixels around the texel's middle are covered; 0 where as many are as are not.
            let inside = if count == 2.0 { 0.0 } else { (count - 2.0_f32).signum() };
            let distance = f64::from(least.sqrt().min(f32::MAX) * inside);
            let mut depth = f64::from(depths.0 / f32::max(depths.1, 1.0));
            if is_half && count > 0.0 {
                let within = ((distance - SURFACE[0]) / (SURFACE[1] - SURFACE[0])).clamp(0.0, 1.0);
                depth += (f64::from(surface / count) - depth) * within * within * (3.0 - 2.0 * within);
            }
            [encode(distance, REACH), encode(depth, 1.0)]
        };
        (0..map_px * map_px).flat_map(texel).collect()
    }
}

/// The triangles that all views show. With levels of detail they miss the mesh by a share of the smallest pixel of all
/// views.
fn drawn_triangles<'m>(
    baker: &Baker,
    mesh: &'m Mesh,
    header: &SilhouetteHeader,
    frames: &[MapFrame],
) -> Result<Cow<'m, [[u32; 3]]>> {
    if header.level_pixels == 0.0 {
        return Ok(Cow::Borrowed(&mesh.triangles));
    }
    let edges = frames.iter().map(|frame| 2.0 * frame.half.min_element());
    let pixel = edges.fold(f64::INFINITY, f64::min) / f64::from(header.view_px);
    let tolerance = levels::Tolerance::Parallel((header.level_pixels * pixel) as f32);
    Ok(Cow::Owned(baker.leveled(mesh)?.drawn(tolerance)))
}

/// Bakes the silhouette field of a mesh; `progress` hears of maps. Returns the report of the bake too.
pub fn bake_silhouette(
    baker: &Baker,
    mesh: &Mesh,
    options: SilhouetteOptions,
    progress: Progress<'_>,
) -> Result<(SilhouetteField, BakeReport)> {
    let started = Instant::now();
    let header = silhouette_header(mesh, options);
    header.validate()?;
    let positions: Vec<DVec3> = unit_positions(mesh).iter().map(|p| p.as_dvec3()).collect();
    let nodes = NodeGrid::new(options.cells);
    let frame = |map: usize| MapFrame::around(nodes.map_direction(map), &positions);
    let frames: Vec<MapFrame> = (0..header.map_count()).into_par_iter().map(frame).collect();
    let triangles = drawn_triangles(baker, mesh, &header, &frames)?;
    let sides = if header.half_px > 0 { &Side::ALL[..] } else { &Side::ALL[..1] };
    let texels = |frame: &MapFrame| -> Vec<u8> {
        let place = |p: &DVec3| frame.place(*p).extend(p.dot(frame.direction)).as_vec3();
        let places: Vec<Vec3> = positions.iter().map(place).collect();
        let map = |&side: &Side| {
            let map_px = header.edge_px(side);
            let view_px = header.view_px as usize * map_px / header.map_px as usize;
            View::new(&places, &triangles, side, view_px).map(map_px, frame.half.as_vec2(), side != Side::Whole)
        };
        sides.iter().flat_map(map).collect()
    };
    let mut payload = Vec::with_capacity(header.payload_bytes());
    for (number, some) in frames.chunks(MAPS_AT_ONCE).enumerate() {
        let maps: Vec<Vec<u8>> = some.par_iter().map(texels).collect();
        for (frame, texels) in some.iter().zip(maps) {
            payload.extend_from_slice(bytemuck::bytes_of(&[frame.centre, frame.half].map(|of| of.as_vec2())));
            payload.extend(texels);
        }
        progress((number * MAPS_AT_ONCE + some.len()) as u32, frames.len() as u32);
    }
    let report = BakeReport { samples: frames.len() as u32, total: started.elapsed(), ..BakeReport::default() };
    Ok((SilhouetteField::new(header, payload)?, report))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::generate;
    use glam::DVec2;

    /// All texels of small fields. A pixel on an outline, or on the plane that cuts halves, may be covered in one and not in
    /// the other, which moves the outline by a pixel for the few texels nearest to it.
    #[test]
    fn maps_are_those_of_plain_search() {
        // The last lies beside the middle of its sphere in every view.
        let ring = generate::torus(1.0, 0.3, 24, 12);
        let places = ring.positions.iter().map(|p| *p * (1.0 + 0.4 * p.x + 0.3 * p.y + 0.2 * p.z)).collect();
        let bent = Mesh::new("bent torus", places, ring.normals.clone(), None, ring.triangles.clone()).unwrap();
        let steps = |a: u8, b: u8| (i32::from(a.cast_signed()) - i32::from(b.cast_signed())).abs();
        for mesh in [ring, generate::sphere(0.5, 2), bent] {
            let positions: Vec<DVec3> = unit_positions(&mesh).iter().map(|p| p.as_dvec3()).collect();
            for map in 0..NodeGrid::map_count(2) {
                let frame = MapFrame::around(NodeGrid::new(2).map_direction(map), &positions);
                let places: Vec<Vec3> =
                    positions.iter().map(|p| frame.place(*p).extend(p.dot(frame.direction)).as_vec3()).collect();
                for (side, map_px) in [(Side::Whole, 32), (Side::Far, 16), (Side::Near, 16)] {
                    let wanted = twin(&mesh, (&frame, side), map_px as u32, 4 * map_px as u32);
                    let view = View::new(&places, &mesh.triangles, side, 4 * map_px);
                    let found = view.map(map_px, frame.half.as_vec2(), side != Side::Whole);
                    let is_off = |(found, wanted): &(&[u8], &[u8; 2])| {
                        let is_near = wanted[0].cast_signed().unsigned_abs() < 16;
                        steps(found[0], wanted[0]) > 1 || (is_near && steps(found[1], wanted[1]) > 2)
                    };
                    let off = found.chunks_exact(2).zip(&wanted).filter(is_off).count();
                    assert!(off <= 4, "{} {side:?}, map {map}: {off} texels", mesh.name);
                }
            }
        }
    }

    /// One side of a map in f64 and by plain search: bytes of distance and depth, row by row.
    fn twin(mesh: &Mesh, (frame, side): (&MapFrame, Side), map_px: u32, view_px: u32) -> Vec<[u8; 2]> {
        let view = drawn(mesh, (frame, side), view_px as usize);
        let px = view_px as usize;
        let pixel = 2.0 * frame.half / px as f64;
        let mut points = Vec::new();
        for (y, x) in (0..px).flat_map(|y| (0..px).map(move |x| (y, x))) {
            for (i, j) in [(1, 0), (0, 1)] {
                if x + i < px && y + j < px {
                    let a = view[y * px + x];
                    let b = view[(y + j) * px + x + i];
                    let Some((low, high)) = a.xor(b) else { continue };
                    let place = DVec2::new((x + 1) as f64 - 0.5 * j as f64, (y + 1) as f64 - 0.5 * i as f64);
                    points.push((place, (low + high) / 2.0));
                }
            }
        }
        let texel = |i: u32| {
            let at = |i: u32| (f64::from(i) + 0.5) * f64::from(view_px) / f64::from(map_px);
            let place = DVec2::new(at(i % map_px), at(i / map_px));
            let squared = |p: &DVec2| ((*p - place) * pixel).length_squared();
            let least = points.iter().map(|(p, _)| squared(p)).fold(f64::INFINITY, f64::min);
            // Views of a symmetric mesh have points that are equally near.
            let nearest = points.iter().filter(|(p, _)| squared(p) <= least * (1.0 + 1e-9)).map(|(_, depth)| *depth);
            let (sum, count) = nearest.fold((0.0, 0.0), |(sum, count), depth| (sum + depth, count + 1.0));
            let around =
                [-0.25, 0.25].map(|dy| [-0.25, 0.25].map(|dx| (place + DVec2::new(dx, dy)).floor().as_usizevec2()));
            let covered: Vec<(f64, f64)> = around.iter().flatten().filter_map(|p| view[p.y * px + p.x]).collect();
            let inside = (covered.len() as i32 - 2).signum();
            let distance = least.sqrt().min(f64::MAX) * f64::from(inside);
            let mut depth = sum / f64::max(count, 1.0);
            if side != Side::Whole && !covered.is_empty() {
                let surface = covered.iter().map(|(low, high)| (low + high) / 2.0).sum::<f64>() / covered.len() as f64;
                let within = ((distance - SURFACE[0]) / (SURFACE[1] - SURFACE[0])).clamp(0.0, 1.0);
                depth += (surface - depth) * within * within * (3.0 - 2.0 * within);
            }
            [encode(distance, REACH), encode(depth, 1.0)]
        };
        (0..map_px * map_px).into_par_iter().map(texel).collect()
    }

    /// Nearest and farthest depth of every covered pixel.
    fn drawn(mesh: &Mesh, (frame, side): (&MapFrame, Side), px: usize) -> Vec<Option<(f64, f64)>> {
        let positions: Vec<DVec3> = unit_positions(mesh).iter().map(|p| p.as_dvec3()).collect();
        let mut view: Vec<Option<(f64, f64)>> = vec![None; px * px];
        for triangle in &mesh.triangles {
            let corners = triangle.map(|i| {
                let p = positions[i as usize];
                ((frame.place(p) + 1.0) * 0.5 * px as f64, p.dot(frame.direction))
            });
            let [a, b, c] = corners.map(|(place, _)| place);
            let area = (b - a).perp_dot(c - a);
            let low = a.min(b).min(c).floor().max(DVec2::ZERO).as_usizevec2();
            let high = a.max(b).max(c).ceil().min(DVec2::splat(px as f64)).as_usizevec2();
            for (y, x) in (low.y..high.y).flat_map(|y| (low.x..high.x).map(move |x| (y, x))) {
                let p = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
                let weights =
                    [(b - p).perp_dot(c - p), (c - p).perp_dot(a - p), (a - p).perp_dot(b - p)].map(|w| w / area);
                if weights.iter().all(|w| *w >= 0.0) {
                    let depth = corners.iter().zip(weights).map(|((_, depth), w)| depth * w).sum::<f64>();
                    if side == Side::Whole || depth * f64::from(side.sign()) >= 0.0 {
                        let (least, most) = view[y * px + x].unwrap_or((depth, depth));
                        view[y * px + x] = Some((least.min(depth), most.max(depth)));
                    }
                }
            }
        }
        view
    }
}
