//! Sheets against rays: grounds, walls and ceilings that are rectangles, and what moves past them.

use crate::common::{Gpu, gpu};
use crate::stage::{against_rays, scene, small};
use shadow_fields::bake::{self, Quality};
use shadow_fields::check::merge::ROOM;
use shadow_fields::frame;
use shadow_fields::scene::{Lights, Scene};
use shadow_fields::truth::{RayCast, Vertex, World};

/// The fields that the command line bakes by default, in f32, of meshes as they are.
fn defaults(lights: Lights) -> frame::Options {
    let bake = bake::Options { storage: small().bake.storage, vertices: 0, ..Quality::Normal.options() };
    frame::Options { bake, lights, ..small() }
}

/// Relative RMS of an entity's light against rays.
fn error(gpu: &Gpu, frame: &mut frame::Frame, scene: &Scene, time_s: f64, entity: usize, every: usize) -> f64 {
    let placements = scene.at(time_s);
    let count = scene.meshes[scene.entities[entity].mesh].positions.len();
    let vertices: Vec<Vertex> = (0..count).step_by(every).map(|index| Vertex { entity, index }).collect();
    let cast = RayCast { rays: 1024, runs: 1, ..Default::default() };
    let rays = cast.run(&World::of(scene, &placements), &vertices);
    against_rays(&gpu.light(frame, &placements), &vertices, &rays)
}

/// Largest root mean square, over vertices, of a step that neither neighbour's slope explains.
fn pop(walk: &[Vec<[f32; 3]>]) -> f64 {
    let bend = |step: &[Vec<[f32; 3]>]| {
        let at = |v: usize| f64::from(step[2][v][0] - 2.0 * step[1][v][0] + step[0][v][0]).powi(2);
        ((0..step[0].len()).map(at).sum::<f64>() / step[0].len() as f64).sqrt()
    };
    walk.windows(3).map(bend).fold(0.0, f64::max)
}

const WHITE: &str = "albedo = [1, 1, 1]";

#[test]
fn an_object_on_a_ground_is_lit_as_by_rays() {
    let Some(gpu) = gpu() else { return };
    let text = format!(
        "environment = {{ uniform = [1, 1, 1] }}\n[[mesh]]\nname = \"floor\"\nplane = {{ size_m = 6, cells = 2 }}\n\
         [[mesh]]\nname = \"pot\"\nfile = \"assets/meshes/teapot.obj\"\n\
         [[entity]]\nmesh = \"floor\"\n[[entity]]\nmesh = \"pot\"\nscale = 0.5\n{WHITE}\n"
    );
    let scene = scene(&text);
    let mut frame = gpu.frame(&scene, defaults(Lights::Sharp));
    let found = error(&gpu, &mut frame, &scene, 0.0, 1, 3);
    assert!(found < 0.006, "{found}");
}

/// A ball rolls along a wall, then off the edge of its ground, in steps of 2 cm, under a sky that is brighter above.
#[test]
fn a_ball_along_a_wall_and_over_an_edge() {
    let Some(gpu) = gpu() else { return };
    let text = format!(
        "environment = {{ gradient = {{ radiance = [1, 1, 1] }} }}\n\
         [[mesh]]\nname = \"plane\"\nplane = {{ size_m = 4, cells = 2 }}\n\
         [[mesh]]\nname = \"ball\"\nsphere = {{ radius_m = 0.3, subdivisions = 3 }}\n\
         [[entity]]\nmesh = \"plane\"\n\
         [[entity]]\nmesh = \"plane\"\nposition = [0, 0.5, -0.32]\nscale = 0.5\nrotation = {{ axis = [1, 0, 0], angle_deg = 90 }}\n\
         [[entity]]\nmesh = \"ball\"\nposition = [0, 0.3, 0]\n{WHITE}\nmotion = [{{ bob = {{ amplitude_m = 2.5, period_s = 4, axis = [1, 0, 0] }} }}]\n"
    );
    let scene = scene(&text);
    let mut frame = gpu.frame(&scene, defaults(Lights::Sharp));
    let mut worst = 0.0_f64;
    let mut walk: Vec<Vec<[f32; 3]>> = Vec::new();
    for step in 0..=100 {
        let time_s = f64::from(step) / 100.0;
        walk.push(gpu.light(&mut frame, &scene.at(time_s)).swap_remove(2));
        if step % 10 == 0 {
            let found = error(&gpu, &mut frame, &scene, time_s, 2, 3);
            worst = worst.max(found);
        }
    }
    assert!(worst < 0.03, "{worst}");
    // Of single vertices near the ground's edge it is large in truth.
    assert!(pop(&walk) < 0.02, "{}", pop(&walk));
}

