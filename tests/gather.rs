//! Lists of clusters: those made through a tree are those of a look at everything, and those of the device are those of the host
//! to the bit; what does not fit is made again with more room, and never merged by half.

mod common;
#[path = "common/stage.rs"]
mod stage;

use common::report;
use glam::{DQuat, DVec3};
use shadow_fields::frame::{Options, Target, record};
use shadow_fields::gpu::{Access, Buffer, BufferKind, Commands, FLIGHTS};
use shadow_fields::layout::{Cluster, ENTRY_ENTITIES, Entity, ListEntry};
use shadow_fields::lists::gather::{
    self, Bounds, Chains, EntityBounds, FOUND, GROUP_CLUSTERS, Gather, Group, Inputs, Packed, Place, Report,
    SceneBounds, Scope,
};
use shadow_fields::lists::skip::Skip;
use shadow_fields::sh::rotation::turns;
use stage::{Stage, scene, small, stage};
use std::fmt::Write;

fn random_direction(rng: &mut fastrand::Rng) -> DVec3 {
    loop {
        let p = DVec3::new(rng.f64() - 0.5, rng.f64() - 0.5, rng.f64() - 0.5);
        if (1e-3..0.25).contains(&p.length_squared()) {
            return p.normalize();
        }
    }
}

/// A receiver among many things, with clusters of its own.
struct Crowded {
    scene_bounds: SceneBounds,
    receiver: u32,
    entity: Entity,
    clusters: Vec<Bounds>,
}

/// Near and far, with and without a sky, lights and each skip; every other round at a corner of the world.
fn crowded(rng: &mut fastrand::Rng, round: usize, count: usize) -> Crowded {
    let spread_m = if round.is_multiple_of(2) { 60.0 } else { 8.0 };
    let corner = if round % 3 == 2 { DVec3::new(4e3, -7e3, 1e4) } else { DVec3::ZERO };
    let bounds: Vec<EntityBounds> = (0..count)
        .map(|i| EntityBounds {
            centre: corner + DVec3::new(rng.f64() - 0.5, 0.1 * rng.f64(), rng.f64() - 0.5) * spread_m,
            radius_m: 0.1 + 0.4 * rng.f64(),
            occludes: i % 5 != 0,
            emits: i % 25 == 0,
            coloured: i % 50 == 0,
            radiance: 3.0 * rng.f64(),
            facing: (i % 50 == 25).then(|| (random_direction(rng), 1.8)),
        })
        .collect();
    let receiver = rng.u32(0..count as u32);
    let rotation = DQuat::from_axis_angle(random_direction(rng), 6.0 * rng.f64());
    let turns = turns(rotation).map(|x| x as f32);
    let own = bounds[receiver as usize];
    let entity = Entity {
        centre: own.centre.as_vec3().extend(1.0 / own.radius_m as f32).to_array(),
        alpha_beta: [turns[0], turns[1], turns[2], turns[3]],
        gamma: [turns[4], turns[5]],
        emission: [0.0, 0.0, 0.0, 0.3 + 0.7 * rng.f32()],
        albedo: [0.0, 0.0, 0.0, 0.5 + rng.f32()],
        ..Default::default()
    };
    let skips = [Skip::ALL, Skip::NONE]
        .into_iter()
        .chain(["cones", "behind", "horizon", "caps"].map(Skip::without))
        .collect::<Vec<_>>();
    let eps = if round % 6 == 5 { 0.0 } else { 10_f64.powf(-1.5 - 2.5 * rng.f64()) };
    let scene_bounds = SceneBounds::new(bounds, (round % 4 != 3).then_some(1.2), skips[round % skips.len()], eps);
    let facing = random_direction(rng);
    let clusters = (0..GROUP_CLUSTERS)
        .map(|_| {
            let centre = 2.0 * random_direction(rng) * rng.f64();
            let axis = (facing + 0.5 * random_direction(rng)).normalize();
            Bounds::from_parts(centre, 0.3 * rng.f64(), axis, 0.4 * rng.f64())
        })
        .collect();
    Crowded { scene_bounds, receiver, entity, clusters }
}

