//! What mirrors: planes of flat faces and curved surfaces of glossy entities, the ones that a picture shows best.
//! Behind a plane stands the eye's mirror image; in the middle of what is curved stands a probe.

use super::probe::{self, Probe};
use super::viewport::Viewport;
use super::{Frame, gloss};
use crate::asset::edges::within_picture;
use crate::asset::mesh::Mesh;
use crate::bounce::Bounces;
use crate::draw::mirror::{FLAT, Mirrored, PROBE_ZOOM, REACH, finest_side};
use crate::draw::triangles::Detail;
use crate::draw::{DrawnViewport, EVERYWHERE, PictureLights};
use crate::gloss::{PIXEL_ROUGHNESS, brdf};
use crate::layout::GlossEntity;
use crate::lists::sight::SightCamera;
use crate::scene::{Placement, Scene};
use crate::sharp::SharpPermutation;
use glam::{DMat4, DVec2, DVec3, DVec4, Vec3};
use std::collections::{HashMap, HashSet};

/// The most mirrors at a time.
const MOST: usize = 4;
/// Least share of a picture's light that a mirror reflects: of the pixels, times the reflectance.
const LEAST_SHARE: f64 = 5e-4;
/// The same for a mirror of entities that are better ones already.
const LEAST_SHARE_AGAIN: f64 = 4e-3;
/// Least share of a mesh's surface in a face that may be a mirror, and how many faces of a mesh may be.
const LEAST_FACE: f64 = 0.04;
const MOST_FACES: usize = 8;
/// A mesh with less than this share of its surface in flat faces is curved.
const FLAT_MESH: f64 = 0.5;
/// Half of the edge of a square that covers as much of a picture as what is curved, in bounding radii.
const SEEN_RADIUS: f64 = 0.7;
/// Faces whose normals and offsets, over the eye's distance from the plane, differ by less are one mirror.
const SAME_PLANE: f64 = 1e-3;
/// Distance from the plane, over the eye's, within which nothing is mirrored: that of the faces themselves.
const CLIPPED: f64 = 2.0 * SAME_PLANE;
/// Share of a mirror's score above the least one at which it is shown whole.
const FADE: f64 = 0.2;
/// Slopes of a mirror's microfacets, in texels at a distance of 1, below which shadows in it have edges that are seen.
const CRISP_PX: f64 = 12.0;
/// How far beyond the box of what has a probe things count as within it, in diagonals of the box.
const WITHIN: f64 = 0.02;

/// A flat face of a glossy entity.
pub(super) struct Face {
    entity: usize,
    /// Corners of a rectangle around it in the mesh's frame.
    corners: [DVec3; 4],
    normal: DVec3,
}

/// What may mirror in pictures of a scene.
#[derive(Default)]
pub(super) struct Reflectors {
    faces: Vec<Face>,
    /// Entities that are curved, and their middles in the mesh's frame.
    curved: Vec<(usize, DVec3)>,
}

/// A mirror of the next picture.
pub(super) struct Mirror {
    shape: Shape,
    entities: Vec<usize>,
    /// Share of its picture in what it reflects: less than 1 for one that is hardly seen.
    share: f64,
    /// Whether its pixels evaluate lights.
    crisp: bool,
}

/// What may become a mirror of the next picture.
struct Candidate {
    place: Place,
    /// Those that have faces there.
    entities: Vec<usize>,
    /// Corners of a rectangle around the faces of a plane, in order.
    corners: [DVec3; 4],
    /// Share of the picture's light that it reflects.
    score: f64,
    /// Least and largest corner of its faces in a picture that lies between -1 and 1.
    bounds: [DVec2; 2],
}

enum Shape {
    Plane(Plane),
    Probe(Box<Probe>),
}

/// Where a mirror stands.
#[derive(Clone, Copy)]
enum Place {
    /// Unit normal on the eye's side, and offset from the world's origin.
    Plane(DVec4),
    /// Centre and radius, metres.
    Ball(DVec3, f64),
}

/// The eye's mirror image behind a plane.
struct Plane {
    /// What of its picture is read: left, top, width and height in texels of its part.
    read: [u32; 4],
    /// Edges of its rectangle as glsl/mirror_far.frag has them.
    edges: [[f32; 4]; 4],
    camera: SightCamera,
    /// Unit normal on the eye's side, and offset from the world's origin.
    plane: DVec4,
    /// Distance of the eye from the plane, metres.
    height_m: f64,
    /// What a metre away from the plane takes from depth, times the view depth in metres.
    depth_step: f64,
}

