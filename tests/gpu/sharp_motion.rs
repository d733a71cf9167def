//! Sharp lights that grow and move: light changes as the exact light of balls does, without steps and flicker.

use crate::common;
use common::{gpu, parse};
use glam::{DVec2, DVec3};
use rayon::prelude::*;
use shadow_fields::check::sharp as check;
use shadow_fields::draw::{Antialias, Shading};
use shadow_fields::frame::{self, Frame};
use shadow_fields::scene::{Placement, Scene};
use shadow_fields::truth::pixels::lit_points;
use shadow_fields::truth::{RayMeshes, World};
use std::f64::consts::PI;

/// Size of pictures in pixels: 100 rows show the floor.
const PICTURE: [u32; 2] = [100, 180];
const BALL_RADIUS_M: f64 = 0.5;

/// A floor of that many cells along a side, a ball above it and a ball that shines.
fn scene(cells: usize) -> Scene {
    parse(&format!(
        "[camera]\neye = [0, 2, 5]\ntarget = [0, 0.5, 0]\n\
        [[mesh]]\nname = \"floor\"\nplane = {{ size_m = 6, cells = {cells} }}\n\
        [[mesh]]\nname = \"ball\"\nsphere = {{ radius_m = {BALL_RADIUS_M}, subdivisions = 5 }}\n\
        [[entity]]\nmesh = \"floor\"\nalbedo = [1, 1, 1]\n\
        [[entity]]\nmesh = \"ball\"\nposition = [0, 0.8, 0]\n\
        [[entity]]\nmesh = \"ball\"\nposition = [0, 3.5, 0]\nemission = [1, 1, 1]\n"
    ))
}

fn frame(gpu: &common::Gpu, scene: &Scene) -> Frame {
    let base = check::sharp_options();
    let bake = shadow_fields::bake::Options { silhouette: Default::default(), ..base.bake };
    let options =
        frame::Options { bake, shading: Some(Shading::Pixel), size: PICTURE, antialias: Antialias::None, ..base };
    gpu.frame(scene, options)
}

fn ball(placement: &Placement) -> (DVec3, f64) {
    (placement.position.as_dvec3(), BALL_RADIUS_M * f64::from(placement.scale))
}

/// Places that have a disc of radius 1 evenly.
fn disc(count: usize) -> Vec<DVec2> {
    let turn = |k: usize| DVec2::from_angle(k as f64 * PI * (3.0 - 5.0_f64.sqrt()));
    (0..count).map(|k| turn(k) * ((k as f64 + 0.5) / count as f64).sqrt()).collect()
}

/// Radiosity of a white floor at `point` under a shining ball past another, by directions to its disc.
fn exact(point: DVec3, occluder: (DVec3, f64), light: (DVec3, f64), disc: &[DVec2]) -> f64 {
    let to = light.0 - point;
    let sine = light.1 / to.length();
    let toward = to.normalize();
    let (across, down) = toward.any_orthonormal_pair();
    let blocks = |direction: DVec3| {
        let centre = occluder.0 - point;
        let along = centre.dot(direction);
        along > 0.0 && centre.length_squared() - along * along < occluder.1 * occluder.1
    };
    let share = |place: &DVec2| {
        let tilt = (1.0 - sine * sine * place.length_squared()).sqrt();
        let direction = tilt * toward + sine * (place.x * across + place.y * down);
        if blocks(direction) { 0.0 } else { direction.y.max(0.0) / tilt }
    };
    sine * sine * disc.iter().map(share).sum::<f64>() / disc.len() as f64
}

/// Radiosity of every 97th vertex of the floor, found and exact, at placements.
fn lit(frame: &mut Frame, scene: &Scene, placements: &[Placement]) -> [Vec<f64>; 2] {
    frame.render(placements, None).unwrap();
    let found = frame.radiosity(0).unwrap();
    let numbers: Vec<usize> = (0..found.len()).step_by(97).collect();
    let positions = &scene.meshes[0].positions;
    let disc = disc(4000);
    let truth = |&v: &usize| exact(positions[v].as_dvec3(), ball(&placements[1]), ball(&placements[2]), &disc);
    [numbers.iter().map(|&v| f64::from(found[v][0])).collect(), numbers.par_iter().map(truth).collect()]
}

