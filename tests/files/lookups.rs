//! Lookups of any field are continuous.

use crate::common::generate;
use fastrand::Rng;
use glam::DVec3;
use shadow_fields::bake;
use shadow_fields::bake::assemble::{Sources, twin};
use shadow_fields::field::{FieldHeader, FieldKind, Fit, Lattice, ShadowField, Storage};
use shadow_fields::sh::quadrature::random_direction;

fn apart(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, |m, d| if d.is_nan() { f64::INFINITY } else { m.max(d) })
}

/// A field of random numbers, stored as a bake stores them.
fn field(lattice: Lattice, seed: u64) -> ShadowField {
    let mut rng = Rng::with_seed(seed);
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

/// What a step of a billionth changes more than the slopes beside it explain, relative to the largest coefficient.
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

/// A step of a billionth across anything that a lookup is made of changes no coefficient by more than its slopes. Where
/// the first shell is crossed the shells' own coordinate has a vertical tangent (a square root).
#[test]
fn lookups_are_continuous() {
    let round = ["cube:6x5,inner=0.4", "cube:6x7,inner=0.5", "cube:6x5,edges,inner=0.5", "cube:6x3,inner=1.02"];
    let mut lattices: Vec<Lattice> = round.map(|text| text.parse().unwrap()).to_vec();
    let fit = Fit { centre: [0.1, -0.2, 0.0], stretch: [1.0, 1.5, 1.25] };
    lattices.push(Lattice { fit: Some(fit), ..lattices[0] });
    let fields: Vec<ShadowField> = (1..).zip(lattices).map(|(seed, lattice)| field(lattice, seed)).collect();
    let mut rng = Rng::with_seed(15);
    for _ in 0..2000 {
        let field = &fields[rng.usize(0..fields.len())];
        let lattice = &field.header.lattice;
        let direction = random_direction(&mut rng);
        let across = random_direction(&mut rng);
        let distance = 0.5 + 11.5 * rng.f64();
        let signs = direction.signum();
        // Where something about a lookup changes.
        let (seam, towards, d) = match rng.u32(0..6) {
            0 => ("an edge", signs * DVec3::new(1.0, 1.0, direction.z.abs()), distance),
            1 => ("a corner", signs, distance),
            2 => ("a cell", lattice.direction((distance * 7.0) as u32 % lattice.direction_count()), distance),
            3 => ("a shell", direction, lattice.shell(rng.u32(1..5))),
            4 => ("the outer shell", direction, lattice.outer),
            _ => ("the inner shell", direction, lattice.inner),
        };
        let place = lattice.fit().invert(d * towards.normalize());
        let excess = excess(field, place, across);
        // The square root at the first shell: 3e-5 over a billionth.
        let root = if (d - lattice.inner).abs() < 1e-6 { 1e-3 } else { 1e-7 };
        assert!(excess <= root, "{seam} of {lattice:?}, {place} along {across}: {excess:e} beyond the slope");
    }
}