/// What of a scene may mirror.
pub(super) fn reflectors(scene: &Scene) -> Reflectors {
    let glossy = scene.entities.iter().enumerate().filter(|(_, entity)| {
        let mirrors = matches!(gloss::detail(entity), Some(Detail::Mirror | Detail::Textured));
        mirrors && !entity.transparent && entity.gloss.is_some_and(|gloss| gloss.roughness < PIXEL_ROUGHNESS)
    });
    let mut of_mesh = HashMap::new();
    let mut out = Reflectors::default();
    for (entity, of) in glossy {
        let mesh = &scene.meshes[of.mesh];
        let (flat, centre) = of_mesh.entry(of.mesh).or_insert_with(|| {
            let (flat, share) = flat_faces(mesh);
            (flat, (share < FLAT_MESH).then(|| probe::outward_centre(mesh)).flatten())
        });
        match centre {
            Some(centre) => out.curved.push((entity, *centre)),
            None => out.faces.extend(flat.iter().map(|(corners, normal)| Face {
                entity,
                corners: *corners,
                normal: *normal,
            })),
        }
    }
    out
}

/// Rectangles around the largest flat faces of a mesh, and their normals; and the share of its surface that is in them.
/// Triangles that are shaded as if they were round, as those of a door with a bevel are, mirror as what is curved does.
fn flat_faces(mesh: &Mesh) -> (Vec<([DVec3; 4], DVec3)>, f64) {
    let (centre, radius_m) = mesh.bounding_sphere();
    let mut planes: HashMap<[i32; 4], (f64, DVec3, Vec<DVec3>)> = HashMap::new();
    for triangle in &mesh.triangles {
        let [a, b, c] = triangle.map(|v| mesh.positions[v as usize].as_dvec3());
        let twice = (b - a).cross(c - a);
        let Some(normal) = twice.try_normalize() else { continue };
        let is_shaded_flat = |v: &u32| normal.dot(mesh.normals[*v as usize].as_dvec3()) > FLAT;
        if !triangle.iter().all(is_shaded_flat) {
            continue;
        }
        let offset = normal.dot(a - centre.as_dvec3()) / f64::from(radius_m);
        let key = (normal.extend(offset) * 1024.0).round().as_ivec4().to_array();
        let (area_m2, _, corners) = planes.entry(key).or_insert((0.0, normal, Vec::new()));
        *area_m2 += 0.5 * twice.length();
        corners.extend([a, b, c]);
    }
    let whole_m2 = mesh.area_m2();
    let least = LEAST_FACE * whole_m2;
    let mut planes: Vec<_> = planes.into_iter().filter(|(_, (area_m2, ..))| *area_m2 > least).collect();
    let flat_m2: f64 = planes.iter().map(|(_, (area_m2, ..))| area_m2).sum();
    planes.sort_by(|(a_key, (a, ..)), (b_key, (b, ..))| b.total_cmp(a).then(a_key.cmp(b_key)));
    let rectangle = |(_, (_, normal, corners)): ([i32; 4], (f64, DVec3, Vec<DVec3>))| {
        let (x, y) = normal.any_orthonormal_pair();
        let flat: Vec<DVec2> = corners.iter().map(|corner| DVec2::new(x.dot(*corner), y.dot(*corner))).collect();
        let low = flat.iter().copied().fold(DVec2::INFINITY, DVec2::min);
        let high = flat.iter().copied().fold(DVec2::NEG_INFINITY, DVec2::max);
        let height = normal.dot(corners[0]);
        let at = |u: f64, v: f64| u * x + v * y + height * normal;
        ([at(low.x, low.y), at(high.x, low.y), at(high.x, high.y), at(low.x, high.y)], normal)
    };
    (planes.into_iter().take(MOST_FACES).map(rectangle).collect(), flat_m2 / whole_m2)
}

