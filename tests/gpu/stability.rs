//! Odd places, sizes, numbers and meshes: everything finite, bounded, the same on a second run, and near its f64 twin.

use crate::stage;
use shadow_fields::bake;
use shadow_fields::bench::trials::{cases, run};
use shadow_fields::check;
use shadow_fields::field::Storage;
use shadow_fields::frame;
use shadow_fields::lists::skip::Skip;
use shadow_fields::scene::Scene;
use stage::{scene, small, stage};

#[test]
fn odd_scenes_stay_bounded() {
    let Some(stage) = stage() else { return };
    for case in cases(64).unwrap() {
        for (storage, base) in [(Storage::F16, check::sharp::sharp_options()), (Storage::F32, small())] {
            let bake = bake::Options { storage, ..base.bake };
            let options = frame::Options { bake, skip: Skip::without("unmoved"), ..base };
            let trial = run(&case, stage.frame(&case.scene, options), storage).unwrap();
            assert!(trial.passed, "{trial:?}");
        }
    }
}

/// A floor under `count` balls at one place, or spread over the sky.
fn balls(count: usize, distinct: bool) -> Scene {
    let mut text = String::from(
        "environment = { uniform = [1, 1, 1] }\n[[mesh]]\nname = \"floor\"\nplane = { size_m = 2, cells = 6 }\n[[mesh]]\nname = \"ball\"\n\
         sphere = { radius_m = 0.5, subdivisions = 2 }\n[[entity]]\nmesh = \"floor\"\n",
    );
    let mut rng = fastrand::Rng::with_seed(12);
    for _ in 0..count {
        let turn = std::f64::consts::TAU * rng.f64();
        let up = 0.3 + 0.7 * rng.f64();
        let across = 2.0 * (1.0 - up * up).sqrt();
        let at = if distinct { [across * turn.cos(), 2.0 * up, across * turn.sin()] } else { [0.4, 0.9, 0.1] };
        text += &format!("[[entity]]\nmesh = \"ball\"\nreceives = false\nposition = {at:?}\n");
    }
    scene(&text)
}

/// Through the merge: nothing is lit more than without occluders, however many there are.
#[test]
fn merges_of_many_occluders_stay_bounded() {
    let Some(stage) = stage() else { return };
    let light = |scene: &Scene, options| {
        let mut frame = stage.frame(scene, options);
        stage.light(&mut frame, &scene.at(0.0)).swap_remove(0)
    };
    let options = small();
    let open = light(&balls(0, false), options);
    for distinct in [false, true] {
        for count in [1, 64, 1000] {
            let scene = balls(count, distinct);
            let found = light(&scene, options);
            let worst = found.iter().zip(&open).map(|(f, o)| f[0] / o[0]).fold(0.0, f32::max);
            let least = found.iter().map(|f| f[0]).fold(f32::INFINITY, f32::min);
            assert!(worst <= 1.0 + 1e-6 && least >= 0.0, "{count} balls, distinct {distinct}: {least} to {worst}");
        }
    }
}