/// A ring between walls, by single fields and by their volume; and out of it, in steps of 1 cm.
#[test]
fn what_moves_in_a_room_sees_all_its_walls_at_once() {
    let Some(gpu) = gpu() else { return };
    let scene = scene(ROOM);
    let ring = scene.entities.len() - 1;
    let with = |groups: bool| {
        let options = defaults(Lights::Sharp);
        frame::Options { bake: bake::Options { groups, ..options.bake }, ..options }
    };
    let errors = |frame: &mut frame::Frame| [0.0, 0.4, 3.2].map(|t| error(&gpu, frame, &scene, t, ring, 3));
    let mut alone = gpu.frame(&scene, with(false));
    let mut frame = gpu.frame(&scene, with(true));
    let found = errors(&mut frame);
    let by_fields = errors(&mut alone);
    assert!(found.iter().all(|error| *error < 0.1), "{found:?}");
    assert!(found.iter().zip(&by_fields).all(|(a, b)| *a < 0.6 * b), "{found:?}, by single fields {by_fields:?}");
    let mut placements = scene.at(1.0);
    let mut walk: Vec<Vec<[f32; 3]>> = Vec::new();
    for _ in 0..60 {
        placements[ring].position.z += 0.01;
        walk.push(gpu.light(&mut frame, &placements).swap_remove(ring));
    }
    assert!(pop(&walk) < 0.01, "{}", pop(&walk));
}

/// Balls of light beyond a wall, one that the wall's rim cuts, one below a ground, and a lamp that lies on a ceiling.
#[test]
fn sheets_hide_sharp_lights() {
    let Some(gpu) = gpu() else { return };
    let lit = |rest: &str, lights: Lights| {
        let text = format!(
            "[[mesh]]\nname = \"plane\"\nplane = {{ size_m = 2, cells = 1 }}\n\
             [[mesh]]\nname = \"ball\"\nsphere = {{ radius_m = 0.3, subdivisions = 4 }}\n\
             [[mesh]]\nname = \"lamp\"\nrectangle = {{ size_m = [0.6, 0.9] }}\n\
             [[mesh]]\nname = \"field\"\nplane = {{ size_m = 3, cells = 20 }}\n\
             [[entity]]\nmesh = \"field\"\n{WHITE}\n{rest}"
        );
        let scene = scene(&text);
        let mut frame = gpu.frame(&scene, defaults(lights));
        let brightest = gpu.light(&mut frame, &scene.at(0.0))[0].iter().map(|v| v[0]).fold(0.0, f32::max);
        (error(&gpu, &mut frame, &scene, 0.0, 0, 2), brightest)
    };
    let glow = "receives = false\nemission = [9, 9, 9]";
    let wall = "[[entity]]\nmesh = \"plane\"\nposition = [0.13, 0.4, 0]\nscale = 0.4\nreceives = false\n\
                rotation = { axis = [0, 0, 1], angle_deg = 90 }\n";
    let ball = |place: &str| format!("[[entity]]\nmesh = \"ball\"\nposition = {place}\n{glow}\n");
    let low = lit(&format!("{wall}{}", ball("[1.3, 0.7, 0.1]")), Lights::Sharp);
    let rim = lit(&format!("{wall}{}", ball("[1.1, 1.4, 0.6]")), Lights::Sharp);
    let tilted =
        lit(&format!("{}{}", wall.replace("angle_deg = 90", "angle_deg = 50"), ball("[0.4, 1.9, 0.1]")), Lights::Sharp);
    let ceiling = "[[entity]]\nmesh = \"plane\"\nposition = [0, 1.5, 0]\nreceives = false\n";
    let lamp = |height: f64| {
        format!(
            "[[entity]]\nmesh = \"lamp\"\nposition = [0, {height}, 0]\nrotation = {{ axis = [1, 0, 0], angle_deg = 180 }}\n{glow}\n"
        )
    };
    let under = lit(&format!("{ceiling}{}", lamp(1.499)), Lights::Sharp);
    for (name, (error, _)) in
        [("a low light", low), ("a light at the rim", rim), ("a tilted sheet", tilted), ("a ceiling lamp", under)]
    {
        assert!(error < 0.03, "{name}: {error}");
    }
    for lights in [Lights::Sharp, Lights::Sh] {
        let (_, through) = lit(&format!("{ceiling}{}", lamp(1.7)), lights);
        let (_, open) = lit(&lamp(1.7), lights);
        // Four bands know a ceiling that is 67 degrees wide as a soft one.
        assert!(through < if lights == Lights::Sharp { 1e-6 } else { 0.2 } * open, "{through} of {open}");
        let (_, beneath) = lit(&ball("[0, -0.6, 0]"), lights);
        assert!(beneath < 1e-6 || lights == Lights::Sh, "{beneath} from below");
    }
}
