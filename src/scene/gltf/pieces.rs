//! Primitives that become several entities: tables as boards and legs, lamps as bulbs.

use std::collections::HashSet;

use glam::{Mat3, Vec3};

use super::join::{Candidate, halve};
use crate::asset::Mesh;
use crate::asset::bars::{self, BARS_LIMIT, longest_axis};
use crate::asset::mesh::area_m2;
use crate::asset::topology::{self, loose, subset};

/// Most solids that a primitive is cut into, and most of these that are not convex: the outlines of one take 0.6 s, unless
/// another has its shape.
const SOLIDS_LIMIT: usize = 256;
const CONCAVE_LIMIT: usize = 64;
/// A solid of less than this share of the area stays with the rest.
const SMALL_SOLID: f64 = 1e-3;

/// Least area of a wall that is cut off, of its primitive's, and most walls of a piece.
const WALL: f64 = 0.02;
const WALLS_LIMIT: usize = 16;
/// Least share of a room's area that is walls.
const MOSTLY_WALLS: f64 = 0.5;
/// Planes whose normals have this cosine at least, and that no corner leaves by more than this share of the piece, are one.
const SAME_PLANE: f32 = 0.99999;
const ON_PLANE: f32 = 1e-5;

/// Most lamps that a primitive is cut into; of more, neighbours are one.
const LAMPS_LIMIT: usize = 32;
/// Most pieces among which neighbours are found.
const NEIGHBOURS_LIMIT: usize = 4096;
/// A lamp is bent if it is thin, of less area than this share of its length's square, and fills less of the box along its
/// axes than this: a straight tube has 0.8 of the box's area, a ring of neon 0.2, an eighth of it 0.54.
const THIN: f32 = 0.5;
const BENT: f32 = 0.6;
/// Length of a half of a bent lamp at most, as a share of the whole.
const HALVED: f32 = 0.8;
/// Triangles of a bent lamp at least, and most halvings of it.
const BENT_TRIANGLES: usize = 16;
const HALVINGS: u32 = 4;

/// Pieces of a surface: the numbers of their triangles.
type Pieces = Vec<Vec<u32>>;

/// The number of the piece that each triangle belongs to: bars together, whose shadows are in closed form, solids, whose
/// outlines hold up to where they touch, the walls of rooms, and last the rest. All are 0 where there are no pieces.
pub fn solids(positions: &[Vec3], triangles: &[[u32; 3]]) -> Vec<u32> {
    let area = |piece: &[u32]| area_m2(positions, &subset(triangles, piece));
    let whole = area_m2(positions, triangles);
    let is_solid = |piece: &Vec<u32>| {
        area(piece) >= SMALL_SOLID * whole && topology::is_closed_either_way(positions, &subset(triangles, piece))
    };
    let mut bars = Pieces::new();
    let mut room = 0;
    let mut others = Pieces::new();
    for piece in loose(positions, triangles) {
        match bars::bar(positions, &subset(triangles, &piece)) {
            Some(boxes) if boxes.len() <= BARS_LIMIT => {
                if boxes.len() > room {
                    bars.push(Vec::new());
                    room = BARS_LIMIT;
                }
                room -= boxes.len();
                bars.last_mut().expect("the first piece finds no room").extend(piece);
            }
            _ => others.push(piece),
        }
    }
    others.sort_by(|a, b| area(b).total_cmp(&area(a)));
    let mut room = CONCAVE_LIMIT;
    let (solids, mut rest): (Pieces, Pieces) = others.into_iter().partition(|piece| {
        if !is_solid(piece) {
            return false;
        }
        let is_convex = topology::is_convex(positions, &subset(triangles, piece));
        let is_cut_off = is_convex || room > 0;
        room -= usize::from(is_cut_off && !is_convex);
        is_cut_off
    });
    let mut cut_off = bars;
    cut_off.extend(solids);
    if cut_off.len() >= SOLIDS_LIMIT {
        rest.extend(cut_off.split_off(SOLIDS_LIMIT - 1));
    }
    let mut walls = Vec::new();
    rest.iter_mut().for_each(|piece| cut_walls(positions, triangles, piece, WALL * whole, &mut walls));
    if cut_off.len() + walls.len() < SOLIDS_LIMIT {
        cut_off.extend(walls);
    } else {
        rest.extend(walls);
    }
    // What has nearly no area is no mesh of its own.
    let rest_m2: f64 = rest.iter().map(|piece| area(piece)).sum();
    let has_rest = rest_m2 > 1e-6 * whole;
    let count = cut_off.len() + usize::from(has_rest);
    if !(2..=SOLIDS_LIMIT).contains(&count) {
        return vec![0; triangles.len()];
    }
    let last = if has_rest { cut_off.len() as u32 } else { 0 };
    let mut numbers = vec![last; triangles.len()];
    number(&mut numbers, &cut_off);
    numbers
}

