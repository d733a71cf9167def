//! What the camera cannot see is not drawn, and no picture shows it.

use crate::common::{gpu, shown};
use crate::stage::{jostled, scene, small};
use shadow_fields::draw::Antialias;
use shadow_fields::frame;
use shadow_fields::lists::skip::Skip;
use shadow_fields::scene::{Camera, Scene};

/// Solid, hollow and open things over a floor, one of them around the others.
fn room() -> Scene {
    scene(
        "environment = { gradient = { radiance = [0.4, 0.5, 0.6] } }\n\
         [[mesh]]\nname = \"floor\"\nplane = { size_m = 8, cells = 40 }\n\
         [[mesh]]\nname = \"ball\"\nsphere = { radius_m = 0.5, subdivisions = 4 }\n\
         [[mesh]]\nname = \"ring\"\ntorus = { major_m = 0.5, minor_m = 0.2, segments = 48, sides = 24 }\n\
         [[mesh]]\nname = \"box\"\ncuboid = { size_m = [0.8, 0.8, 0.8], cells = 12 }\n\
         [[mesh]]\nname = \"pot\"\nfile = \"assets/meshes/teapot.obj\"\n\
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
        let options = frame::Options { size: [96, 64], antialias, ..small() };
        let without = frame::Options { skip: Skip::without("hidden"), ..options };
        let mut frames = [gpu.frame(&scene, options), gpu.frame(&scene, without)];
        let mut placements = scene.at(0.0);
        let mut rng = fastrand::Rng::with_seed(5);
        for round in 0..8 {
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
                shown(frame, &placements, 1.0).into_iter().map(f32::to_bits).collect::<Vec<u32>>()
            });
            assert!(pictures[0] == pictures[1], "{antialias:?}, round {round}, {movers:?} moved");
        }
    }
}