/// The corners of a polygon in a picture that lies between -1 and 1, without what lies outside of that.
fn within(clip_from_world: DMat4, corners: [DVec3; 4]) -> Vec<DVec2> {
    let mut polygon: Vec<DVec4> = corners.iter().map(|corner| clip_from_world * corner.extend(1.0)).collect();
    for side in 0..5 {
        let mut kept = Vec::with_capacity(polygon.len() + 1);
        for (a, b) in polygon.iter().zip(polygon.iter().cycle().skip(1)) {
            let [from, to] = [within_picture(*a)[side], within_picture(*b)[side]];
            if from >= 0.0 {
                kept.push(*a);
            }
            if (from >= 0.0) != (to >= 0.0) {
                kept.push(a.lerp(*b, from / (from - to)));
            }
        }
        polygon = kept;
    }
    polygon.iter().map(|p| p.truncate().truncate() / p.w).collect()
}

/// The share of that picture within a polygon.
fn share_of_picture(flat: &[DVec2]) -> f64 {
    let twice: f64 = flat.iter().zip(flat.iter().cycle().skip(1)).map(|(a, b)| a.perp_dot(*b)).sum();
    twice.abs() / 8.0
}

/// The rectangle around two of a plane, along the sides of the first.
fn around(first: [DVec3; 4], second: [DVec3; 4]) -> [DVec3; 4] {
    let [u, v] = [first[1] - first[0], first[3] - first[0]];
    let place = |corner: &DVec3| {
        let way = *corner - first[0];
        DVec2::new(way.dot(u) / u.length_squared(), way.dot(v) / v.length_squared())
    };
    let places = second.iter().map(place);
    let (low, high) = places.fold((DVec2::ZERO, DVec2::ONE), |(low, high), at| (low.min(at), high.max(at)));
    let at = |x: f64, y: f64| first[0] + x * u + y * v;
    [at(low.x, low.y), at(high.x, low.y), at(high.x, high.y), at(low.x, high.y)]
}

/// The lines in a picture, which lies between -1 and 1, through neighbouring corners of a rectangle: positive within.
fn edges(clip_from_world: DMat4, corners: [DVec3; 4]) -> [[f32; 4]; 4] {
    let flat = corners.map(|corner| {
        let clip = clip_from_world * corner.extend(1.0);
        DVec3::new(clip.x, clip.y, clip.w)
    });
    let middle: DVec3 = flat.iter().sum();
    std::array::from_fn(|i| {
        let line = flat[i].cross(flat[(i + 1) % 4]).normalize_or_zero();
        (line * line.dot(middle).signum()).extend(0.0).as_vec4().to_array()
    })
}

/// The matrix of a reflection at a plane.
fn reflection(plane: DVec4) -> DMat4 {
    let normal = plane.truncate();
    let column = |axis: DVec3| (axis - 2.0 * normal.dot(axis) * normal).extend(0.0);
    DMat4::from_cols(column(DVec3::X), column(DVec3::Y), column(DVec3::Z), (-2.0 * plane.w * normal).extend(1.0))
}

impl Plane {
    /// The mirror of a plane, of which the rectangle between `corners` mirrors, as a camera sees it; `part` is the size of
    /// its picture in texels.
    fn new(seen: &SightCamera, plane: DVec4, corners: [DVec3; 4], part: [u32; 2], read: [u32; 4]) -> Self {
        let height_m = plane.dot(seen.eye.extend(1.0));
        let eye = seen.eye - 2.0 * height_m * plane.truncate();
        let mut clip = (seen.clip_from_world * reflection(plane)).transpose();
        // From the mirrored eye, the steepest way to the plane that the picture has, for a step of 1 in view depth.
        let to_world = seen.clip_from_world.inverse();
        let steepness = |x: f64, y: f64| {
            let near = to_world * DVec4::new(x, y, 1.0, 1.0);
            let toward = near.truncate() / near.w - seen.eye;
            -plane.truncate().dot(toward) / (seen.clip_from_world * toward.extend(0.0)).w
        };
        let ends = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
        let steepest = ends.into_iter().map(|(x, y)| steepness(x, y)).fold(1e-3, f64::max);
        // Depth is 1 on the plane and falls with the distance from it over the view depth: what lies behind the plane
        // is clipped.
        let depth_step = 1.0 / steepest;
        let above = plane - DVec4::W * (CLIPPED * height_m);
        clip.z_axis = clip.w_axis - depth_step * above;
        let camera =
            SightCamera { clip_from_world: clip.transpose(), eye, near_m: seen.near_m, size: part, samples: false };
        Plane { read, edges: edges(seen.clip_from_world, corners), camera, plane, height_m, depth_step }
    }
}

