//! Rigid groups: entities that never move against each other. A vertex's own visibility is past its whole group, so
//! members never stand on each other's lists.

use super::Scene;
use super::light::Lights;
use super::motion::{Motion, Placement};
use glam::{Quat, Vec3};

/// The group of every entity.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Groups {
    of: Vec<u32>,
    /// Whether each entity is lit.
    receives: Vec<bool>,
    /// Whether each lets light through, so that it stands before all others as something that moves does.
    transparent: Vec<bool>,
    /// How many members of each group are lit.
    receivers: Vec<u32>,
    /// How many entities are lit.
    receiver_count: u32,
}

impl Groups {
    /// The groups of a scene: all entities at rest are one, and so are those that one node carries, as the pieces of a
    /// car, less those that are movable or were taken out (`Scene::loosen`). Whatever else moves is a group by itself.
    ///
    /// Lights in bands (`--lights sh`) meet what lies before them in the chain of a vertex, so that every entity is a
    /// group by itself there.
    pub fn new(scene: &Scene, lights: Lights) -> Self {
        if lights == Lights::Sh && scene.entities.iter().any(|entity| entity.emits) {
            return Groups::alone(scene);
        }
        // The first member of every group and what carries it, nothing where it rests.
        let mut firsts: Vec<(u32, &[Motion])> = Vec::new();
        let group = |entity: usize| {
            let Some(carriers) = scene.carriers(entity) else { return entity as u32 };
            let known = firsts.iter().find(|(_, motion)| *motion == carriers);
            known.map(|(first, _)| *first).unwrap_or_else(|| {
                firsts.push((entity as u32, carriers));
                entity as u32
            })
        };
        Groups::of(scene, (0..scene.entities.len()).map(group).collect())
    }

    /// Every entity by itself.
    pub fn alone(scene: &Scene) -> Self {
        Groups::of(scene, (0..scene.entities.len() as u32).collect())
    }

    fn of(scene: &Scene, of: Vec<u32>) -> Self {
        let receives: Vec<bool> = scene.entities.iter().map(|entity| entity.receives).collect();
        let mut receivers = vec![0; of.len()];
        for (&group, &lit) in of.iter().zip(&receives) {
            receivers[group as usize] += u32::from(lit);
        }
        let transparent = scene.entities.iter().map(|entity| entity.transparent).collect();
        Groups { receiver_count: receivers.iter().sum(), of, receives, transparent, receivers }
    }

    /// Whether the shadow or light of an entity can fall on another entity, because one other at least is lit.
    pub fn is_seen(&self, entity: usize) -> bool {
        self.receiver_count > u32::from(self.receives[entity])
    }

    /// Whether they can fall on an entity of another group.
    pub fn is_seen_by_others(&self, entity: usize) -> bool {
        self.receiver_count > self.receivers[self.of[entity] as usize]
            || (self.transparent[entity] && self.is_seen(entity))
    }

    /// Whether others of its own group are lit.
    pub fn is_seen_by_own(&self, entity: usize) -> bool {
        self.receivers[self.of[entity] as usize] > u32::from(self.receives[entity])
    }

    /// Whether a receiver's own visibility has the shadow of an occluder: they never move against each other, and it
    /// lets no light through.
    pub fn is_own(&self, receiver: usize, occluder: usize) -> bool {
        self.of[receiver] == self.of[occluder] && !self.transparent[occluder]
    }

    /// Whether two entities never move against each other.
    pub fn are_one(&self, a: usize, b: usize) -> bool {
        self.of[a] == self.of[b]
    }

    /// The first entity that rests and does not stand as in `stood`, or that is carried and does not stand so against the
    /// first member of its group. Rounding is allowed for.
    pub fn displaced(&self, scene: &Scene, stood: &[Placement], placements: &[Placement]) -> Option<usize> {
        let world = Placement { position: Vec3::ZERO, rotation: Quat::IDENTITY, scale: 1.0 };
        let is_displaced = |entity: usize| {
            let first = self.of[entity] as usize;
            let frames = if scene.is_at_rest(entity) { [&world; 2] } else { [&stood[first], &placements[first]] };
            let [was, is] = [&stood[entity], &placements[entity]];
            let expected = frames[1].point(frames[0].local(was.position.as_dvec3()));
            let turn = frames[1].turn() * frames[0].turn().inverse() * was.turn();
            let scale = was.scale / frames[0].scale * frames[1].scale;
            let radius_m = scene.meshes[scene.entities[entity].mesh].bounding_sphere().1 * scale;
            let ratio = f64::from(frames[1].scale / frames[0].scale);
            let numbers_m = ratio * f64::from(was.position.length() + frames[0].position.length())
                + expected.length()
                + f64::from(frames[1].position.length());
            let rounding_m = 1e-6 * numbers_m;
            expected.distance(is.position.as_dvec3()) > 1e-4 * f64::from(radius_m) + rounding_m
                || turn.dot(is.turn()).abs() < 1.0 - 1e-9
                || (is.scale / scale - 1.0).abs() > 1e-4
        };
        (0..scene.data.entities.len()).find(|&entity| is_displaced(entity))
    }

    /// Whether an entity moves against others, which are flagged and of one group.
    pub fn moves_among(&self, entity: usize, others: &[bool]) -> bool {
        others.iter().position(|other| *other).is_some_and(|other| !self.are_one(entity, other))
    }