/// A light that grows from 0.1 to 60 degrees across: vertices follow the exact share, and change by no more a step.
#[test]
fn a_light_grows_without_a_step() {
    let Some(gpu) = gpu() else { return };
    const STEPS: usize = 160;
    let scene = scene(99);
    let mut frame = frame(&gpu, &scene);
    let mut placements = scene.at(0.0);
    let mut before = [Vec::new(), Vec::new()];
    let mut worst = [0.0_f64; 2];
    let mut sum = 0.0;
    let mut count = 0;
    for step in 0..=STEPS {
        let angle_deg = 0.1 * 600_f64.powf(step as f64 / STEPS as f64);
        // The angle as it is seen from the floor below.
        let radius_m = 3.5 * (angle_deg / 2.0).to_radians().sin();
        placements[2].scale = (radius_m / BALL_RADIUS_M) as f32;
        let whole = |v: f64| v / (radius_m / 3.5).powi(2);
        let now =
            lit(&mut frame, &scene, &placements).map(|values| values.into_iter().map(whole).collect::<Vec<f64>>());
        for (found, truth) in now[0].iter().zip(&now[1]) {
            sum += (found - truth).powi(2);
            count += 1;
        }
        if step > 0 {
            for ((worst, before), now) in worst.iter_mut().zip(&before).zip(&now) {
                let change = |(a, b): (&f64, &f64)| (a - b).abs();
                *worst = before.iter().zip(now).map(change).fold(*worst, f64::max);
            }
        }
        before = now;
    }
    let error = (sum / f64::from(count)).sqrt();
    let [found, truth] = worst;
    assert!(found < 1.3 * truth && error < 0.02, "{found} against {truth}, error {error}");
}

/// Which pixels evaluate the light changes as things move: rows change by at most 1.3 times as much as they should.
#[test]
fn pixels_do_not_flicker_in_slow_motion() {
    let Some(gpu) = gpu() else { return };
    let scene = scene(24);
    let mut frame = frame(&gpu, &scene);
    let shapes = RayMeshes::new(&scene);
    let disc = disc(1000);
    let [width, height] = PICTURE.map(|edge| edge as usize);
    let mut before: Vec<Option<[f64; 2]>> = vec![None; width * height];
    // Sums by rows: found, and exact.
    let mut changes = vec![[0.0_f64; 2]; height];
    let mut evaluated = 0;
    for number in 0..120 {
        let mut placements = scene.at(0.0);
        let turn = f64::from(number) / 240.0 * PI;
        let height_m = 0.8 + 0.1 * (2.0 * turn).sin();
        placements[1].position = DVec3::new(0.6 * turn.cos(), height_m, 0.4 * turn.sin()).as_vec3();
        placements[2].position = DVec3::new(1.2 * turn.sin(), 3.2, 1.2 * turn.cos()).as_vec3();
        placements[2].scale = 0.25;
        let timings = frame.render(&placements, Some(f32::INFINITY)).unwrap();
        evaluated += timings.iter().find_map(|timing| timing.counted).unwrap();
        let picture = frame.picture();
        let points = lit_points(&World::new(&scene, &shapes, &placements), PICTURE);
        let floor = points.into_par_iter().filter(|(key, _)| key.entity == 0 && key.index % 3 == 0);
        let now: Vec<(usize, [f64; 2])> = floor
            .map(|(key, view)| {
                let truth = exact(view.position, ball(&placements[1]), ball(&placements[2]), &disc);
                (key.index, [f64::from(picture[3 * key.index]), truth])
            })
            .collect();
        let mut seen = vec![None; before.len()];
        for (pixel, values) in now {
            if let Some([found, truth]) = before[pixel] {
                let [a, b]: [f64; 2] = values;
                let row = &mut changes[pixel / width];
                *row = [row[0] + f64::abs(a - found), row[1] + f64::abs(b - truth)];
            }
            seen[pixel] = Some(values);
        }
        before = seen;
    }
    assert!(evaluated > 120, "no pixel evaluated the light");
    let moved = changes.iter().filter(|[_, truth]| *truth > 0.0);
    let worst = moved.map(|[found, truth]| found / truth).fold(0.0, f64::max);
    assert!(worst < 1.3, "{worst}");
}