impl Candidate {
    /// Adds another one with the same plane.
    fn join(&mut self, other: Candidate) {
        self.corners = around(self.corners, other.corners);
        self.entities.extend(other.entities);
        self.score += other.score;
        self.bounds = [self.bounds[0].min(other.bounds[0]), self.bounds[1].max(other.bounds[1])];
    }
}

/// Left, top, width and height of what is read where pixels lie within bounds of a picture between -1 and 1, in texels of
/// one of that size.
fn texels_within(bounds: [DVec2; 2], size: [u32; 2]) -> [u32; 4] {
    let ends = |axis: usize| {
        let at = bounds.map(|corner| 0.5 * (corner[axis] + 1.0) * f64::from(size[axis]));
        let first = (at[0].floor() as u32).saturating_sub(REACH);
        [first, (at[1].ceil() as u32 + REACH).min(size[axis]).saturating_sub(first)]
    };
    let [left, width] = ends(0);
    let [top, height] = ends(1);
    [left, top, width, height]
}

impl Frame {
    /// What mirrors in a picture of these viewports: nothing unless one shows light in all of it.
    pub(super) fn mirrors_of(&self, placements: &[Placement], viewports: &[Viewport]) -> Vec<Mirror> {
        let ([viewport], Some(mirrors)) = (viewports, &self.picture.draw.mirrors) else { return Vec::new() };
        if *viewport != self.whole() || self.reflections.is_none() {
            return Vec::new();
        }
        let seen = self.camera([viewport.area[2], viewport.area[3]]);
        let camera = &self.scene.data.camera;
        let focal_px = 0.5 * f64::from(mirrors.part[1]) / camera.half_height();
        let mut found: Vec<Candidate> = Vec::new();
        for face in &self.reflectors.faces {
            let placement = &placements[face.entity];
            let corners = face.corners.map(|corner| placement.point(corner));
            let normal = placement.turn() * face.normal;
            let plane = normal.extend(-normal.dot(corners[0]));
            let height_m = plane.dot(seen.eye.extend(1.0));
            let middle = corners.iter().sum::<DVec3>() / 4.0;
            let distance_m = middle.distance(seen.eye);
            if height_m < 1e-6 * distance_m {
                continue;
            }
            let flat = within(seen.clip_from_world, corners);
            let candidate = Candidate {
                place: Place::Plane(plane),
                entities: vec![face.entity],
                corners,
                score: self.reflectance(face.entity, height_m / distance_m) * share_of_picture(&flat),
                bounds: [
                    flat.iter().copied().fold(DVec2::INFINITY, DVec2::min),
                    flat.iter().copied().fold(DVec2::NEG_INFINITY, DVec2::max),
                ],
            };
            let same = |other: &&mut Candidate| {
                let Place::Plane(other) = other.place else { return false };
                let off = other.dot(middle.extend(1.0)).abs();
                (other - plane).truncate().length() < SAME_PLANE && off < SAME_PLANE * height_m
            };
            match found.iter_mut().find(same) {
                Some(other) => other.join(candidate),
                None => found.push(candidate),
            }
        }
        // Parts of small pictures hold no probe.
        let has_room = mirrors.face_side(f64::INFINITY) > 0;
        let curved: &[_] = if has_room { &self.reflectors.curved } else { &[] };
        for (entity, centre) in curved {
            let placement = &placements[*entity];
            let centre = placement.point(*centre);
            let radius_m = self.radius_m(*entity, placement);
            let Some(toward) = (seen.eye - centre).try_normalize() else { continue };
            let (x, y) = toward.any_orthonormal_pair();
            let [x, y] = [x, y].map(|axis| SEEN_RADIUS * radius_m * axis);
            let corners = [centre - x - y, centre + x - y, centre + x + y, centre - x + y];
            found.push(Candidate {
                place: Place::Ball(centre, radius_m),
                entities: vec![*entity],
                corners: [centre; 4],
                score: self.reflectance(*entity, 0.5) * share_of_picture(&within(seen.clip_from_world, corners)),
                bounds: [-DVec2::ONE, DVec2::ONE],
            });
        }
        found.retain(|candidate| candidate.score > 0.0);
        found.sort_by(|a, b| b.score.total_cmp(&a.score));
        // An entity is more than one mirror where each of them is seen well.
        let mut taken = HashSet::new();
        found.iter_mut().for_each(|Candidate { entities, score, .. }| {
            entities.retain(|entity| taken.insert(*entity) || *score > LEAST_SHARE_AGAIN);
        });
        found.retain(|candidate| !candidate.entities.is_empty());
        // None comes or goes in a step.
        let least = found.get(mirrors.count()).map_or(0.0, |candidate| candidate.score).max(LEAST_SHARE);
        let shown = found.into_iter().filter(|candidate| candidate.score > least).take(mirrors.count());
        let mirror = |Candidate { place, entities, corners, score, bounds }: Candidate| {
            let roughness = |entity: &usize| self.scene.entities[*entity].gloss.map_or(0.0, |gloss| gloss.roughness);
            let alphas = entities.iter().map(|entity| f64::from(roughness(entity)).powi(2));
            let least_px = focal_px * alphas.fold(f64::INFINITY, f64::min);
            let shape = match place {
                Place::Plane(plane) => {
                    let read = texels_within(bounds, mirrors.part);
                    Shape::Plane(Plane::new(&seen, plane, corners, mirrors.part, read))
                }
                Place::Ball(centre, radius_m) => {
                    // As wide as it is seen, and no finer than its blur.
                    let distance_m = centre.distance(seen.eye).max(radius_m);
                    let texels = radius_m / distance_m * f64::from(mirrors.part[1]) / camera.half_height();
                    let side = mirrors.face_side(texels.min(finest_side(f64::from(roughness(&entities[0])))));
                    Shape::Probe(Box::new(Probe::new(centre, radius_m, side)))
                }
            };
            // What is curved shows a scene small.
            let crisp = matches!(shape, Shape::Plane(_)) && least_px < CRISP_PX;
            Mirror { shape, share: ((score / least - 1.0) / FADE).min(1.0), crisp, entities }
        };
        shown.map(mirror).collect()
    }

