//! A move of one entity at all times: its whole motion moves with it. And what is moved with it.

use crate::scene::data::{Data, EntityData, MeshData};
use crate::scene::motion::{Motion, Node};
use crate::scene::values::POSITION_LIMIT_M;
use glam::{DQuat, DVec3, Vec3};

/// The entity moved by `by` metres at all times; `None` if that leaves the range of a scene file.
pub fn moved(entity: &EntityData, by: DVec3) -> Option<EntityData> {
    let mut out = entity.clone();
    let shift = |p: &mut Vec3| {
        *p = (p.as_dvec3() + by).as_vec3();
        p.abs().max_element() <= POSITION_LIMIT_M
    };
    // Parts in a node move with the outermost one, or with a still one around it where keys move that. Keyframes
    // replace what was before them, nodes too.
    let mut fits = true;
    let placed = out.motion.iter().rposition(|motion| matches!(motion, Motion::Node(_) | Motion::Keyframes { .. }));
    let mut first = 0;
    match placed.map(|last| (last, &mut out.motion[last])) {
        Some((last, Motion::Node(node))) => {
            first = last + 1;
            if node.position_keys.is_none() {
                fits &= shift(&mut node.position);
            } else {
                let around = Node::still(by.as_vec3(), DQuat::IDENTITY, 1.0);
                fits &= around.position.abs().max_element() <= POSITION_LIMIT_M;
                out.motion.insert(first, Motion::Node(Box::new(around)));
            }
        }
        _ => fits &= shift(&mut out.position),
    }
    for motion in &mut out.motion[first..] {
        match motion {
            Motion::Orbit { centre, .. } => fits &= shift(centre),
            Motion::Keyframes { keys, .. } => {
                keys.iter_mut().filter_map(|k| k.position.as_mut()).for_each(|p| fits &= shift(p));
            }
            Motion::Spin { .. } | Motion::Bob { .. } | Motion::Node(_) => {}
        }
    }
    fits.then_some(out)
}

/// The entities that are pieces of the same thing as one of them, in order: that one alone where its mesh is whole.
pub fn pieces(data: &Data, entity: usize) -> Vec<usize> {
    let own = &data.entities[entity];
    let mesh_of = |entity: &EntityData| data.meshes.iter().find(|mesh| mesh.name == entity.mesh);
    let Some(mesh) = mesh_of(own).filter(|mesh| mesh.piece.is_some()) else { return vec![entity] };
    let stands_with = |other: &EntityData| {
        (other.position, other.rotation, other.scale) == (own.position, own.rotation, own.scale)
            && other.motion == own.motion
    };
    let is_cut_from_it = |other: &MeshData| {
        other.piece.is_some() && (&other.file, other.part, other.pose) == (&mesh.file, mesh.part, mesh.pose)
    };
    let is_piece = |other: &EntityData| stands_with(other) && mesh_of(other).is_some_and(is_cut_from_it);
    (0..data.entities.len()).filter(|&other| is_piece(&data.entities[other])).collect()
}
