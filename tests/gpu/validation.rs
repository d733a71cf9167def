//! Those who watch are watched: the layer hears a hazard, the tracker misses a barrier of a bake.

use crate::common::{Gpu, generate, gpu};
use shadow_fields::bake::assemble::Assemble;
use shadow_fields::field::{FieldKind, Storage};
use shadow_fields::gpu::{Buffer, BufferKind, Commands};
use shadow_fields::{Error, bake};

fn buffer(gpu: &Gpu, name: &str) -> Buffer {
    Buffer::new(&gpu.device, name, BufferKind::Device, 1024).unwrap()
}

#[test]
fn the_layer_hears_a_hazard_between_copies() {
    let Some(gpu) = gpu() else { return };
    let [a, b, c] = ["a", "b", "c"].map(|name| buffer(&gpu, name));
    let mut commands = Commands::new(&gpu.device, "canary").unwrap();
    commands.copy_range(&a, 0..a.size_bytes, &b, 0);
    commands.copy_range(&b, 0..b.size_bytes, &c, 0);
    assert!(commands.submit().is_err());
    let heard = gpu.device.take_validation_messages();
    assert!(heard.iter().any(|m| m.contains("SYNC-HAZARD-READ")), "synchronisation checks are off: {heard:?}");
}

#[test]
fn the_barrier_of_a_bake_batch_is_missed() {
    let Some(gpu) = gpu() else { return };
    let mesh = generate::sphere(1.0, 1);
    for kind in [FieldKind::Occlusion, FieldKind::Radiance] {
        let options = bake::Options { lattice: "cube:2x3".parse().unwrap(), face_px: 16, ..Default::default() };
        let bake = || gpu.baker().field(&mesh, bake::header(&mesh, kind, &options), &|_, _| ());
        bake().unwrap();
        assert_eq!(gpu.device.take_validation_messages(), Vec::<String>::new());
        let atlas: &[&str] = &["bake batch", "capture atlas", "pass capture", "pass project"];
        let texels: &[&str] = &["bake batch", "capture texels", "pass capture", "TransferRead"];
        let computed = kind == FieldKind::Occlusion && gpu.device.info.is_software();
        for (index, words) in if computed { vec![texels, atlas] } else { vec![atlas] }.into_iter().enumerate() {
            let error = gpu.without_barrier(index, bake).err().expect("an objection");
            let message = error.to_string();
            assert!(matches!(error, Error::Failed(_)) && message.contains("missing synchronisation"), "{error:?}");
            assert!(words.iter().all(|word| message.contains(word)), "{words:?} are not in: {message}");
            let _ = gpu.device.take_validation_messages();
        }
        // Nothing that fails leaves the device in disorder.
        bake().unwrap();
    }
}

/// A resource of the wrong kind or size is a programmer's mistake, told with pass and binding.
#[test]
fn wrong_resources_panic_with_names() {
    let Some(gpu) = gpu() else { return };
    let pass = Assemble::new(&gpu.device, &gpu.library, Storage::F32).unwrap();
    let buffer = buffer(&gpu, "some buffer");
    let message = |range: std::ops::Range<u64>| {
        let attempt = std::panic::AssertUnwindSafe(|| {
            let mut commands = Commands::new(&gpu.device, "wrong").unwrap();
            let inputs = [&buffer, &buffer, &buffer];
            let _ = commands.pass("assemble", |c| pass.record(c, inputs, (&buffer, range.clone()), (1, 1), 1.0));
        });
        let panic = std::panic::catch_unwind(attempt).expect_err("a mistake went through");
        panic.downcast_ref::<String>().cloned().unwrap_or_default()
    };
    for range in [0..4096, 3..512] {
        let message = message(range.clone());
        assert!(message.contains("assemble") && message.contains("binding 3"), "{range:?}: {message}");
    }
    let _ = gpu.device.take_validation_messages();
}