    /// The members of every group, in order.
    pub fn members(&self) -> Vec<Vec<usize>> {
        let mut members = vec![Vec::new(); self.of.len()];
        for (entity, &group) in self.of.iter().enumerate() {
            members[group as usize].push(entity);
        }
        members.retain(|members| !members.is_empty());
        members
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::embedded;
    use std::path::Path;

    fn scene(emission: &str) -> Scene {
        let text = format!(
            "[camera]\neye = [0, 0, 5]\ntarget = [0, 0, 0]\n\
             [[mesh]]\nname = \"ball\"\nsphere = {{ radius_m = 0.5, subdivisions = 1 }}\n\
             [[mesh]]\nname = \"rings\"\ntorus_two_colour = {{ major_m = 0.3, minor_m = 0.1, segments = 12, sides = 6 }}\n\
             [[entity]]\nmesh = \"ball\"\n[[entity]]\nmesh = \"ball\"\nmotion = [{{ spin = {{ period_s = 4 }} }}]\n\
             [[entity]]\nmesh = \"ball\"\nposition = [2, 0, 0]\n[[entity]]\nmesh = \"rings\"\n{emission}\n"
        );
        Scene::parse(&text, Path::new("test.toml"), &embedded::read).unwrap()
    }

    #[test]
    fn entities_at_rest_are_one_group() {
        let mut scene = scene("");
        let groups = Groups::new(&scene, Lights::Sharp);
        assert_eq!(groups.members(), [vec![0, 2, 3], vec![1]]);
        assert!(groups.is_own(0, 3) && !groups.is_own(0, 1));
        assert_eq!([0, 1, 2].map(|entity| groups.is_seen_by_own(entity)), [true, false, true]);
        assert!(!Groups::alone(&scene).is_seen_by_own(0));
        scene.loosen(0);
        assert_eq!(Groups::new(&scene, Lights::Sharp).members(), [vec![0], vec![1], vec![2, 3]]);
        scene.data.entities[3].movable = true;
        assert_eq!(Groups::new(&scene, Lights::Sharp).members(), [[0], [1], [2], [3]]);
        assert_eq!(Groups::alone(&scene).members(), [[0], [1], [2], [3]]);
    }

    #[test]
    fn entities_that_one_node_carries_are_one_group() {
        let carried = |x: f32| {
            let node = format!(
                "motion = [{{ node = {{ position_keys = {{ times_s = [0, 1], values = [[0, 0, 0], [{x}, 0, 0]] }} }} }}]"
            );
            format!("[[entity]]\nmesh = \"ball\"\n{node}\n")
        };
        let mut scene = scene(&[1.0, 2.0, 1.0, 1.0].map(carried).concat());
        assert_eq!(Groups::new(&scene, Lights::Sharp).members(), [vec![0, 2, 3], vec![1], vec![4, 6, 7], vec![5]]);
        let groups = Groups::new(&scene, Lights::Sharp);
        let stood = scene.at(0.0);
        let displaced = |placements: &[Placement]| groups.displaced(&scene, &stood, placements);
        let with = |change: &dyn Fn(usize, Placement) -> Placement| -> Vec<Placement> {
            stood.iter().enumerate().map(|(entity, placement)| change(entity, *placement)).collect()
        };
        let turned = |placement: Placement| {
            let turn = Placement { position: Vec3::Y, rotation: Quat::from_rotation_y(0.7), scale: 1.5 };
            Placement {
                position: turn.point(placement.position.as_dvec3()).as_vec3(),
                rotation: turn.rotation * placement.rotation,
                scale: turn.scale * placement.scale,
            }
        };
        let raised = |placement: Placement| Placement { position: placement.position + 0.01 * Vec3::Y, ..placement };
        let carried = |entity| [4, 6, 7].contains(&entity);
        assert_eq!([displaced(&stood), displaced(&scene.at(0.37))], [None; 2]);
        assert_eq!(displaced(&with(&|entity, at| if carried(entity) { turned(at) } else { at })), None);
        assert_eq!(
            displaced(&with(&|entity, at| if carried(entity) && entity != 7 { turned(at) } else { at })),
            Some(7)
        );
        assert_eq!(displaced(&with(&|entity, at| if entity == 6 { raised(at) } else { at })), Some(6));
        assert_eq!(displaced(&with(&|entity, at| if entity == 2 { raised(at) } else { at })), Some(2));
        assert_eq!(displaced(&with(&|entity, at| if [1, 5].contains(&entity) { raised(at) } else { at })), None);
        scene.loosen(6);
        assert_eq!(Groups::new(&scene, Lights::Sharp).members()[2..], [vec![4, 7], vec![5], vec![6]]);
    }

    #[test]
    fn an_entity_is_seen_where_another_is_lit() {
        let mut scene = scene("");
        for entity in &mut scene.entities {
            entity.receives = false;
        }
        let seen = |scene: &Scene| {
            let groups = Groups::new(scene, Lights::Sharp);
            (0..4).map(|e| (groups.is_seen(e), groups.is_seen_by_others(e))).collect::<Vec<_>>()
        };
        assert_eq!(seen(&scene), [(false, false); 4]);
        scene.entities[2].receives = true;
        assert_eq!(seen(&scene), [(true, false), (true, true), (false, false), (true, false)]);
        scene.entities[1].receives = true;
        assert_eq!(seen(&scene), [(true, true); 4]);
    }

    #[test]
    fn a_light_in_bands_leaves_every_entity_alone() {
        let scene = scene("emission = [1, 1, 1]");
        assert_eq!(Groups::new(&scene, Lights::Sh), Groups::alone(&scene));
        assert_ne!(Groups::new(&scene, Lights::Sharp), Groups::alone(&scene));
    }
}