/// Whether a piece but the last, which is the rest, hangs together and is not convex.
pub fn any_concave(positions: &[Vec3], triangles: &[[u32; 3]], numbers: &[u32]) -> bool {
    let last = numbers.iter().max().copied().unwrap_or(0);
    let is_concave = |piece: u32| {
        let own: Vec<u32> = (0..).zip(numbers).filter(|(_, number)| **number == piece).map(|(of, _)| of).collect();
        let own = subset(triangles, &own);
        loose(positions, &own).len() == 1 && !topology::is_convex(positions, &own)
    };
    (0..last).any(is_concave)
}

/// The number of the lamp that each triangle belongs to. A light of one outline is right from afar: each of the bulbs of
/// a chandelier is a lamp, and so is each part of a ring that is bent.
pub fn lamps(positions: &[Vec3], triangles: &[[u32; 3]]) -> Vec<u32> {
    let mut pieces = loose(positions, triangles);
    let mut numbers = vec![0; triangles.len()];
    if pieces.len() > NEIGHBOURS_LIMIT {
        return numbers;
    }
    join_touching(positions, triangles, &mut pieces);
    // What has nearly no area is no mesh of its own.
    let whole = area_m2(positions, triangles);
    pieces.retain(|piece| area_m2(positions, &subset(triangles, piece)) > 1e-6 * whole);
    let mut lamps = Vec::new();
    if pieces.len() > LAMPS_LIMIT {
        let size = pieces.len().div_ceil(LAMPS_LIMIT / 2);
        let candidate = |(part, piece): (usize, &Vec<u32>)| {
            let [low, high] = extent(positions, triangles, piece);
            let centre = (low + high).as_dvec3() / 2.0;
            Candidate { part, kind: (), centre, radius_m: 0.0, triangle_count: piece.len() }
        };
        let mut candidates: Vec<_> = pieces.iter().enumerate().map(candidate).collect();
        let mut groups = Vec::new();
        halve(&mut candidates, &mut groups, &|group| group.len() <= size);
        lamps
            .extend(groups.iter().map(|group| group.iter().flat_map(|part| pieces[*part].clone()).collect::<Vec<_>>()));
    } else {
        pieces.iter().for_each(|piece| unbend(positions, triangles, piece, HALVINGS, &mut lamps));
    }
    number(&mut numbers, if lamps.len() <= LAMPS_LIMIT { &lamps } else { &pieces });
    numbers
}

fn number(numbers: &mut [u32], pieces: &[Vec<u32>]) {
    for (number, piece) in (0..).zip(pieces) {
        piece.iter().for_each(|triangle| numbers[*triangle as usize] = number);
    }
}

/// The box around a piece.
fn extent(positions: &[Vec3], triangles: &[[u32; 3]], piece: &[u32]) -> [Vec3; 2] {
    let corners = || piece.iter().flat_map(|triangle| triangles[*triangle as usize]).map(|v| positions[v as usize]);
    [corners().fold(Vec3::MAX, Vec3::min), corners().fold(Vec3::MIN, Vec3::max)]
}

/// Takes the walls out of a room, the flat rectangles of an open piece that face its middle: each blocks in closed form,
/// where the shell that they are part of has the coarse maps of its vertices. Walls of less than `least_m2` stay. A shell
/// that is closed may be a solid that was wound inside out.
fn cut_walls(positions: &[Vec3], triangles: &[[u32; 3]], piece: &mut Vec<u32>, least_m2: f64, walls: &mut Pieces) {
    let own = subset(triangles, piece);
    let area = area_m2(positions, &own);
    if area < 2.0 * least_m2 {
        return;
    }
    let [low, high] = extent(positions, triangles, piece);
    let middle = (low + high) / 2.0;
    let off_plane_m = ON_PLANE * low.distance(high);
    let mut planes: Vec<(Vec3, f32, Vec<u32>)> = Vec::new();
    for &triangle in piece.iter() {
        let [a, b, c] = triangles[triangle as usize].map(|v| positions[v as usize] - middle);
        let Some(normal) = (b - a).cross(c - a).try_normalize() else { continue };
        let holds = |(along, offset, _): &(Vec3, f32, Vec<u32>)| {
            along.dot(normal) > SAME_PLANE
                && [a, b, c].iter().all(|corner| (along.dot(*corner) - offset).abs() < off_plane_m)
        };
        match planes.iter().position(holds) {
            Some(plane) => planes[plane].2.push(triangle),
            None if planes.len() == 4 * WALLS_LIMIT => return,
            None => planes.push((normal, normal.dot(a), vec![triangle])),
        }
    }
    let mut found = Vec::new();
    let mut walls_m2 = 0.0;
    for (_, offset, plane) in planes {
        let own = subset(triangles, &plane);
        if offset >= 0.0 || area_m2(positions, &own) < least_m2 {
            continue;
        }
        let (corners, own) = topology::apart(positions, &own);
        for part in loose(&corners, &own) {
            let Ok(wall) = Mesh::new("", corners.clone(), Vec::new(), None, subset(&own, &part)) else { continue };
            if wall.rectangle().is_some() && wall.area_m2() >= least_m2 {
                walls_m2 += wall.area_m2();
                found.push(part.iter().map(|number| plane[*number as usize]).collect::<Vec<u32>>());
            }
        }
    }
    if (2..=WALLS_LIMIT).contains(&found.len())
        && walls_m2 > MOSTLY_WALLS * area
        && !topology::is_closed_either_way(positions, &own)
    {
        let taken: HashSet<u32> = found.iter().flatten().copied().collect();
        piece.retain(|triangle| !taken.contains(triangle));
        walls.extend(found);
    }
}