impl Crowded {
    /// Lists by a look at everything.
    fn expected(&self) -> Vec<Vec<u32>> {
        let everything = Chains::all(&self.scene_bounds, self.receiver);
        let of = |bounds| {
            let mut entries = Vec::new();
            gather::reference(&self.scene_bounds, &self.entity, bounds, &everything, &mut entries);
            entries
        };
        self.clusters.iter().map(of).collect()
    }

    /// Lists by the device, each with its cluster, and its report.
    fn on_device(&self, stage: &Stage, texel: bool, capacity: u32) -> (Vec<(Cluster, Vec<u32>)>, Report) {
        let device = &stage.gpu.device;
        let count = self.clusters.len() as u32;
        let mut bounds = self.clusters.clone();
        bounds.push(Bounds::union(&self.clusters));
        let cluster = |i: u32| Cluster { receiver: self.receiver, vertex_count: 64, bounds: i, ..Default::default() };
        let mut entities = vec![Entity::default(); self.scene_bounds.spheres.len()];
        entities[self.receiver as usize] = self.entity;
        let packed = Packed::new(&self.scene_bounds);
        let bodies = Buffer::with_data(device, "bodies", &packed.quads).unwrap();
        let entities = Buffer::with_data(device, "entities", &entities).unwrap();
        let bounds = Buffer::with_data(device, "bounds", &bounds).unwrap();
        // Two groups, the second of one cluster that is bounded by itself.
        let groups = [
            Group { first: 0, count: count - 1, bounds: count, left: 0 },
            Group { first: count - 1, count: 1, bounds: count - 1, left: 0 },
        ];
        let groups = Buffer::with_data(device, "groups", &groups).unwrap();
        let clusters: Vec<Cluster> = (0..count).map(cluster).collect();
        let clusters = Buffer::with_data(device, "clusters", &clusters).unwrap();
        let entries = Buffer::new(device, "entries", BufferKind::Device, 4 * u64::from(count * capacity)).unwrap();
        let told = Buffer::with_data(device, "report", &[Report::default()]).unwrap();
        let pass = Gather::new(device, &stage.gpu.library, texel, self.scene_bounds.spheres.len()).unwrap();
        let inputs = Inputs {
            bodies: &bodies,
            entities: &entities,
            bounds: &bounds,
            groups: &groups,
            clusters: &clusters,
            entries: &entries,
            report: &told,
        };
        let mut commands = Commands::new(device, "gather").unwrap();
        commands.pass("gather", |c| pass.record(c, &inputs, &packed, capacity, 2)).unwrap();
        commands.barrier(Access::ComputeWrite, Access::TransferRead);
        commands.submit().unwrap();
        let clusters: Vec<Cluster> = clusters.download(count as usize).unwrap();
        let entries: Vec<u32> = entries.download((count * capacity) as usize).unwrap();
        let list = |cluster: &Cluster| entries[cluster.entry_first as usize..][..cluster.entry_count as usize].to_vec();
        (clusters.iter().map(|cluster| (*cluster, list(cluster))).collect(), told.download(1).unwrap()[0])
    }
}

fn is_cap(entry: u32) -> bool {
    let [entity, light] = ListEntry::entities(entry);
    let light = (light != ENTRY_ENTITIES).then_some(light);
    entry == ListEntry::Cap { entity, light }.pack()
}

