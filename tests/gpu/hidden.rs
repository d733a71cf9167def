//! What the camera cannot see is not lit while things move, and not drawn: no picture shows it, and it is lit once it
//! may be seen or once nothing moves.

use crate::common::{Gpu, gpu};
use crate::stage::{jostled, scene, small};
use glam::Vec3;
use shadow_fields::draw::Antialias;
use shadow_fields::frame::{self, Frame};
use shadow_fields::lists::skip::Skip;
use shadow_fields::scene::{Camera, Placement, Scene};

/// Solid, hollow and open things over a floor, one of them around the others.
fn room() -> Scene {
    scene(
        "environment = { gradient = { radiance = [0.4, 0.5, 0.6] } }\n\
         [[mesh]]\nname = \"floor\"\nplane = { size_m = 8, cells = 40 }\n\
         [[mesh]]\nname = \"ball\"\nsphere = { radius_m = 0.5, subdivisions = 4 }\n\
         [[mesh]]\nname = \"ring\"\ntorus = { major_m = 0.5, minor_m = 0.2, segments = 48, sides = 24 }\n\
         [[mesh]]\nname = \"box\"\ncuboid = { size_m = [0.8, 0.8, 0.8], cells = 12 }\n\
         [[mesh]]\nname = \"pot\"\nteapot = { subdivisions = 5 }\n\
         [[entity]]\nmesh = \"floor\"\n\
         [[entity]]\nmesh = \"ball\"\nposition = [-1.2, 0.6, 0]\n\
         [[entity]]\nmesh = \"ring\"\nposition = [0.2, 0.7, -0.8]\n\
         [[entity]]\nmesh = \"box\"\nposition = [1.4, 0.5, 0.4]\n\
         [[entity]]\nmesh = \"pot\"\nposition = [0, 0.1, 1.2]\nscale = 0.2\n\
         [[entity]]\nmesh = \"ball\"\nposition = [0.5, 2, 1]\nscale = 0.4\nemission = [20, 16, 9]\n",
    )
}

fn camera(eye: [f32; 3], target: [f32; 3], fov_deg: f32) -> Camera {
    Camera { eye: eye.into(), target: target.into(), fov_deg }
}

/// Bits of a picture: as files have it, or as a window shows it.
fn picture(frame: &mut Frame, placements: &[Placement]) -> Vec<u32> {
    frame.render(placements, Some(1.0)).unwrap();
    frame.picture().into_iter().map(f32::to_bits).collect()
}

fn pair(gpu: &Gpu, scene: &Scene, options: frame::Options) -> [Frame; 2] {
    let without = frame::Options { skip: Skip::without("hidden"), ..options };
    [gpu.frame(scene, options), gpu.frame(scene, without)]
}

/// Cameras in turn: one that wanders, one that jumps, one among the things, one inside a ball, one that looks away.
fn eye(round: usize) -> Camera {
    let angle = round as f32 * 0.4;
    match round % 6 {
        0 | 1 => camera([4.0 * angle.sin(), 1.5, 4.0 * angle.cos()], [0.0, 0.5, 0.0], 40.0),
        2 => camera([-3.0 * angle.sin(), 3.5, -3.0 * angle.cos()], [0.3, 0.0, 0.3], 25.0),
        3 => camera([0.1, 0.4, 0.1], [angle.sin(), 0.5, angle.cos()], 90.0),
        4 => camera([-1.2, 0.6, 0.1], [0.0, 0.5, 0.4], 70.0),
        _ => camera([2.2, 1.0, 2.0], [4.0, 1.0, 4.0], 50.0),
    }
}

#[test]
fn pictures_are_the_same_to_the_bit() {
    let Some(gpu) = gpu() else { return };
    let scene = room();
    for antialias in [Antialias::None, Antialias::Outlines, Antialias::Samples] {
        let options = frame::Options { size: [192, 128], antialias, ..small() };
        let mut frames = pair(&gpu, &scene, options);
        let mut placements = scene.at(0.0);
        let mut rng = fastrand::Rng::with_seed(5);
        let mut merged = [0; 2];
        for round in 0..24 {
            // At times all things move, mostly one or two, and now and then none.
            let movers: Vec<usize> = match round % 8 {
                0 => (1..placements.len()).collect(),
                5 => vec![],
                _ => vec![rng.usize(1..placements.len()), rng.usize(0..placements.len())],
            };
            for &j in &movers {
                placements[j] = jostled(&placements[j], &mut rng, 0.15);
            }
            let pictures = frames.each_mut().map(|frame| {
                frame.set_camera(&eye(round));
                picture(frame, &placements)
            });
            assert!(pictures[0] == pictures[1], "{antialias:?}, round {round}, {movers:?} moved");
            let now = [&frames[0], &frames[1]].map(|frame| frame.merged());
            if round == 0 || movers.is_empty() {
                assert_eq!(frames[0].stale_count(), 0, "at first and at rest everything is lit");
                continue;
            }
            assert_eq!(now[1].stale_clusters, 0);
            (0..2).for_each(|i| merged[i] += now[i].merged_clusters);
        }
        assert!(4 * merged[0] < 3 * merged[1], "{merged:?}");
    }
}

