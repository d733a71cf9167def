//! Changes of one entity at all times: its whole motion is moved, turned or scaled with it.

use crate::scene::data::EntityData;
use crate::scene::motion::{Motion, Node, RotationData};
use crate::scene::values::{POSITION_LIMIT_M, SCALE_LIMIT};
use glam::{DQuat, DVec3, Vec3};

/// The entity moved by `by` metres at all times; `None` if that leaves the range of a scene file.
pub fn moved(entity: &EntityData, by: DVec3) -> Option<EntityData> {
    let mut out = entity.clone();
    let shift = |p: &mut Vec3| {
        *p = (p.as_dvec3() + by).as_vec3();
        p.abs().max_element() <= POSITION_LIMIT_M
    };
    // What stands in a node moves with the outermost one, or with a still one around it where keys move that. Keyframes replace
    // what was before them, nodes too.
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

/// The entity scaled by a factor at all times; `None` if that leaves the range of a scene file.
pub fn scaled(entity: &EntityData, by: f64) -> Option<EntityData> {
    let mut out = entity.clone();
    let grow = |s: &mut f32| {
        *s = (f64::from(*s) * by) as f32;
        (1.0 / SCALE_LIMIT..=SCALE_LIMIT).contains(s)
    };
    let mut fits = grow(&mut out.scale);
    for motion in &mut out.motion {
        if let Motion::Keyframes { keys, .. } = motion {
            keys.iter_mut().filter_map(|k| k.scale.as_mut()).for_each(|s| fits &= grow(s));
        }
    }
    fits.then_some(out)
}

/// The entity turned by a world rotation about its own origin at all times. The axes of its spins turn with it; its path does
/// not. What stands in a node turns about the node's axes.
pub fn turned(entity: &EntityData, by: DQuat) -> EntityData {
    let mut out = entity.clone();
    let turn = |r: &mut RotationData| *r = RotationData::Quaternion((by * r.unit()).normalize().as_quat().to_array());
    turn(&mut out.rotation);
    for motion in &mut out.motion {
        match motion {
            Motion::Spin { axis, .. } => *axis = (by * axis.as_dvec3().normalize()).as_vec3(),
            Motion::Keyframes { keys, .. } => keys.iter_mut().filter_map(|k| k.rotation.as_mut()).for_each(turn),
            Motion::Orbit { .. } | Motion::Bob { .. } | Motion::Node(_) => {}
        }
    }
    out
}