    /// Whether the box around an entity lies in that around another, as a lamp's lining in its shade.
    fn lies_within(&self, outer: usize, entity: usize, placements: &[Placement]) -> bool {
        let device_mesh = |entity: usize| &self.buffers.meshes[self.scene.entities[entity].mesh];
        let [low, high] = device_mesh(outer).extent_m;
        let beyond = DVec3::splat(WITHIN * low.distance(high));
        device_mesh(entity).corners_m().into_iter().all(|corner| {
            let place = placements[outer].local(placements[entity].point(corner));
            place.cmpge(low - beyond).all() && place.cmple(high + beyond).all()
        })
    }

    /// What an entity reflects of white light where it is seen at a cosine.
    fn reflectance(&self, entity: usize, cosine: f64) -> f64 {
        let entity = &self.scene.entities[entity];
        let Some(gloss) = entity.gloss else { return 0.0 };
        let f0 = brdf::facing(&gloss, entity.albedo.as_dvec3()).element_sum() / 3.0;
        f0 + (1.0 - f0) * brdf::grazing(cosine)
    }

    /// What each mirror of the picture that was prepared last shows.
    pub(super) fn mirrored(&self, placements: &[Placement]) -> Vec<DrawnViewport<'_>> {
        let (Some(mirrors), Some(reflections)) = (&self.picture.draw.mirrors, &self.reflections) else {
            return Vec::new();
        };
        let shown = |(number, mirror): (usize, &Mirror)| {
            // Highlights stand for the lamps that have them, and out of its cone a spot is dark.
            let of: HashSet<usize> = mirror.entities.iter().copied().collect();
            let glossy = reflections.glossy.iter().filter(|glossy| of.contains(&glossy.entity));
            let highlights: HashSet<u32> = glossy.flat_map(|glossy| glossy.lights).collect();
            let picture = |(face, camera): (usize, &SightCamera)| {
                let mut entities = self.drawn_entities(placements, camera);
                if matches!(mirror.shape, Shape::Probe(_)) {
                    // Neither what has it nor what is within that.
                    entities.retain(|entity| {
                        !of.iter().any(|&outer| self.lies_within(outer, entity.index as usize, placements))
                    });
                }
                for entity in &mut entities {
                    entity.tag = if entity.transparent { entity.tag } else { 1.0 };
                    entity.gloss = None;
                    if highlights.contains(&entity.index) || self.scene.entities[entity.index as usize].spot.is_some() {
                        entity.emission = Vec3::ZERO;
                    }
                }
                let (area, drawn, edges) = match &mirror.shape {
                    Shape::Plane(plane) => {
                        let area = mirrors.area(number);
                        let [left, top, width, height] = plane.read;
                        (area, [area[0] + left, area[1] + top, width, height], plane.edges)
                    }
                    Shape::Probe(probe) => {
                        let area = mirrors.face_area(number, face, probe.side);
                        (area, area, EVERYWHERE)
                    }
                };
                DrawnViewport {
                    area,
                    drawn,
                    entities,
                    radiosity: self.radiosity.mirrored(self.options.bounces),
                    gloss: None,
                    pixel: self.pixel_light().filter(|_| mirror.crisp),
                    sky: None,
                    lines: 0..0,
                    edges,
                }
            };
            let cameras: &[SightCamera] = match &mirror.shape {
                Shape::Plane(plane) => std::slice::from_ref(&plane.camera),
                Shape::Probe(probe) => &probe.cameras,
            };
            cameras.iter().enumerate().map(picture).collect::<Vec<_>>()
        };
        self.picture.mirrors.iter().enumerate().flat_map(shown).collect()
    }

    /// Tells the glossy entities which mirrors they are.
    pub(super) fn tell_mirrors(&self, entities: &mut [GlossEntity]) {
        let Some(of_picture) = &self.picture.draw.mirrors else { return };
        let camera = &self.scene.data.camera;
        let eye = camera.eye.as_dvec3();
        let [width, height] = self.options.size.map(f64::from);
        for (number, mirror) in self.picture.mirrors.iter().enumerate() {
            let [left, _, part_width, part_height] = of_picture.area(number).map(f64::from);
            let focal_px = 0.5 * part_height / camera.half_height();
            for &entity in &mirror.entities {
                let told = &mut entities[entity];
                match &mirror.shape {
                    Shape::Plane(of) => {
                        let plane = of.plane.truncate().extend(of.plane.dot(eye.extend(1.0)));
                        let rows =
                            [&mut told.mirror_x, &mut told.mirror_y, &mut told.mirror_z, &mut told.mirror_offset];
                        let slot = told.mirror_share.iter().position(|share| *share == 0.0).unwrap_or(MOST - 1);
                        rows.into_iter().zip(plane.to_array()).for_each(|(row, of)| row[slot] = of as f32);
                        told.mirror_left[slot] = left as f32;
                        told.mirror_behind[slot] = (1.0 / (of.depth_step * of.height_m)) as f32;
                        told.mirror_share[slot] = mirror.share as f32;
                        told.mirror_view =
                            [part_width / width, part_height / height, part_width, focal_px].map(|x| x as f32);
                    }
                    Shape::Probe(probe) => {
                        let side = f64::from(probe.side);
                        told.probe = (probe.centre - eye).extend(side).as_vec4().to_array();
                        told.mirror_left[0] = left as f32;
                        told.mirror_behind[0] = probe.near_m as f32;
                        told.mirror_share[0] = mirror.share as f32;
                        told.mirror_view[3] = (0.5 * side * PROBE_ZOOM) as f32;
                    }
                }
            }
        }
    }
}

