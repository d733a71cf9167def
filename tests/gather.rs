//! Cluster lists: those made through a tree are those of a look at everything, and those of the device hold what the rule without
//! slack lists and nothing beyond the rule with twice the slack. What does not fit is made again with more room, and never
//! merged by half.

mod common;
#[path = "common/stage.rs"]
mod stage;

use common::report;
use shadow_fields::check::gather::Crowded;
use shadow_fields::frame::{self, PictureTarget, record};
use shadow_fields::gpu::{Commands, FLIGHTS};
use shadow_fields::layout::{Cluster, ENTRY_ENTITIES, ListEntry};
use shadow_fields::lists::gather::{
    self, Candidates, ClusterBounds, FOUND, Gather, Packed, Place, Report, SLACK, SceneBounds, Scope,
};
use shadow_fields::lists::skip::Skip;
use stage::{Stage, scene, small, stage};
use std::fmt::Write;

/// Lists by the device and its report.
fn lists(crowded: &Crowded, stage: &Stage, texel: bool, capacity: u32) -> (Vec<(Cluster, Vec<u32>)>, Report) {
    crowded.on_device(&stage.gpu.device, &stage.gpu.library, texel, capacity).unwrap()
}

/// Holds lists of the device against the rule, and returns how many entries they have, and how many of these for the slack alone.
fn held(crowded: &Crowded, lists: &[(Cluster, Vec<u32>)], what: &str) -> [usize; 2] {
    let agreement = crowded.hold(lists);
    assert_eq!(agreement.wrong_lists, 0, "{what}: {agreement:?}");
    assert!(lists.iter().all(|(cluster, _)| cluster.vertex_count == 64), "{what}");
    [agreement.entries, agreement.extra_entries]
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
        let crowded = Crowded::new(&mut rng, round, 200);
        let Crowded { scene_bounds, receiver, entity, clusters } = &crowded;
        let group = Candidates::of_group(scene_bounds, *receiver, entity, &ClusterBounds::union(clusters));
        offered += group.occluder_count();
        all += Candidates::all(scene_bounds, *receiver).occluder_count();
        let lists = crowded.expected(SLACK);
        for ((bounds, expected), most) in clusters.iter().zip(&lists).zip(crowded.expected(2.0 * SLACK)) {
            let scope = Scope::new(scene_bounds, entity, bounds, SLACK);
            let mut found = Vec::new();
            gather::twin(&scope, &group, &mut found);
            assert_eq!(found, *expected, "round {round}");
            listed += expected.len();
            // An occluder may stand there by its field and as a cap.
            let count = expected.iter().filter(|&&entry| !is_cap(entry)).count() as u64;
            let counts = gather::counts(&scope, *receiver);
            let left = counts.below_horizon
                + counts.behind_light
                + counts.apart
                + counts.facing_away
                + counts.below_eps
                + counts.caps;
            assert_eq!(left + count, counts.considered, "every lookup is listed or has a reason");
            // The test for what was touched takes twice the slack.
            let scope = Scope::new(scene_bounds, entity, bounds, 2.0 * SLACK);
            for j in (0..scene_bounds.entities.len()).filter(|&j| j != *receiver as usize) {
                let on = most.iter().any(|&entry| ListEntry::entities(entry)[0] as usize == j);
                assert_eq!(scope.lists(j, *receiver), on, "round {round}, entity {j}");
                assert!(!on || scope.may_list(j), "round {round}, entity {j}");
            }
        }
    }
    report(&format!("{listed} entries; the tree offers {offered} of {all} occluders to groups"));
    // A group is searched once for all chains, under the brightest light, so that each occluder counts once.
    assert!(listed > 10_000 && 10 * offered < 7 * all, "the tree is of use: {offered} of {all}");
}

#[test]
fn the_device_lists_what_matters_within_the_slack() {
    let Some(stage) = stage() else { return };
    let mut rng = fastrand::Rng::with_seed(4);
    let mut totals = [0; 2];
    for round in 0..40 {
        // Few, several blocks, and a block that is not full.
        let crowded = Crowded::new(&mut rng, round, [30, 200, 700][round % 3]);
        let room = Packed::new(&crowded.scene_bounds).longest() as u32;
        let (lists, said) = lists(&crowded, &stage, round.is_multiple_of(2), room);
        let counts = held(&crowded, &lists, &format!("round {round}"));
        totals = [0, 1].map(|i| totals[i] + counts[i]);
        let longest = lists.iter().map(|(_, list)| list.len()).max().unwrap();
        assert_eq!((said.longest as usize, said.entry_total as usize), (longest, counts[0]), "round {round}");
    }
    report(&format!("{} entries, {} of them for the slack alone", totals[0], totals[1]));
    assert!(totals[0] > 10_000 && 100 * totals[1] < 3 * totals[0], "the slack costs next to nothing: {totals:?}");
}

/// Too little room for a list: that is told, and the clusters lose their vertices.
#[test]
fn what_does_not_fit_is_told() {
    let Some(stage) = stage() else { return };
    let mut rng = fastrand::Rng::with_seed(9);
    let some = Crowded::new(&mut rng, 0, 200);
    let (whole, _) = lists(&some, &stage, true, Packed::new(&some.scene_bounds).longest() as u32);
    let longest = whole.iter().map(|(_, list)| list.len()).max().unwrap();
    let room = longest as u32 / 2;
    let (lists, said) = lists(&some, &stage, true, room);
    assert_eq!((said.longest as usize, said.left_count), (longest, 0));
    for ((cluster, found), (_, expected)) in lists.iter().zip(&whole) {
        assert_eq!(cluster.vertex_count == 0, expected.len() > room as usize);
        assert_eq!(found[..], expected[..expected.len().min(room as usize)]);
    }
}

