//! Products on the device against their twin, and chains of up to a thousand occluders, alone and through the merge.

mod common;
#[path = "common/stage.rs"]
mod stage;

use common::report;
use shadow_fields::gpu::{Buffer, BufferKind, Commands};
use shadow_fields::merge::chain::{Chain, PRODUCTS, Product};
use shadow_fields::merge::product::{ProductShape, Products, Push, twin};
use shadow_fields::sh::basis::coefficient_count;
use shadow_fields::sh::lobe::{cap, clamped_cosine};
use shadow_fields::sh::quadrature::random_direction;
use stage::{Stage, scene, small, stage};

/// Caps of 10 to 40 degrees about the sky, and cosines about as many normals.
fn inputs(shape: ProductShape, count: usize) -> [Vec<f64>; 2] {
    let mut rng = fastrand::Rng::with_seed(11);
    let mut direction = || (random_direction(&mut rng), (10.0 + 30.0 * rng.f64()).to_radians());
    let transfers = (0..count).flat_map(|_| clamped_cosine(shape.bands, direction().0)).collect();
    let factor = |(axis, angle)| cap(shape.field_bands, axis, angle);
    [transfers, (0..count).flat_map(|_| factor(direction())).collect()]
}

fn multiply(stage: &Stage, shape: ProductShape, [transfers, factors]: &[Vec<f64>; 2], push: Push) -> Vec<f32> {
    let (device, library) = (&stage.gpu.device, &stage.gpu.library);
    let narrow = |of: &[f64]| of.iter().map(|c| *c as f32).collect::<Vec<f32>>();
    let transfers = Buffer::with_data(device, "transfers", &narrow(transfers)).unwrap();
    let factors = Buffer::with_data(device, "factors", &narrow(factors)).unwrap();
    let products = Buffer::new(device, "products", BufferKind::Device, transfers.size_bytes).unwrap();
    let pass = Products::new(device, library, shape, true).unwrap();
    let mut commands = Commands::new(device, "product").unwrap();
    commands.pass("product", |c| pass.record(c, [&transfers, &factors, &products], push)).unwrap();
    commands.submit().unwrap();
    products.download(push.count as usize * coefficient_count(shape.bands)).unwrap()
}

/// Largest difference to the twin.
fn error(stage: &Stage, shape: ProductShape, count: usize, steps: u32) -> f64 {
    let inputs = inputs(shape, count);
    let push = Push { count: count as u32, steps, fade: 0.96875 };
    let found = multiply(stage, shape, &inputs, push);
    let sizes = [shape.bands, shape.field_bands].map(coefficient_count);
    let chains = inputs[0].chunks(sizes[0]).zip(inputs[1].chunks(sizes[1])).zip(found.chunks(sizes[0]));
    let mut worst = 0.0_f64;
    for ((transfer, factor), found) in chains {
        for (f, e) in found.iter().zip(twin(shape, transfer, factor, push)) {
            assert!(f.is_finite(), "{shape:?}");
            worst = worst.max((f64::from(*f) - e).abs());
        }
    }
    worst
}

#[test]
fn every_product_is_its_twin() {
    let Some(stage) = stage() else { return };
    let chains = |product| [true, false].map(|guard| Chain { product, guard });
    let square = PRODUCTS.iter().flat_map(|(_, product)| chains(*product)).map(|chain| (chain, 4, 4));
    let other = [(3, 3), (4, 5), (4, 7), (3, 6)].map(|(a, b)| (Chain::default(), a, b));
    for (chain, bands, field_bands) in square.chain(other) {
        let shape = ProductShape { chain, bands, field_bands };
        // Eight products of numbers about 1, each off by some 6e-8 for each of ten terms. A last workgroup is not full.
        let worst = error(&stage, shape, 100, 8);
        report(&format!("{shape:?}: {worst:.1e}"));
        assert!(worst < 5e-6, "{shape:?}: {worst:e}");
    }
}

/// One cap of 30 degrees again and again: neither the irradiance under a uniform sky nor the length ever exceeds its start. The
/// twin of the unguarded chain shows that this is no matter of course.
#[test]
fn guarded_chains_stay_bounded() {
    let Some(stage) = stage() else { return };
    for product in [Product::Factored, Product::PointChain] {
        let shape = |guard| ProductShape { chain: Chain { product, guard }, bands: 4, field_bands: 4 };
        let inputs = inputs(shape(true), 256);
        for steps in [1, 4, 64, 1000] {
            let push = Push { count: 256, steps, fade: 1.0 };
            let found = multiply(&stage, shape(true), &inputs, push);
            let mut longest = 0.0_f64;
            for (before, after) in inputs[0].chunks(16).zip(found.chunks(16)) {
                let length = |of: &mut dyn Iterator<Item = f64>| of.map(|c| c * c).sum::<f64>().sqrt();
                let share = length(&mut after.iter().map(|c| f64::from(*c))) / length(&mut before.iter().copied());
                longest = longest.max(share);
                // Coefficients are kept from growing to the last bit. At points they are sums over 32, off by 1e-7 a step.
                let slack = if product == Product::PointChain { 1e-6 + 1e-7 * f64::from(steps) } else { 1e-6 };
                assert!(share < 1.0 + slack, "{product:?}, {steps} steps: {share}");
                let [first, before] = [f64::from(after[0]), before[0]];
                assert!(first <= before + slack && first >= -slack, "{product:?}, {steps} steps: {first} of {before}");
            }
            report(&format!("{product:?}, {steps} steps: longest {longest:.6}"));
        }
        let push = Push { count: 1, steps: 1000, fade: 1.0 };
        let grown = inputs[0]
            .chunks(16)
            .zip(inputs[1].chunks(16))
            .take(16)
            .map(|(transfer, factor)| twin(shape(false), transfer, factor, push)[0].abs());
        assert!(grown.fold(0.0, f64::max) > 100.0, "without the guard {product:?} grows");
    }
}

/// A floor under `count` balls at one place, or spread over the sky.
fn balls(count: usize, distinct: bool) -> shadow_fields::scene::Scene {
    let mut text = String::from(
        "environment = { uniform = [1, 1, 1] }\n[[mesh]]\nname = \"floor\"\nplane = { size_m = 2, cells = 6 }\n[[mesh]]\nname = \"ball\"\n\
         sphere = { radius_m = 0.5, subdivisions = 2 }\n[[entity]]\nmesh = \"floor\"\n",
    );
    let mut rng = fastrand::Rng::with_seed(12);
    for _ in 0..count {
        let (turn, up) = (std::f64::consts::TAU * rng.f64(), 0.3 + 0.7 * rng.f64());
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
    let light = |scene: &shadow_fields::scene::Scene, options| {
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
            report(&format!(
                "{count} balls, distinct {distinct}: at most {worst:.4} of the open floor, at least {least:.4}"
            ));
            assert!(worst <= 1.0 + 1e-6 && least >= 0.0, "{count} balls, distinct {distinct}: {least} to {worst}");
        }
    }
}