#[test]
fn the_tree_leaves_every_list_as_it_is() {
    let mut rng = fastrand::Rng::with_seed(21);
    let (mut listed, mut offered, mut all) = (0, 0, 0);
    for round in 0..60 {
        let crowded = crowded(&mut rng, round, 200);
        let Crowded { scene_bounds, receiver, entity, clusters } = &crowded;
        let group = Chains::of_group(scene_bounds, *receiver, entity, &Bounds::union(clusters));
        offered += group.occluder_count();
        all += Chains::all(scene_bounds, *receiver).occluder_count();
        for (bounds, expected) in clusters.iter().zip(crowded.expected()) {
            let mut found = Vec::new();
            gather::reference(scene_bounds, entity, bounds, &group, &mut found);
            assert_eq!(found, expected, "round {round}");
            listed += expected.len();
            // An occluder may stand there by its field and as a cap.
            let whole = expected.iter().filter(|&&entry| !is_cap(entry));
            let count = whole.count() as u64;
            let counts = gather::counts(scene_bounds, *receiver, entity, bounds);
            let left = counts.below_horizon
                + counts.behind_light
                + counts.apart
                + counts.facing_away
                + counts.below_eps
                + counts.caps;
            assert_eq!(left + count, counts.considered, "every lookup is listed or has a reason");
            let scope = Scope::new(scene_bounds, entity, bounds);
            for (j, body) in scene_bounds.entities.iter().enumerate().filter(|(j, _)| *j != *receiver as usize) {
                let on = expected.iter().any(|&entry| ListEntry::entities(entry)[0] as usize == j);
                assert_eq!(scope.lists(j as u32, body, *receiver), on, "round {round}, entity {j}");
                assert!(!on || scope.may_list(body, scene_bounds.spheres[j]), "round {round}, entity {j}");
            }
        }
    }
    report(&format!("{listed} entries; the tree offers {offered} of {all} occluders to groups"));
    assert!(listed > 10_000 && 2 * offered < all, "the tree is of use: {offered} of {all}");
}

#[test]
fn the_device_makes_the_lists_of_its_twin() {
    let Some(stage) = stage() else { return };
    let mut rng = fastrand::Rng::with_seed(4);
    for round in 0..40 {
        // Few, several blocks, and a block that is not full.
        let crowded = crowded(&mut rng, round, [30, 200, 700][round % 3]);
        let expected = crowded.expected();
        let (lists, said) =
            crowded.on_device(&stage, round.is_multiple_of(2), Packed::new(&crowded.scene_bounds).longest() as u32);
        for (i, ((cluster, found), expected)) in lists.iter().zip(&expected).enumerate() {
            assert!(found == expected, "round {round}, cluster {i}: {} entries for {}", found.len(), expected.len());
            assert_eq!(cluster.vertex_count, 64);
        }
        let longest = expected.iter().map(Vec::len).max().unwrap();
        let entries: usize = expected.iter().map(Vec::len).sum();
        assert_eq!((said.longest as usize, said.entry_total as usize), (longest, entries), "round {round}");
    }
}

/// Too little room for a list: that is told, and the clusters lose their vertices.
#[test]
fn what_does_not_fit_is_told() {
    let Some(stage) = stage() else { return };
    let mut rng = fastrand::Rng::with_seed(9);
    let some = crowded(&mut rng, 0, 200);
    let expected = some.expected();
    let longest = expected.iter().map(Vec::len).max().unwrap();
    let room = longest as u32 / 2;
    let (lists, said) = some.on_device(&stage, true, room);
    assert_eq!((said.longest as usize, said.left_count), (longest, 0));
    for ((cluster, found), expected) in lists.iter().zip(&expected) {
        assert_eq!(cluster.vertex_count == 0, expected.len() > room as usize);
        assert_eq!(found[..], expected[..expected.len().min(room as usize)]);
    }
}

/// More occluders than a workgroup's memory holds, near both groups or near one: those are gathered in the second round, to the
/// same lists.
#[test]
fn what_a_group_has_no_room_for_is_gathered_again() {
    let Some(stage) = stage() else { return };
    let mut rng = fastrand::Rng::with_seed(9);
    let mut left = Vec::new();
    for round in 0..12 {
        let mut many = crowded(&mut rng, 5, 2000);
        // With no threshold all that occlude are found. One that takes fewer of them makes groups differ.
        let eps = if round == 0 { 0.0 } else { 1e-4 * 2.0_f64.powi(round) };
        let mut lamps = 0;
        for body in &mut many.scene_bounds.entities {
            lamps += usize::from(body.emits);
            body.emits &= lamps <= 9;
        }
        many.scene_bounds = SceneBounds::new(many.scene_bounds.entities, Some(1.2), Skip::ALL, eps);
        let expected = many.expected();
        let (lists, said) = many.on_device(&stage, round % 2 == 0, Packed::new(&many.scene_bounds).longest() as u32);
        for (i, ((cluster, found), expected)) in lists.iter().zip(&expected).enumerate() {
            assert!(found == expected, "round {round}, cluster {i}: {} entries for {}", found.len(), expected.len());
            assert_eq!(cluster.vertex_count, 64);
        }
        assert_eq!(said.left_count > 0, said.most_found as usize > FOUND, "{said:?}");
        assert_eq!(said.entry_total as usize, expected.iter().map(Vec::len).sum::<usize>());
        left.push(said.left_count);
    }
    report(&format!("groups left to the second round: {left:?}"));
    assert!([0, 1, 2].iter().all(|n| left.contains(n)), "{left:?}");
}

