//! Nodes: where each stands, at rest and over time.
//!
//! What stands still between a moving node and the next is folded into one transformation. Placements have one positive
//! scale, so a transformation splits into a placement and a *bend*: an upper triangular matrix, which is baked into a
//! copy of the mesh.

use ::gltf::json::scene::Node as NodeJson;
use glam::{DAffine3, DMat3, DMat4, DQuat, DVec3, Quat, Vec3};

use super::accessor;
use super::animation::Tracks;
use super::document::Document;
use super::notes::Notes;
use crate::error::Result;
use crate::scene::data::EntityData;
use crate::scene::motion::{Motion, Node, RotationData};
use crate::scene::values::{POSITION_LIMIT_M, SCALE_LIMIT};

/// Largest number of nodes that stand in one another.
const DEPTH_LIMIT: usize = 256;
/// Largest number of keys of all motions, counted for every node that they carry.
const KEY_LIMIT: usize = 1_000_000;
/// Largest number of nodes and instances.
const INSTANCE_LIMIT: usize = 1_000_000;
/// What differs by less than this share of the largest is the same: f32 transformations are rounded.
const SAME: f64 = 1e-5;
/// A rotation whose length differs from 1 by more than this is noted.
const UNIT: f64 = 0.005;

/// Where a node stands.
#[derive(Clone, Debug, Default)]
pub struct Stand {
    pub node: usize,
    /// What stands still about it, from its own space to that of the moving node that carries it, or to the world.
    pub fixed: DAffine3,
    /// What carries it, from the nearest to the outermost.
    pub motion: Vec<Motion>,
    /// From its own space to the world as the file's transformations place it at rest.
    pub rest: DAffine3,
}

impl Stand {
    /// From its own space to the world at a time.
    pub fn at(&self, time_s: f64) -> DAffine3 {
        let carried = EntityData { motion: self.motion.clone(), ..EntityData::of_mesh("") }.at(time_s);
        let carried = DAffine3::from_scale_rotation_translation(
            DVec3::splat(f64::from(carried.scale)),
            carried.turn(),
            carried.position.as_dvec3(),
        );
        carried * self.fixed
    }
}

/// A transformation as a placement and what is left of it.
pub struct SplitTransform {
    pub rotation: DQuat,
    /// Upper triangular; a multiple of the identity if the scale is uniform.
    pub bend: DMat3,
}

impl SplitTransform {
    /// Splits a linear map by Gram and Schmidt's method; `None` if it squeezes space flat.
    pub fn new(linear: DMat3) -> Option<Self> {
        let longest = linear.to_cols_array_2d().into_iter().map(|c| DVec3::from(c).length()).fold(0.0, f64::max);
        let x = linear.x_axis.try_normalize()?;
        let y = (linear.y_axis - x * x.dot(linear.y_axis)).try_normalize()?;
        let z = x.cross(y);
        let turn = DMat3::from_cols(x, y, z);
        let bend = turn.transpose() * linear;
        // A mirror is left to the bend: the three columns are right-handed.
        if bend.determinant().abs() < 1e-9 * longest.powi(3) || !bend.is_finite() {
            return None;
        }
        // Rounded, so that instances of one scale in several rotations share one mesh.
        let grid = 2.0_f64.powi(longest.log2().ceil() as i32 - 20);
        let round = |column: DVec3| (column / grid).round() * grid;
        let bend = DMat3::from_cols(round(bend.x_axis), round(bend.y_axis), round(bend.z_axis));
        Some(SplitTransform { rotation: DQuat::from_mat3(&turn).normalize(), bend })
    }

    /// The scale, if it is the same along all axes and mirrors nothing.
    pub fn uniform_scale(&self) -> Option<f64> {
        let scale = self.bend.x_axis.x;
        let rest = self.bend - DMat3::from_diagonal(DVec3::splat(scale));
        let largest = rest.to_cols_array().into_iter().fold(0.0, |most: f64, x| most.max(x.abs()));
        (largest <= SAME * scale && scale > 0.0).then_some(scale)
    }

    /// What is baked into a copy of the mesh: nothing of a uniform scale.
    pub fn baked(&self) -> DMat3 {
        if self.uniform_scale().is_some() { DMat3::IDENTITY } else { self.bend }
    }
}

