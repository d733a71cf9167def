//! What must hold for any input: products, rotations, projections and lookups under random numbers. The seed of each is
//! fixed and printed (`--nocapture`); a failing input is shrunk and printed too.

use crate::common;
use common::report;
use glam::{DQuat, DVec3};
use proptest::prelude::*;
use proptest::test_runner::{RngSeed, TestRunner};
use shadow_fields::bake::assemble::{Sources, twin};
use shadow_fields::field::{FieldHeader, FieldKind, Lattice, ShadowField, Storage};
use shadow_fields::sh::basis::{Y00, coefficient_count};
use shadow_fields::sh::product::Tensor;
use shadow_fields::sh::project::project;
use shadow_fields::sh::rotation::Rotation;

/// f64 sums of some hundred terms of order 1.
const ROUNDING: f64 = 1e-11;

/// Tries a property on `cases` inputs of a strategy.
fn holds<S: Strategy>(
    name: &str,
    seed: u64,
    cases: u32,
    of: S,
    property: impl Fn(S::Value) -> Result<(), TestCaseError>,
) {
    report(&format!("{name}: {cases} cases, seed {seed}"));
    let config =
        ProptestConfig { cases, rng_seed: RngSeed::Fixed(seed), failure_persistence: None, ..Default::default() };
    if let Err(error) = TestRunner::new(config).run(&of, property) {
        panic!("{name}, seed {seed}: {error}");
    }
}

fn bands() -> impl Strategy<Value = usize> {
    2..=7_usize
}

fn coefficients(count: usize) -> impl Strategy<Value = Vec<f64>> {
    proptest::collection::vec(-2.0..2.0, count)
}

/// Bands, and three vectors of as many.
fn three() -> impl Strategy<Value = (usize, [Vec<f64>; 3])> {
    bands().prop_flat_map(|n| {
        let one = || coefficients(coefficient_count(n));
        (Just(n), [one(), one(), one()])
    })
}

fn rotation() -> impl Strategy<Value = DQuat> {
    let unit = [-1.0..1.0, -1.0..1.0, -1.0..1.0, -1.0_f64..1.0];
    unit.prop_filter_map("too short to have a direction", |q| {
        let q = DQuat::from_array(q);
        (q.length() > 0.1).then(|| q.normalize())
    })
}

fn unit() -> impl Strategy<Value = DVec3> {
    rotation().prop_map(|q| q * DVec3::Z)
}

fn multiply(tensor: &Tensor, a: &[f64], b: &[f64]) -> Vec<f64> {
    let mut out = vec![0.0; a.len()];
    tensor.multiply(a, b, &mut out);
    out
}

fn apart(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, |m, d| if d.is_nan() { f64::INFINITY } else { m.max(d) })
}

fn length(a: &[f64]) -> f64 {
    a.iter().map(|x| x * x).sum::<f64>().sqrt()
}

fn turned(q: DQuat, bands: usize, a: &[f64]) -> Vec<f64> {
    let mut out = vec![0.0; a.len()];
    Rotation::new(bands, q).apply(a, &mut out);
    out
}

#[test]
fn products_commute_keep_one_and_are_linear() {
    let scale = -3.0..3.0_f64;
    holds("product", 11, 128, (three(), scale), |((bands, [a, b, c]), s)| {
        let tensor = Tensor::new(bands, bands, bands);
        prop_assert!(apart(&multiply(&tensor, &a, &b), &multiply(&tensor, &b, &a)) < 100.0 * ROUNDING, "it commutes");
        let mut one = vec![0.0; a.len()];
        one[0] = 1.0 / Y00;
        prop_assert!(apart(&multiply(&tensor, &a, &one), &a) < ROUNDING, "1 is neutral");
        let sum: Vec<f64> = b.iter().zip(&c).map(|(b, c)| b + s * c).collect();
        let (ab, ac) = (multiply(&tensor, &a, &b), multiply(&tensor, &a, &c));
        let parts: Vec<f64> = ab.iter().zip(&ac).map(|(x, y)| x + s * y).collect();
        prop_assert!(apart(&multiply(&tensor, &a, &sum), &parts) < 100.0 * ROUNDING, "it is linear");
        Ok(())
    });
}

