//! Odd places, sizes, numbers and meshes: everything finite, bounded, the same on a second run, and near its f64 twin.

use crate::common::gpu;
use crate::stage::small;
use shadow_fields::bench::stability::{cases, trial};
use shadow_fields::field::Storage;
use shadow_fields::lists::skip::Skip;
use shadow_fields::{bake, check, frame};

#[test]
fn odd_scenes_stay_bounded() {
    let Some(gpu) = gpu() else { return };
    for case in cases(64).unwrap() {
        for (storage, base) in [(Storage::F16, check::sharp::sharp_options()), (Storage::F32, small())] {
            let bake = bake::Options { storage, ..base.bake };
            let options = frame::Options { bake, skip: Skip::without("unmoved"), ..base };
            let trial = trial(&case, gpu.frame(&case.scene, options), storage).unwrap();
            assert!(trial.passed, "{trial:?}");
        }
    }
}