/// More occluders times lights than llvmpipe's loops can go through: told, and never merged by a part of a list.
#[test]
fn what_cannot_be_gone_through_is_told() {
    let Some(stage) = stage() else { return };
    let mut rng = fastrand::Rng::with_seed(9);
    let many = crowded(&mut rng, 5, 2000);
    let (lists, said) = many.on_device(&stage, true, 100);
    assert_eq!(said.longest, u32::MAX, "{said:?}");
    assert!(lists.iter().all(|(cluster, _)| cluster.vertex_count == 0));
}

/// A town of balls in which everything is lit.
fn town(edge: usize) -> shadow_fields::scene::Scene {
    let mut text = "environment = { uniform = [0.4, 0.5, 0.6] }\n\
        [[mesh]]\nname = \"floor\"\nplane = { size_m = 16, cells = 31 }\n\
        [[mesh]]\nname = \"ball\"\nsphere = { radius_m = 0.3, subdivisions = 1 }\n[[entity]]\nmesh = \"floor\"\n"
        .to_owned();
    for i in 0..edge * edge {
        let at = |k: usize| k as f32 * 1.2 - 0.6 * edge as f32;
        let light = if i % 13 == 6 { "emission = [4, 5, 6]\nscale = 0.3" } else { "" };
        let _ = writeln!(
            text,
            "[[entity]]\nmesh = \"ball\"\nposition = [{}, 0.5, {}]\n{light}",
            at(i % edge),
            at(i / edge)
        );
    }
    scene(&text)
}

/// Whole frames by both, moving and at rest: the same light to the bit, the same clusters merged, the same entries. Lists of more
/// than 64 entries need a second try, which nobody sees.
#[test]
fn frames_are_the_same_by_either() {
    let Some(stage) = stage() else { return };
    for (edge, eps) in [(4, 1e-3), (10, 0.0)] {
        let scene = town(edge);
        let options = Options { eps, ..small() };
        let mut by_host = stage.frame(&scene, Options { lists: Some(Place::Host), ..options });
        let mut by_device = stage.frame(&scene, Options { lists: Some(Place::Device), ..options });
        let mut placements = scene.at(0.0);
        for round in 0..4 {
            if round > 0 {
                placements[3 * round].position.x += 0.3;
            }
            let passes = by_device.render(&placements, None).unwrap();
            assert!(passes.iter().any(|pass| pass.pass == "gather"), "{passes:?}");
            let expected = stage.light(&mut by_host, &placements);
            let found: Vec<_> = (0..placements.len()).map(|entity| by_device.radiosity(entity).unwrap()).collect();
            assert!(found == expected, "eps {eps}, round {round}");
            assert!(by_device.merged().merged_entries > 0);
            assert_eq!(by_device.merged(), by_host.merged(), "eps {eps}, round {round}");
            assert!(by_device.render(&placements, None).unwrap().is_empty(), "at rest nothing is gathered");
        }
        report(&format!("{:?}", by_host.merged()));
    }
}

/// A town whose every ball is near one that is lit, more than a group has room for, with the light that lists of the host bring.
fn crowd(stage: &Stage, lights: usize) -> (shadow_fields::scene::Scene, Options, Vec<[f32; 3]>) {
    let mut scene = town(34);
    for (i, entity) in scene.entities.iter_mut().enumerate() {
        entity.receives = i == 100;
        // With more lights llvmpipe's loops could not go through them all.
        entity.emits &= i < lights * 13;
    }
    let options = Options { eps: 0.0, ..small() };
    let mut by_host = stage.frame(&scene, Options { lists: Some(Place::Host), ..options });
    by_host.render(&scene.at(0.0), None).unwrap();
    assert!(by_host.merged().merged_entries > FOUND * by_host.merged().clusters);
    let light = by_host.radiosity(100).unwrap();
    (scene, Options { lists: Some(Place::Device), ..options }, light)
}