/// More occluders than a workgroup's memory holds, near both groups or near one: those are gathered in the second round, by the
/// same rule.
#[test]
fn what_a_group_has_no_room_for_is_gathered_again() {
    let Some(stage) = stage() else { return };
    let mut rng = fastrand::Rng::with_seed(9);
    let mut left = Vec::new();
    for round in 0..12 {
        let mut many = Crowded::new(&mut rng, 5, 2000);
        // With no threshold all that occlude are found. One that takes fewer of them makes groups differ.
        let eps = if round == 0 { 0.0 } else { 1e-4 * 2.0_f64.powi(round) };
        let mut lights = 0;
        for entity in &mut many.scene_bounds.entities {
            lights += usize::from(entity.emits);
            entity.emits &= lights <= 9;
        }
        many.scene_bounds = SceneBounds::new(many.scene_bounds.entities, Some(1.2), Skip::ALL, eps);
        let room = Packed::new(&many.scene_bounds).longest() as u32;
        let (lists, said) = lists(&many, &stage, round % 2 == 0, room);
        let [entries, _] = held(&many, &lists, &format!("round {round}"));
        assert_eq!(said.left_count > 0, said.most_found as usize > FOUND, "{said:?}");
        assert_eq!(said.entry_total as usize, entries);
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
    let many = Crowded::new(&mut rng, 5, 2000);
    let (lists, said) = lists(&many, &stage, true, 100);
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

/// Whole frames by both, moving and at rest, merge the same clusters. Without a threshold the light is the same to the bit: what only one of
/// them lists has no weight. With a threshold it may differ by what the other leaves off, which eps bounds. Lists of
/// more than 64 entries need a second try, which nobody sees.
#[test]
fn frames_are_the_same_by_either() {
    let Some(stage) = stage() else { return };
    for (edge, eps) in [(4, 1e-3), (10, 0.0)] {
        let scene = town(edge);
        let options = frame::Options { eps, ..small() };
        let mut by_host = stage.frame(&scene, frame::Options { lists: Some(Place::Host), ..options });
        let mut by_device = stage.frame(&scene, frame::Options { lists: Some(Place::Device), ..options });
        let mut placements = scene.at(0.0);
        for round in 0..4 {
            if round > 0 {
                placements[3 * round].position.x += 0.3;
            }
            let passes = by_device.render(&placements, None).unwrap();
            assert!(passes.iter().any(|pass| pass.pass == "gather"), "{passes:?}");
            let expected = stage.light(&mut by_host, &placements);
            for (entity, expected) in expected.iter().enumerate() {
                let (apart, _) = stage::difference(&by_device.radiosity(entity).unwrap(), expected);
                assert!(apart <= eps, "eps {eps}, round {round}, entity {entity}: {apart}");
            }
            let [device, host] = [&by_device, &by_host].map(|frame| frame.merged());
            assert_eq!((device.clusters, device.merged_clusters), (host.clusters, host.merged_clusters));
            let entries = [device, host].map(|merged| merged.merged_entries);
            assert!(entries[0] > 0 && 1000 * entries[0].abs_diff(entries[1]) <= entries[0], "{entries:?}");
            assert!(by_device.render(&placements, None).unwrap().is_empty(), "at rest nothing is gathered");
        }
        report(&format!("{:?}", by_host.merged()));
    }
}

/// A town whose every ball is near one that is lit, more than a group has room for, with the light that lists of the host bring.
fn crowd(stage: &Stage, lights: usize) -> (shadow_fields::scene::Scene, frame::Options, Vec<[f32; 3]>) {
    let mut scene = town(34);
    for (i, entity) in scene.entities.iter_mut().enumerate() {
        entity.receives = i == 100;
        // With more lights llvmpipe's loops could not go through them all.
        entity.emits &= i < lights * 13;
    }
    let options = frame::Options { eps: 0.0, ..small() };
    let mut by_host = stage.frame(&scene, frame::Options { lists: Some(Place::Host), ..options });
    by_host.render(&scene.at(0.0), None).unwrap();
    assert!(by_host.merged().merged_entries > FOUND * by_host.merged().clusters);
    let light = by_host.radiosity(100).unwrap();
    (scene, frame::Options { lists: Some(Place::Device), ..options }, light)
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
        record(&mut commands, frame.merge_work().unwrap().as_ref(), None, PictureTarget::Device).unwrap();
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

/// The key of the order has the same bits on every device only if no product and sum of it are contracted into one operation.
#[test]
fn the_key_of_the_order_is_not_contracted() {
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
        let is_exact = |i: &&rspirv::dr::Instruction| i.result_id.is_some_and(|id| exact.contains(&id));
        let count = |op| module.all_inst_iter().filter(is_exact).filter(|i| i.class.opcode == op).count();
        assert_eq!([Op::FSub, Op::FMul, Op::FAdd].map(count), [1, 3, 2], "one difference, three squares, two sums");
    }
}
