//! What samples stand for, and lookups of any field, which are continuous.

use crate::common::generate;
use fastrand::Rng;
use glam::DVec3;
use shadow_fields::bake;
use shadow_fields::bake::assemble::{Source, Sources, twin};
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

#[test]
fn what_lies_inside_is_filled_from_around() {
    let lattice: Lattice = "cube:4x3,inner=0.3".parse().unwrap();
    let count = lattice.sample_count() as usize;
    let directions = lattice.direction_count();
    // One sample inside: its replacement is the mean of its six neighbours, or five on the first shell.
    for (sample, neighbours) in [(directions + 4, 6), (4, 5), (3 * directions + 13, 5)] {
        let mut inside = vec![false; count];
        inside[sample as usize] = true;
        let sources = Sources::new(&lattice, &inside, &inside).unwrap();
        assert!(sources.list.iter().all(|s| s.sample != sample), "the raw capture is used");
        let own = lattice.sources().iter().position(|s| *s == [sample % directions]).unwrap() as u32;
        let stored = (sample / directions * lattice.stored_direction_count() + own) as usize;
        let list = &sources.list[sources.offsets[stored] as usize..sources.offsets[stored + 1] as usize];
        assert_eq!(list.len(), neighbours, "sample {sample}");
        for Source { sample: other, weight } in list {
            assert!((weight * neighbours as f32 - 1.0).abs() < 1e-6);
            let step = lattice.position(*other).distance(lattice.position(sample));
            assert!(step < lattice.position(sample).length().max(6.0), "{other} is no neighbour of {sample}");
        }
    }
    assert_eq!(Sources::new(&lattice, &vec![true; count], &vec![true; count]).unwrap_err().exit_code(), 4);
    // All but one inside: everything is that one.
    let mut inside = vec![true; count];
    inside[100] = false;
    assert!(Sources::new(&lattice, &inside, &inside).unwrap().list.iter().all(|s| s.sample == 100));
}

/// What is stored is fitted to being interpolated: constants and straight lines stay, a parabola over the shells sinks
/// by a twelfth of its second difference, and so does the field as a whole.
#[test]
fn samples_are_lowered_by_the_sag_between_them() {
    let lattice: Lattice = "cube:6x5,inner=0.3".parse().unwrap();
    let count = lattice.sample_count();
    let none = vec![false; count as usize];
    let sources = Sources::new(&lattice, &none, &none).unwrap();
    let shell = |sample: u32| f64::from(sample / lattice.direction_count());
    let stored = |of: &dyn Fn(u32) -> f64| {
        let captured: Vec<f32> = (0..count).map(|s| of(s) as f32).collect();
        twin(&captured, &sources, 1, 1.0)
    };
    let per_shell = lattice.stored_direction_count() as usize;
    for (power, sag) in [(0, 0.0), (1, 0.0), (2, 2.0 / 12.0)] {
        for (at, found) in stored(&|s| shell(s).powi(power)).iter().enumerate() {
            let shell = at / per_shell;
            let sag = if (1..5).contains(&shell) { sag } else { 0.0 };
            let wanted = (shell as f64).powi(power) - sag;
            assert!((found - wanted).abs() < 1e-5, "power {power}, stored sample {at}: {found}, not {wanted}");
        }
    }
    // Across directions, cells of 18 degrees: x^2 is a squared cosine, whose second derivative is -2 along both at its
    // peak, which rises by 2 x 2 (pi / 10)^2 / 12 = .033, and 2 across its trough, which sinks by half that.
    let squares = stored(&|s| lattice.direction(s % lattice.direction_count()).x.powi(2));
    assert!(squares.iter().all(|x| (-0.018..1.035).contains(x)), "{squares:?}");
    // Nothing is taken across a sample that stands for another place.
    let mut inside = none.clone();
    inside[100] = true;
    let careful = Sources::new(&lattice, &inside, &none).unwrap();
    let uses = |s: &Sources| s.list.iter().filter(|source| source.sample == 100).count();
    assert!(uses(&careful) < uses(&sources) && uses(&careful) >= 1);
}
