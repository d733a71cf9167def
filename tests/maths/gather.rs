//! Cluster lists: those made through a tree are those of a look at everything, in their order.

use glam::{DQuat, DVec3};
use shadow_fields::layout::{DeviceEntity, ListEntry};
use shadow_fields::lists::gather::{
    self, Candidates, ClusterBounds, EntityBounds, GROUP_CLUSTERS, Occludes, SceneBounds,
};
use shadow_fields::lists::scope::Scope;
use shadow_fields::lists::skip::Skip;
use shadow_fields::sh::quadrature::random_direction;
use shadow_fields::sh::rotation::turns;

/// A receiver among many entities, with clusters of its own.
struct Crowded {
    scene_bounds: SceneBounds,
    /// Which of the entities is lit.
    receiver: u32,
    /// It, as shaders see it.
    entity: DeviceEntity,
    clusters: Vec<ClusterBounds>,
}

/// Entities near and far: every fifth does not occlude, every 25th shines, in harmonics, in colours or sharply.
fn random_entities(rng: &mut fastrand::Rng, count: usize, spread_m: f64, corner: DVec3) -> Vec<EntityBounds> {
    (0..count)
        .map(|i| EntityBounds {
            sharp: i % 100 == 25,
            centre: corner + DVec3::new(rng.f64() - 0.5, 0.1 * rng.f64(), rng.f64() - 0.5) * spread_m,
            radius_m: 0.1 + 0.4 * rng.f64(),
            reflectance: 0.3 + 0.7 * rng.f64(),
            occludes: if i % 5 != 0 { Occludes::All } else { Occludes::Nothing },
            emits: i % 25 == 0,
            coloured: i % 50 == 0,
            radiance: 3.0 * rng.f64(),
            facing: (i % 50 == 25).then(|| (random_direction(rng), 1.8)),
            sheet: None,
            lamp_maps: 0,
        })
        .collect()
}

impl Crowded {
    /// A crowd with and without a sky, lights and each skip, by the round; every third one far from the world's origin.
    fn new(rng: &mut fastrand::Rng, round: usize, count: usize) -> Crowded {
        let spread_m = if round.is_multiple_of(2) { 60.0 } else { 8.0 };
        let corner = if round % 3 == 2 { DVec3::new(4e3, -7e3, 1e4) } else { DVec3::ZERO };
        let bounds = random_entities(rng, count, spread_m, corner);
        let receiver = rng.u32(0..count as u32);
        let rotation = DQuat::from_axis_angle(random_direction(rng), 6.0 * rng.f64());
        let turns = turns(rotation).map(|x| x as f32);
        let own = bounds[receiver as usize];
        let entity = DeviceEntity {
            centre: own.centre.as_vec3().extend(1.0 / own.radius_m as f32).to_array(),
            alpha_beta: [turns[0], turns[1], turns[2], turns[3]],
            gamma: [turns[4], turns[5]],
            scale: 0.5 + rng.f32(),
            ..Default::default()
        };
        let without = ["cones", "behind", "horizon", "caps"].map(Skip::without);
        let skips: Vec<Skip> = [Skip::ALL, Skip::NONE].into_iter().chain(without).collect();
        let eps = if round % 6 == 5 { 0.0 } else { 10_f64.powf(-1.5 - 2.5 * rng.f64()) };
        let sky = (round % 4 != 3).then_some(1.2);
        let scene_bounds = SceneBounds::new(bounds, sky, skips[round % skips.len()], eps);
        let facing = random_direction(rng);
        let mut cluster = || {
            let centre = 2.0 * random_direction(rng) * rng.f64();
            let axis = (facing + 0.5 * random_direction(rng)).normalize();
            ClusterBounds::from_parts(centre, 0.3 * rng.f64(), axis, 0.4 * rng.f64())
        };
        let clusters = (0..GROUP_CLUSTERS).map(|_| cluster()).collect();
        Crowded { scene_bounds, receiver, entity, clusters }
    }
}

#[test]
fn the_tree_leaves_every_list_as_it_is() {
    let mut rng = fastrand::Rng::with_seed(21);
    let (mut listed, mut offered, mut all) = (0, 0, 0);
    for round in 0..60 {
        let crowded = Crowded::new(&mut rng, round, 200);
        let Crowded { scene_bounds, receiver, entity, clusters } = &crowded;
        let group = Candidates::of_group(scene_bounds, *receiver, entity, &ClusterBounds::union(clusters));
        offered += group.occluders.len();
        let occludes = |j: &u32| scene_bounds.entities[*j as usize].occludes != Occludes::Nothing;
        let occluders = (0..scene_bounds.entities.len() as u32).filter(occludes).collect();
        let everything = Candidates::new(scene_bounds, *receiver, occluders, |_| true);
        all += everything.occluders.len();
        for bounds in clusters {
            let scope = Scope::new(scene_bounds, *receiver as usize, entity, bounds, &[]);
            let [found, expected] = [&group, &everything].map(|candidates| {
                let mut entries = Vec::new();
                gather::gather(&scope, candidates, &mut entries);
                entries
            });
            assert_eq!(found, expected, "round {round}");
            listed += expected.len();
            // Clusters are merged again by this test.
            for j in (0..scene_bounds.entities.len()).filter(|&j| j != *receiver as usize) {
                let on = expected.iter().any(|&entry| ListEntry::entities(entry)[0] as usize == j);
                assert_eq!(scope.lists(j), on, "round {round}, entity {j}");
                assert!(!on || scope.may_list(j), "round {round}, entity {j}");
            }
        }
    }
    // A group is searched once for all chains, under the brightest light, so that each occluder counts once.
    assert!(listed > 10_000 && 10 * offered < 7 * all, "the tree is of use: {offered} of {all}");
}