/// All nodes of the file's scene, those that carry before those that are carried.
pub fn stands(document: &Document, tracks: &[Option<Tracks>], notes: &mut Notes) -> Result<Vec<Stand>> {
    let root = &document.root;
    let mut seen = vec![false; root.nodes.len()];
    let scene = root.scene.map_or(0, |scene| scene.value());
    let roots: Vec<usize> = match root.scenes.get(scene) {
        Some(scene) => scene.nodes.iter().map(|node| node.value()).collect(),
        None => {
            let children = root.nodes.iter().flat_map(|node| node.children.iter().flatten());
            let carried: std::collections::HashSet<usize> = children.map(|child| child.value()).collect();
            (0..root.nodes.len()).filter(|node| !carried.contains(node)).collect()
        }
    };
    notes.leave_out_many("further scenes", root.scenes.len().saturating_sub(1));
    let mut open: Vec<(usize, usize, Stand)> =
        roots.into_iter().rev().map(|node| (node, 1, Stand::default())).collect();
    let mut out = Vec::new();
    let mut keys = 0;
    while let Some((index, depth, outer)) = open.pop() {
        let place = format!("nodes[{index}]");
        if std::mem::replace(&mut seen[index], true) {
            return Err(document.fail(place, "it stands in two nodes, or in itself"));
        }
        if depth > DEPTH_LIMIT {
            return Err(document.fail(place, format!("over the limit of {DEPTH_LIMIT} nodes in one another")));
        }
        let moves =
            tracks[index].as_ref().filter(|t| t.position.is_some() || t.rotation.is_some() || t.scale.is_some());
        let stand = placed(document, index, &outer, moves, notes)?;
        let key_count = |motion: &Motion| if let Motion::Node(node) = motion { node.times_s().count() } else { 0 };
        keys += stand.motion.iter().map(|motion| 1 + key_count(motion)).sum::<usize>();
        if keys > KEY_LIMIT {
            return Err(document.fail(place, format!("over the limit of {KEY_LIMIT} keys, counted for every node")));
        }
        let children = root.nodes[index].children.iter().flatten().rev();
        open.extend(children.map(|child| (child.value(), depth + 1, stand.clone())));
        match instances(document, index)? {
            None => out.push(stand),
            Some(own) => {
                if out.len() + own.len() > INSTANCE_LIMIT {
                    return Err(document.fail(place, format!("over the limit of {INSTANCE_LIMIT} nodes and instances")));
                }
                out.extend(own.into_iter().map(|own| Stand {
                    fixed: stand.fixed * own,
                    rest: stand.rest * own,
                    ..stand.clone()
                }));
            }
        }
    }
    Ok(out)
}

/// The instances of a node's mesh, within the node (`EXT_mesh_gpu_instancing`).
fn instances(document: &Document, index: usize) -> Result<Option<Vec<DAffine3>>> {
    const NAME: &str = "EXT_mesh_gpu_instancing";
    let extension = document.root.nodes[index].extensions.as_ref().and_then(|e| e.others.get(NAME));
    let Some(extension) = extension else { return Ok(None) };
    let place = format!("nodes[{index}].extensions.{NAME}");
    let read = |name: &str, width: usize| {
        let Some(value) = extension.get("attributes").and_then(|attributes| attributes.get(name)) else {
            return Ok(None);
        };
        let accessor = value.as_u64().filter(|index| (*index as usize) < document.root.accessors.len());
        let accessor =
            accessor.ok_or_else(|| document.fail(&place, format!("{name}: there is no accessor {value}")))?;
        accessor::numbers(document, accessor as usize, &[width]).map(Some)
    };
    let positions = read("TRANSLATION", 3)?;
    let rotations = read("ROTATION", 4)?;
    let scales = read("SCALE", 3)?;
    let counts = [(&positions, 3), (&rotations, 4), (&scales, 3)];
    let mut counts = counts.into_iter().filter_map(|(numbers, width)| Some(numbers.as_ref()?.len() / width));
    let Some(count) = counts.next() else { return Ok(None) };
    if counts.any(|other| other != count) {
        return Err(document.fail(place, "its attributes have different numbers of instances"));
    }
    let triple = |numbers: &Option<Vec<f32>>, i: usize, default: f64| {
        numbers.as_ref().map_or(DVec3::splat(default), |n| Vec3::from_slice(&n[3 * i..]).as_dvec3())
    };
    let instance = |i: usize| {
        let rotation = rotations.as_ref().map_or(DQuat::IDENTITY, |n| Quat::from_slice(&n[4 * i..]).as_dquat());
        let position = triple(&positions, i, 0.0);
        let scale = triple(&scales, i, 1.0);
        let within = |v: DVec3| v.abs().max_element() <= f64::from(POSITION_LIMIT_M);
        let usable = rotation.length() > 1e-6 && within(position) && within(scale);
        let rotation = if usable { rotation.normalize() } else { DQuat::IDENTITY };
        usable.then(|| DAffine3::from_scale_rotation_translation(scale, rotation, position))
    };
    let all: Option<Vec<_>> = (0..count).map(instance).collect();
    all.map(Some).ok_or_else(|| document.fail(place, "an instance is too large, too far out, or its rotation is 0"))
}