#[test]
fn a_crowd_is_gathered_in_two_rounds() {
    let Some(stage) = stage() else { return };
    let (scene, options, expected) = crowd(&stage, 8);
    let mut frame = stage.frame(&scene, options);
    let passes = frame.render(&scene.at(0.0), None).unwrap();
    assert!(passes.iter().any(|pass| pass.pass == "gather"), "{passes:?}");
    assert!(frame.radiosity(100).unwrap() == expected);
}

/// With lights beyond what the pass can go through the host makes the lists, after one frame that merges nothing.
#[test]
fn a_crowd_with_many_lights_goes_to_the_host() {
    let Some(stage) = stage() else { return };
    let (scene, options, expected) = crowd(&stage, 80);
    let mut frame = stage.frame(&scene, options);
    frame.render(&scene.at(0.0), None).unwrap();
    assert!(frame.radiosity(100).unwrap() == expected);
}

/// As in a window: frames are launched, two under way at once, and what a frame had no room for is known two frames later. Until
/// then the light stays as it was.
#[test]
fn a_crowd_is_gathered_in_a_window() {
    let Some(stage) = stage() else { return };
    let (scene, options, expected) = crowd(&stage, 8);
    let device = &stage.gpu.device;
    let mut frame = stage.frame(&scene, options);
    let placements = scene.at(0.0);
    let mut flights = std::collections::VecDeque::new();
    let mut lit = Vec::new();
    for _ in 0..5 {
        if flights.len() == FLIGHTS {
            let flight: shadow_fields::gpu::Flight = flights.pop_front().unwrap();
            flight.wait().unwrap();
        }
        frame.prepare_light(&placements, &[]).unwrap();
        let mut commands = Commands::new(device, "frame").unwrap();
        commands.after_flights();
        record(&mut commands, frame.merge_work().unwrap().as_ref(), None, Target::Device).unwrap();
        flights.push_back(commands.launch().unwrap());
        device.settle();
        let light = frame.radiosity(100).unwrap();
        lit.push(if light == expected {
            "lit"
        } else {
            assert!(light.iter().flatten().all(|c| *c == 0.0), "merged by half a list");
            "dark"
        });
    }
    // Lists of 64 entries at first: that they were too short is seen before the third frame.
    assert_eq!(lit, ["dark", "dark", "lit", "lit", "lit"]);
    assert_eq!(frame.merged().merged_clusters, 0, "at rest nothing is merged");
}

/// Every sum and product of the pass is rounded by itself: a compiler that contracted some would come to other lists.
#[test]
fn nothing_is_contracted() {
    use rspirv::spirv::{Decoration, Op};
    for (texel, roomy) in [(false, false), (true, false), (false, true), (true, true)] {
        let shader = common::library().shader(&Gather::row(texel, roomy)).unwrap();
        let module = rspirv::dr::load_words(&shader.spirv).unwrap();
        let exact: std::collections::HashSet<u32> = module
            .annotations
            .iter()
            .filter(|i| i.operands.contains(&rspirv::dr::Operand::Decoration(Decoration::NoContraction)))
            .map(|i| i.operands[0].unwrap_id_ref())
            .collect();
        let arithmetic =
            [Op::FAdd, Op::FSub, Op::FMul, Op::VectorTimesScalar, Op::Dot, Op::FDiv, Op::FMod, Op::MatrixTimesVector];
        let found: Vec<_> = module.all_inst_iter().filter(|i| arithmetic.contains(&i.class.opcode)).collect();
        assert!(found.len() > 100, "{} operations", found.len());
        let loose: Vec<_> = found.iter().filter(|i| !exact.contains(&i.result_id.unwrap())).collect();
        assert!(loose.is_empty(), "{} of {}: {loose:?}", loose.len(), found.len());
        assert!(!found.iter().any(|i| matches!(i.class.opcode, Op::FDiv | Op::Dot)), "by sums and products alone");
    }
}