impl Reflectors {
    /// How pictures evaluate lights, and what they mirror of light that bounces so often.
    pub fn lights(
        &self,
        bounces: Bounces,
        pixels: Option<SharpPermutation>,
        highlights: Option<SharpPermutation>,
    ) -> PictureLights {
        let count = (self.faces.len() + self.curved.len()).min(MOST) as u32;
        let mirrored = match (count, self.curved.is_empty()) {
            (0, _) => Mirrored::Nothing,
            (_, true) => Mirrored::Planes,
            (_, false) => Mirrored::PlanesAndProbes,
        };
        // Of fewer bounces mirrors show one less, and pixels would add it.
        let mirrored_pixels = bounces == Bounces::All;
        PictureLights { pixels, highlights, mirrors: count, mirrored, mirrored_pixels }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::generate::{cuboid, sphere};
    use crate::draw::camera;
    use crate::scene::Camera;

    fn seen() -> SightCamera {
        let camera = Camera { eye: Vec3::new(0.3, 1.2, 3.0), target: Vec3::new(0.0, 0.4, 0.0), fov_deg: 40.0 };
        SightCamera {
            clip_from_world: camera::clip_from_world(&camera, 1.5),
            eye: camera.eye.as_dvec3(),
            near_m: camera::near_corner_m(&camera, 1.5),
            size: [96, 64],
            samples: false,
        }
    }

    /// What stands on a floor is seen where its mirror image is, nearer things have more depth, and what lies below the
    /// floor is clipped.
    #[test]
    fn the_mirrored_camera_sees_what_the_eye_sees_in_the_floor() {
        let seen = seen();
        let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, z)| DVec3::new(x, 0.0, z));
        let mirror = Plane::new(&seen, DVec4::Y, corners, [64, 64], [0, 0, 64, 64]);
        let through = |p: DVec3| mirror.camera.clip_from_world * p.extend(1.0);
        for point in [DVec3::new(0.2, 0.3, -0.5), DVec3::new(-0.4, 0.8, -3.0), DVec3::new(0.0, 2.0, -40.0)] {
            let clip = through(point);
            let image = seen.clip_from_world * (point * DVec3::new(1.0, -1.0, 1.0)).extend(1.0);
            assert!((clip.truncate().truncate() / clip.w - image.truncate().truncate() / image.w).length() < 1e-9);
            assert!(clip.z > 0.0 && clip.z < clip.w, "{point} {clip}");
            // The way from the mirrored eye crosses the floor at this share of itself.
            let crossing = mirror.height_m / (mirror.height_m + point.y);
            let at = mirror.camera.eye.lerp(point, crossing);
            let behind = (1.0 - clip.z / clip.w) / (mirror.depth_step * mirror.height_m) * through(at).w;
            // Distances count from where nothing is clipped.
            assert!((behind - (1.0 - crossing)).abs() < CLIPPED, "{point}: {behind} {crossing}");
        }
        // Places of the floor lie within all edges where they lie in the rectangle.
        for (place, is_within) in [([0.3, -0.8], true), ([-0.9, 0.9], true), ([1.1, 0.2], false), ([0.0, -1.3], false)]
        {
            let clip = seen.clip_from_world * DVec4::new(place[0], 0.0, place[1], 1.0);
            let at = (DVec3::new(clip.x, clip.y, clip.w) / clip.w).as_vec3();
            let positive = |edge: &[f32; 4]| glam::Vec4::from(*edge).truncate().dot(at) > 0.0;
            assert_eq!(mirror.edges.iter().all(positive), is_within, "{place:?}");
        }
        let below = through(DVec3::new(0.2, -0.1, -0.5));
        assert!(below.z > below.w, "{below}");
    }

    #[test]
    fn the_faces_of_a_box_are_flat_and_those_of_a_ball_are_not() {
        let (faces, share) = flat_faces(&cuboid(Vec3::new(1.0, 2.0, 3.0), 4));
        assert_eq!(faces.len(), 6);
        assert!((share - 1.0).abs() < 1e-6, "{share}");
        for (corners, normal) in &faces {
            let area = (corners[1] - corners[0]).length() * (corners[2] - corners[1]).length();
            let wanted = 6.0 / DVec3::new(1.0, 2.0, 3.0).dot(normal.abs());
            assert!((area - wanted).abs() < 1e-5, "{normal}: {area}");
        }
        assert_eq!(flat_faces(&sphere(1.0, 3)), (Vec::new(), 0.0));
        let Mesh { name, positions, normals, triangles, .. } = cuboid(Vec3::ONE, 1);
        let round = normals.iter().zip(&positions).map(|(normal, position)| (*normal + 0.2 * *position).normalize());
        let bevelled = Mesh::new(name, positions.clone(), round.collect(), None, triangles).unwrap();
        assert_eq!(flat_faces(&bevelled), (Vec::new(), 0.0));
    }

    #[test]
    fn a_polygon_covers_its_share_of_the_picture() {
        let seen = seen();
        let across = |half: f64| {
            let [x, y] = [half, half];
            [(-x, -y), (x, -y), (x, y), (-x, y)].map(|(x, y)| {
                let point = seen.clip_from_world.inverse() * DVec4::new(x, y, 1.0, 1.0);
                point.truncate() / point.w
            })
        };
        for (half, wanted) in [(0.5, 0.25), (1.0, 1.0), (3.0, 1.0)] {
            let share = share_of_picture(&within(seen.clip_from_world, across(half)));
            assert!((share - wanted).abs() < 1e-6, "{half}: {share}");
        }
    }
}
