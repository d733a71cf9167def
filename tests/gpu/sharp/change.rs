//! What a frame with sharp lights shows once an entity, a light or the way to smooth edges is switched.

use super::{HEAD, parse, scenes};
use crate::common::{gpu, shown};
use shadow_fields::check::sharp as check;
use shadow_fields::draw::{Antialias, Shading};
use shadow_fields::frame::{self, Frame};
use shadow_fields::scene::{Lights, Scene};

/// A switch that moves nothing still changes what pixels show, and back.
#[test]
fn pixels_follow_switches_of_entities() {
    let Some(gpu) = gpu() else { return };
    let (_, scene, _) = scenes().swap_remove(0);
    let options = frame::Options {
        shading: Some(Shading::Pixel),
        size: [96, 72],
        antialias: Antialias::None,
        ..check::sharp_options()
    };
    let new = |scene: &Scene| gpu.frame(scene, options);
    let show = |frame: &mut Frame| shown(frame, &scene.at(0.0), 4.0);
    let mut bare = scene.clone();
    bare.entities[1].occludes = false;
    let mut frame = new(&scene);
    let with = show(&mut frame);
    assert!(frame.covers(&bare));
    frame.set_scene(&bare).unwrap();
    let without = show(&mut frame);
    frame.set_scene(&scene).unwrap();
    let again = show(&mut frame);
    assert!(with != without && with == again);
    assert!(without == show(&mut new(&bare)), "a frame that was made for the other scene shows something else");
}

/// Vertices near a shadow's edge are marked while pixels read that, also after a switch to four samples a pixel.
#[test]
fn edges_are_marked_where_pixels_read_them() {
    let Some(gpu) = gpu() else { return };
    let (_, scene, _) = scenes().swap_remove(0);
    let new = |antialias| {
        let options = frame::Options { shading: None, size: [96, 72], antialias, ..check::sharp_options() };
        gpu.frame(&scene, options)
    };
    let show = |frame: &mut Frame| {
        frame.render(&scene.at(0.0), Some(4.0)).unwrap();
        let light = frame.light_buffer().0;
        let quads: Vec<[f32; 4]> = light.download(light.size_bytes as usize / 16).unwrap();
        (frame.picture(), quads.iter().filter(|quad| quad[3] > 0.0).count())
    };
    let (by_pixel, marks) = show(&mut new(Antialias::Samples));
    let mut frame = new(Antialias::Outlines);
    let (by_vertex, none) = show(&mut frame);
    assert!(marks > 100 && none == 0, "{marks} vertices are marked for pixels, {none} where vertices evaluate");
    assert!(frame.still(&scene.at(0.0), 4.0).unwrap() == by_pixel, "a still picture");
    for (antialias, picture) in [(Antialias::Samples, &by_pixel), (Antialias::Outlines, &by_vertex)] {
        frame.set_antialias(antialias).unwrap();
        assert!(show(&mut frame).0 == *picture, "{antialias:?}");
    }
}

/// A merge that was compiled for a scene without lights learns of one that is switched on.
#[test]
fn a_light_that_is_switched_on_meets_the_chains() {
    let Some(gpu) = gpu() else { return };
    // The sky needs every field and transfer, so that nothing is missing when the ball begins to shine.
    let scene = parse(&format!(
        "{HEAD}[[entity]]\nmesh = \"ball\"\nposition = [0, 0.6, 0]\n[[entity]]\nmesh = \"ball\"\nposition = [1.2, 2.6, 0.8]\n\
         scale = 0.3\nemission = [90, 90, 90]\noccludes = true\n[environment]\nuniform = [0.2, 0.2, 0.2]\n"
    ));
    let mut dark = scene.clone();
    dark.entities[2].emits = false;
    let options = frame::Options { lights: Lights::Sh, ..check::sharp_options() };
    let new = |scene: &Scene| gpu.frame(scene, options);
    let light = |frame: &mut Frame| gpu.light(frame, &scene.at(0.0)).swap_remove(0);
    let mut frame = new(&dark);
    let without = light(&mut frame);
    assert!(!frame.permutation().lights && frame.covers(&scene));
    frame.set_scene(&scene).unwrap();
    let with = light(&mut frame);
    assert!(with != without && with == light(&mut new(&scene)));
    frame.set_scene(&dark).unwrap();
    assert!(without == light(&mut frame), "lights that do not shine change nothing");
}

/// A frame without sharp lights lacks their pass, and one compiled for balls of light would take a disc for one.
#[test]
fn a_frame_covers_no_scene_whose_sharp_lights_have_no_pass() {
    let Some(gpu) = gpu() else { return };
    let (_, ball, _) = scenes().swap_remove(0);
    let disc = parse(&format!(
        "{HEAD}[[mesh]]\nname = \"lamp\"\ndisc = {{ radius_m = 0.3 }}\n\
        [[entity]]\nmesh = \"ball\"\nposition = [1.2, 2.6, 0.8]\nscale = 0.1\nemission = [900, 900, 900]\n\
        [[entity]]\nmesh = \"lamp\"\nposition = [0, 2, 0]\nemission = [9, 9, 9]\n"
    ));
    for scene in [ball, disc] {
        let mut dark = scene.clone();
        dark.entities.last_mut().unwrap().emits = false;
        let frame = gpu.frame(&dark, check::sharp_options());
        assert!(frame.covers(&dark) && !frame.covers(&scene));
    }
}
