//! Lookups of any field are continuous. The seed is fixed and printed (`--nocapture`); a place of a jump is shrunk and
//! printed too.

use crate::common::{generate, report};
use glam::DVec3;
use proptest::prelude::*;
use proptest::test_runner::{RngSeed, TestRunner};
use shadow_fields::bake;
use shadow_fields::bake::assemble::{Sources, twin};
use shadow_fields::field::{FieldHeader, FieldKind, Fit, Lattice, ShadowField, Storage};

fn unit() -> impl Strategy<Value = DVec3> {
    [-1.0..1.0, -1.0..1.0, -1.0_f64..1.0].prop_filter_map("too short to have a direction", |place| {
        let place = DVec3::from_array(place);
        (place.length() > 0.1).then(|| place.normalize())
    })
}

fn apart(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, |m, d| if d.is_nan() { f64::INFINITY } else { m.max(d) })
}

/// A field of random numbers, stored as a bake stores them.
fn field(lattice: Lattice, seed: u64) -> ShadowField {
    let mut rng = fastrand::Rng::with_seed(seed);
    let options = bake::Options { bands: 2, storage: Storage::F32, ..Default::default() };
    let header = bake::header(&generate::sphere(1.0, 0), FieldKind::Occlusion, &options);
    let header = FieldHeader { lattice, ..header };
    let captured: Vec<f32> =
        (0..lattice.sample_count() as usize * header.sample_stride()).map(|_| rng.f32() - 0.5).collect();
    let none = vec![false; lattice.sample_count() as usize];
    let sources = Sources::new(&lattice, &none, &none).unwrap();
    let stored = twin(&captured, &sources, header.sample_stride(), 1.0);
    let payload = stored.iter().flat_map(|x| (*x as f32).to_le_bytes()).collect();
    ShadowField { header, payload }
}

/// Where something about a lookup changes.
#[derive(Clone, Copy, Debug)]
enum Seam {
    Edge,
    Corner,
    Cell,
    Shell(u32),
    Outer,
    Inner,
}

fn seam() -> impl Strategy<Value = Seam> {
    prop_oneof![
        Just(Seam::Edge),
        Just(Seam::Corner),
        Just(Seam::Cell),
        (1..5_u32).prop_map(Seam::Shell),
        Just(Seam::Outer),
        Just(Seam::Inner),
    ]
}

/// By how much a step of a billionth changes a lookup more than the slopes on both sides explain, relative to the
/// largest coefficient there.
fn excess(field: &ShadowField, place: DVec3, across: DVec3) -> f64 {
    let at = |step: f64| {
        let mut out = [0.0; 4];
        field.lookup(place + step * across, 0, &mut out);
        out
    };
    let largest =
        at(0.0).iter().fold(field.header.lattice.unscale(field.header.lattice.distance(place)), |m, x| m.max(x.abs()));
    let tiny = 1e-9;
    let step = 1e-6;
    let jump = apart(&at(tiny), &at(-tiny));
    let slope = (apart(&at(2.0 * step), &at(step)) / step).max(apart(&at(-2.0 * step), &at(-step)) / step);
    (jump - 4.0 * tiny * slope) / largest
}

/// A step of a billionth across anything that a lookup is made of changes no coefficient by more than the slope on
/// either side explains. Only where the first shell is crossed the shells' own coordinate has a vertical tangent (a
/// square root).
#[test]
fn lookups_are_continuous() {
    const SEED: u64 = 15;
    let round = ["cube:6x5,inner=0.4", "cube:6x7,inner=0.5", "cube:6x5,edges,inner=0.5", "cube:6x3,inner=1.02"];
    let mut lattices: Vec<Lattice> = round.map(|text| text.parse().unwrap()).to_vec();
    let fit = Fit { centre: [0.1, -0.2, 0.0], stretch: [1.0, 1.5, 1.25] };
    lattices.push(Lattice { fit: Some(fit), ..lattices[0] });
    let fields: Vec<ShadowField> = (1..).zip(lattices).map(|(seed, lattice)| field(lattice, seed)).collect();
    let input = (0..fields.len(), seam(), unit(), unit(), 0.5..12.0_f64);
    let config =
        ProptestConfig { cases: 2000, rng_seed: RngSeed::Fixed(SEED), failure_persistence: None, ..Default::default() };
    report(&format!("{} cases, seed {SEED}", config.cases));
    let outcome = TestRunner::new(config).run(&input, |(which, seam, direction, across, distance)| {
        let field = &fields[which];
        let lattice = &field.header.lattice;
        let signs = direction.signum();
        let (towards, d) = match seam {
            Seam::Edge => (signs * DVec3::new(1.0, 1.0, direction.z.abs()), distance),
            Seam::Corner => (signs, distance),
            Seam::Cell => (lattice.direction((distance * 7.0) as u32 % lattice.direction_count()), distance),
            Seam::Shell(index) => (direction, lattice.shell(index)),
            Seam::Outer => (direction, lattice.outer),
            Seam::Inner => (direction, lattice.inner),
        };
        let excess = excess(field, lattice.fit().invert(d * towards.normalize()), across);
        // The square root at the first shell: 3e-5 over a billionth.
        let root = if (d - lattice.inner).abs() < 1e-6 { 1e-3 } else { 1e-7 };
        prop_assert!(excess <= root, "a step of {excess:e} of the largest coefficient beyond the slope");
        Ok(())
    });
    outcome.unwrap();
}