/// Makes one of pieces whose boxes touch: a filament and its bulb, the six faces of a box.
fn join_touching(positions: &[Vec3], triangles: &[[u32; 3]], pieces: &mut Pieces) {
    let mut joined: Vec<(Vec<u32>, [Vec3; 2])> = Vec::new();
    for mut piece in pieces.drain(..) {
        let mut around = extent(positions, triangles, &piece);
        let touches = |[low, high]: [Vec3; 2], other: [Vec3; 2]| {
            let slack = 1e-3 * (high - low).max(other[1] - other[0]).max_element();
            low.cmple(other[1] + slack).all() && other[0].cmple(high + slack).all()
        };
        while let Some(other) = joined.iter().position(|(_, other)| touches(around, *other)) {
            let (mut more, [low, high]) = joined.swap_remove(other);
            if more.len() > piece.len() {
                std::mem::swap(&mut more, &mut piece);
            }
            piece.extend(more);
            around = [around[0].min(low), around[1].max(high)];
        }
        joined.push((piece, around));
    }
    pieces.extend(joined.into_iter().map(|(mut piece, _)| {
        piece.sort_unstable();
        piece
    }));
    pieces.sort_unstable_by_key(|piece| piece[0]);
}

/// Cuts a bent piece in halves across its longest extent, and these again.
fn unbend(positions: &[Vec3], triangles: &[[u32; 3]], piece: &[u32], halvings: u32, out: &mut Pieces) {
    let own = subset(triangles, piece);
    let axes = own_axes(positions, &own);
    let along = |triangle: &[u32; 3]| triangle.map(|v| axes.transpose() * positions[v as usize]);
    let corners = || own.iter().flat_map(along);
    let low = corners().fold(Vec3::MAX, Vec3::min);
    let size = corners().fold(Vec3::MIN, Vec3::max) - low;
    let box_m2 = 2.0 * (size.x * size.y + size.y * size.z + size.z * size.x);
    let area = area_m2(positions, &own) as f32;
    let is_bent = piece.len() >= BENT_TRIANGLES && area < THIN * size.x * size.x && area < BENT * box_m2;
    let middle = 3.0 * (low.x + 0.5 * size.x);
    let is_before = |triangle: &u32| along(&triangles[*triangle as usize]).iter().map(|at| at.x).sum::<f32>() < middle;
    let (before, behind): (Vec<u32>, Vec<u32>) = piece.iter().copied().partition(is_before);
    let length = |half: &[u32]| {
        let places = || half.iter().flat_map(|triangle| along(&triangles[*triangle as usize])).map(|at| at.x);
        places().fold(f32::MIN, f32::max) - places().fold(f32::MAX, f32::min)
    };
    // Triangles as long as a tube are in neither half of it.
    let is_halved = || [&before, &behind].into_iter().all(|half| !half.is_empty() && length(half) < HALVED * size.x);
    if halvings == 0 || !is_bent || !is_halved() {
        return out.push(piece.to_vec());
    }
    unbend(positions, triangles, &before, halvings - 1, out);
    unbend(positions, triangles, &behind, halvings - 1, out);
}

/// Axes of a piece, from its longest extent to its shortest.
fn own_axes(positions: &[Vec3], piece: &[[u32; 3]]) -> Mat3 {
    let corners = || piece.iter().flatten().map(|v| positions[*v as usize]);
    let x = longest_axis(|| corners().map(|corner| corner.as_dvec3())).as_vec3();
    let middle = corners().sum::<Vec3>() / (3 * piece.len()) as f32;
    let across = |corner: Vec3| (corner - middle).reject_from_normalized(x);
    let y = corners().map(across).max_by(|a, b| a.length().total_cmp(&b.length())).unwrap_or_default();
    let y = y.try_normalize().unwrap_or_else(|| x.any_orthonormal_vector());
    Mat3::from_cols(x, y, x.cross(y))
}
