//! What samples stand for.

use shadow_fields::bake::assemble::{Source, Sources, twin};
use shadow_fields::field::Lattice;

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