/// A product of turned functions is the turned product, whose bands the truncation leaves alone.
#[test]
fn products_turn_with_their_factors() {
    holds("product and rotation", 12, 64, (three(), rotation()), |((bands, [a, b, _]), q)| {
        let tensor = Tensor::new(bands, bands, bands);
        let first = turned(q, bands, &multiply(&tensor, &a, &b));
        let second = multiply(&tensor, &turned(q, bands, &a), &turned(q, bands, &b));
        prop_assert!(apart(&first, &second) < 1000.0 * ROUNDING, "{:e}", apart(&first, &second));
        Ok(())
    });
}

#[test]
fn rotations_are_a_group_that_keeps_lengths() {
    holds("rotation", 13, 96, (three(), rotation(), rotation()), |((bands, [a, ..]), p, q)| {
        let two = turned(p, bands, &turned(q, bands, &a));
        prop_assert!(apart(&two, &turned(p * q, bands, &a)) < 100.0 * ROUNDING, "two turns are one");
        let back = turned(q.inverse(), bands, &turned(q, bands, &a));
        prop_assert!(apart(&back, &a) < 100.0 * ROUNDING, "a turn and its inverse");
        prop_assert!((length(&two) - length(&a)).abs() < 100.0 * ROUNDING * (1.0 + length(&a)), "lengths");
        prop_assert!(apart(&turned(DQuat::IDENTITY, bands, &a), &a) < ROUNDING, "no turn");
        Ok(())
    });
}

#[test]
fn projection_is_linear() {
    const PX: usize = 6;
    let texels = || proptest::collection::vec(-1.0..1.0_f64, 6 * PX * PX);
    holds("projection", 14, 48, (bands(), texels(), texels(), -3.0..3.0_f64), |(bands, f, g, s)| {
        let of = |values: &[f64]| project(bands, PX, |face, x, y| values[(face * PX + y) * PX + x]);
        let sum: Vec<f64> = f.iter().zip(&g).map(|(f, g)| f + s * g).collect();
        let parts: Vec<f64> = of(&f).iter().zip(of(&g)).map(|(f, g)| f + s * g).collect();
        prop_assert!(apart(&of(&sum), &parts) < 100.0 * ROUNDING);
        Ok(())
    });
}

/// A field of random numbers, stored as a bake stores them.
fn field(lattice: Lattice, seed: u64) -> ShadowField {
    let mut rng = fastrand::Rng::with_seed(seed);
    let header = FieldHeader {
        kind: FieldKind::Occlusion,
        bands: 2,
        storage: Storage::F32,
        lattice,
        face_px: 8,
        level_texels: 0.0,
        filled_samples: 0,
        captured_samples: 0,
        centre_m: [0.0; 3],
        radius_m: 1.0,
        radiance_scale: 1.0,
        mesh: "random".into(),
        mesh_hash: String::new(),
    };
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
    let (tiny, step) = (1e-9, 1e-6);
    let jump = apart(&at(tiny), &at(-tiny));
    let slope = (apart(&at(2.0 * step), &at(step)) / step).max(apart(&at(-2.0 * step), &at(-step)) / step);
    (jump - 4.0 * tiny * slope) / largest
}

/// A step of a billionth across anything that a lookup is made of changes no coefficient by more than the slope on
/// either side explains. Only where the first shell is crossed the shells' own coordinate has a vertical tangent (a
/// square root).
#[test]
fn lookups_are_continuous() {
    let lattices = [
        "cube:6x5,inner=0.4",
        "cube:6x5,inner=0.4,centre=0.1:-0.2:0,stretch=1:1.5:1.25",
        "cube:6x7,inner=0.5",
        "cube:6x5,edges,inner=0.5",
        "cube:6x3,inner=1.02",
    ];
    let fields: Vec<ShadowField> = (1..).zip(lattices).map(|(seed, text)| field(text.parse().unwrap(), seed)).collect();
    let input = (0..fields.len(), seam(), unit(), unit(), 0.5..12.0_f64);
    holds("lookup", 15, 2000, input, |(which, seam, direction, across, distance)| {
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
}

/// The measure finds a jump: borders of faces that are not their neighbours' cells.
#[test]
fn wrong_borders_are_found() {
    let mut field = field("cube:6x5,inner=0.4".parse().unwrap(), 1);
    field.payload.rotate_left(4 * 4 * 7);
    let edge = 2.0 * DVec3::new(1.0, 1.0, 0.3).normalize();
    assert!(excess(&field, edge, DVec3::new(1.0, -1.0, 0.2).normalize()) > 1e-3);
}