/// Light that was left as it was would be seen: the picture from elsewhere, drawn without lighting what has come into
/// view, is another than the one with it.
#[test]
fn what_comes_into_view_is_lit_then() {
    let Some(gpu) = gpu() else { return };
    let scene = room();
    let mut frames = pair(&gpu, &scene, frame::Options { size: [160, 120], ..small() });
    let [before, behind] =
        [camera([0.0, 1.0, 5.0], [0.0, 0.5, 0.0], 30.0), camera([0.0, 1.0, -5.0], [0.0, 0.5, 0.0], 30.0)];
    let mut placements = scene.at(0.0);
    for frame in &mut frames {
        frame.set_camera(&before);
        picture(frame, &placements);
    }
    // The light goes round to the back, whose light no picture shows as yet.
    placements[5].position = Vec3::new(0.0, 1.5, -2.0);
    for frame in &mut frames {
        picture(frame, &placements);
    }
    let stale = frames[0].stale_count();
    assert!(stale > 0 && frames[1].stale_count() == 0);
    let looks = |frame: &mut Frame, placements: &[Placement]| {
        frame.set_camera(&behind);
        frame.redraw(placements, 1.0).unwrap();
        frame.picture().into_iter().map(f32::to_bits).collect::<Vec<_>>()
    };
    let unlit = looks(&mut frames[0], &placements);
    assert!(unlit != looks(&mut frames[1], &placements), "what was left as it was is seen from behind");
    // Something moves on, so that this is no rest.
    placements[1].position.x += 0.01;
    let [found, wanted] = frames.each_mut().map(|frame| picture(frame, &placements));
    assert!(found == wanted);
    // At rest what is hidden is lit once, and after that a camera that moves lights nothing.
    let passes = |frame: &mut Frame| {
        let passes = frame.render(&placements, Some(1.0)).unwrap();
        passes.iter().any(|timing| timing.pass == "merge")
    };
    assert!(frames[0].stale_count() > 0);
    assert!(passes(&mut frames[0]) && frames[0].stale_count() == 0);
    for round in 0..6 {
        frames[0].set_camera(&eye(round));
        assert!(!passes(&mut frames[0]) && frames[0].merged().merged_clusters == 0, "camera {round}");
    }
}

/// A cluster that is merged for the state that holds is not merged again, whatever the camera does.
#[test]
fn nothing_is_lit_twice() {
    let Some(gpu) = gpu() else { return };
    let scene = room();
    let mut frame = gpu.frame(&scene, frame::Options { size: [64, 48], ..small() });
    let mut placements = scene.at(0.0);
    picture(&mut frame, &placements);
    let clusters = frame.merged().clusters;
    frame.set_camera(&eye(2));
    // Everything is lit anew by the light; then a ball far from all moves by nothing that matters to others.
    placements[5].position.x += 0.2;
    picture(&mut frame, &placements);
    let [first, left] = [frame.merged().merged_clusters, frame.stale_count()];
    assert!(first > 0 && left > 0 && first + left <= clusters, "{first} and {left} of {clusters}");
    picture(&mut frame, &placements);
    assert_eq!([frame.merged().merged_clusters, frame.stale_count()], [left, 0], "at rest the others, and they alone");
    // Whoever reads radiosity gets all of it, as it would be without the skip.
    placements[5].position.x += 0.2;
    picture(&mut frame, &placements);
    assert!(frame.stale_count() > 0);
    let mut full = gpu.frame(&scene, frame::Options { size: [64, 48], skip: Skip::without("hidden"), ..small() });
    assert_eq!(gpu.light(&mut frame, &placements), gpu.light(&mut full, &placements));
    assert_eq!(frame.stale_count(), 0);
}