/// Where a node stands within its parent.
fn placed(
    document: &Document,
    index: usize,
    outer: &Stand,
    tracks: Option<&Tracks>,
    notes: &mut Notes,
) -> Result<Stand> {
    let node = &document.root.nodes[index];
    let fail = |what: &str| document.fail(format!("nodes[{index}]"), what);
    let (position, rotation, scale) =
        properties(node).ok_or_else(|| fail("its transformation is not finite, too large, or its rotation is 0"))?;
    let own = match node.matrix {
        Some(matrix) if !matrix.iter().all(|x| x.abs() <= POSITION_LIMIT_M) => {
            return Err(fail("its matrix is not finite, or too large"));
        }
        Some(matrix) => DAffine3::from_mat4(DMat4::from_cols_array(&matrix.map(f64::from))),
        None => DAffine3::from_scale_rotation_translation(scale, rotation, position),
    };
    let parts_too = node.translation.is_some() || node.rotation.is_some() || node.scale.is_some();
    if node.matrix.is_some() && parts_too {
        notes.leave_out("translations, rotations and scales of nodes that have a matrix (the matrix counts)");
    }
    let turn = node.rotation.unwrap_or_default().0;
    if (DQuat::from_array(turn.map(f64::from)).length() - 1.0).abs() > UNIT {
        notes.leave_out("lengths of rotations that are not 1 (they are brought to 1)");
    }
    let rest = outer.rest * own;
    if rest.translation.to_array().iter().any(|x| x.is_nan() || x.abs() > f64::from(POSITION_LIMIT_M)) {
        return Err(fail("it stands beyond the limit of 1e7 m"));
    }
    let Some(tracks) = tracks else {
        return Ok(Stand { node: index, fixed: outer.fixed * own, motion: outer.motion.clone(), rest });
    };
    if node.matrix.is_some() {
        return Err(fail("an animated node has a translation, rotation and scale, but this has a matrix"));
    }
    // What carries the moving node and stands still.
    let mut motion = Vec::new();
    if outer.fixed != DAffine3::IDENTITY {
        let linear = outer.fixed.matrix3;
        let parts =
            SplitTransform::new(linear).unwrap_or(SplitTransform { rotation: DQuat::IDENTITY, bend: DMat3::IDENTITY });
        let size = parts.uniform_scale().unwrap_or_else(|| {
            notes.leave_out(
                "uneven scales of nodes that carry moving ones (one scale of the same volume stands for them)",
            );
            linear.determinant().abs().cbrt()
        });
        motion.push(Motion::Node(Box::new(Node::still(
            outer.fixed.translation.as_vec3(),
            parts.rotation,
            within(size),
        ))));
    }
    motion.extend(outer.motion.iter().cloned());
    // Uneven scales that do not move are left to what the node carries.
    let even = SplitTransform::new(DMat3::from_diagonal(scale)).and_then(|parts| parts.uniform_scale());
    let (size, fixed) = match even {
        Some(size) => (size, DAffine3::IDENTITY),
        None if tracks.scale.is_none() => (1.0, DAffine3::from_scale(scale)),
        None => (1.0, DAffine3::IDENTITY),
    };
    let moving = Node {
        position_keys: tracks.position.clone(),
        rotation_keys: tracks.rotation.clone(),
        scale_keys: tracks.scale.clone(),
        ..Node::still(position.as_vec3(), rotation, within(size))
    };
    motion.insert(0, Motion::Node(Box::new(moving)));
    Ok(Stand { node: index, fixed, motion, rest })
}

fn within(scale: f64) -> f32 {
    (scale as f32).clamp(1.0 / SCALE_LIMIT, SCALE_LIMIT)
}

/// Translation, unit rotation and scale; `None` if a number is out of range.
fn properties(node: &NodeJson) -> Option<(DVec3, DQuat, DVec3)> {
    let within = |numbers: &[f32]| numbers.iter().all(|x| x.abs() <= POSITION_LIMIT_M);
    let position = node.translation.unwrap_or_default();
    let scale = node.scale.unwrap_or([1.0; 3]);
    let rotation = node.rotation.unwrap_or_default().0;
    let length = DQuat::from_array(rotation.map(f64::from)).length();
    let usable = within(&position) && within(&scale) && within(&rotation) && length > 1e-6;
    let unit = || RotationData::Quaternion(rotation).unit();
    usable.then(|| (Vec3::from(position).as_dvec3(), unit(), Vec3::from(scale).as_dvec3()))
}
