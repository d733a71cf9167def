//! The lattice: sample points, weights, continuity, fall-off, text form. Seeds are fixed; "exactly" means f64 rounding.

mod interpolation;

use crate::common::generate;
use fastrand::Rng;
use glam::DVec3;
use shadow_fields::asset::Mesh;
use shadow_fields::bake;
use shadow_fields::field::lattice::{CELL_WARP, OUTSIDE_INNER, cap_cosine, cap_height, unwarp, warp};
use shadow_fields::field::{FieldKind, Fit, Lattice};
use shadow_fields::sh::quadrature::random_direction;
use std::f64::consts::PI;

/// A few f64 roundings, widened by the steepest slope of a shell coordinate (some hundreds a unit of distance).
const ROUNDING: f64 = 1e-9;

/// Both arrangements, one shell, one cell, both first shells that a bake takes.
fn lattices() -> Vec<Lattice> {
    [
        "cube:16x7,inner=1.02",
        "cube:16x9,inner=0.25",
        "cube:5x5,inner=0.5,outer=3.5",
        "cube:1x3,inner=1.5,outer=4",
        "cube:2x1,inner=0.25",
        "cube:5x5,edges,inner=0.5,outer=3.5",
        "cube:2x1,edges,inner=0.25",
    ]
    .map(|text| text.parse().unwrap_or_else(|error| panic!("{error}")))
    .to_vec()
}

/// Values of captured samples as the assemble pass would store them: a border holds the mean of its sources.
fn store(lattice: &Lattice, captured: &[f64]) -> Vec<f64> {
    let directions = lattice.direction_count() as usize;
    let planes = lattice.sources();
    (0..lattice.shells as usize)
        .flat_map(|shell| {
            planes.iter().map(move |cells| {
                cells.iter().map(|&c| captured[shell * directions + c as usize]).sum::<f64>() / cells.len() as f64
            })
        })
        .collect()
}

fn interpolate(lattice: &Lattice, stored: &[f64], position: DVec3) -> f64 {
    let corners = lattice.corners(position);
    corners.index.iter().zip(corners.weight).map(|(&index, weight)| weight * stored[index as usize]).sum()
}

fn noise(lattice: &Lattice, rng: &mut Rng) -> Vec<f64> {
    let mut values: Vec<f64> = (0..lattice.sample_count()).map(|_| rng.f64()).collect();
    // What faces share is one sample.
    let count = lattice.direction_count();
    for i in 0..values.len() as u32 {
        values[i as usize] = values[(i / count * count + lattice.first_of(i % count)) as usize];
    }
    values
}

#[test]
fn faces_share_the_samples_on_their_edges() {
    for cells in [1, 3, 7] {
        let lattice: Lattice = format!("cube:3x{cells},edges,inner=0.5").parse().unwrap();
        let columns = cells + 2;
        assert_eq!([lattice.direction_count(), lattice.stored_direction_count()], [6 * columns * columns; 2]);
        let firsts: Vec<u32> = (0..lattice.direction_count()).filter(|&i| lattice.first_of(i) == i).collect();
        assert_eq!(firsts.len() as u32, 6 * cells * cells + 12 * cells + 8, "faces, edges, corners");
        for i in 0..lattice.direction_count() {
            let first = lattice.first_of(i);
            assert!(first <= i && lattice.first_of(first) == first);
            assert_eq!(lattice.direction(first), lattice.direction(i), "to the last bit: no jump between faces");
        }
        for (n, &a) in firsts.iter().enumerate() {
            let apart = |b: &u32| lattice.direction(a).angle_between(lattice.direction(*b));
            assert!(firsts[..n].iter().all(|b| apart(b) > 0.5 / f64::from(columns)), "{cells}: {a} is there twice");
            // Neighbours are a step away, and those of a pair on opposite sides, save where three faces meet.
            let around = lattice.cell_neighbours(a);
            let step = 90.0 / f64::from(cells + 1);
            let is_near = |b: &u32| (0.6 * step..1.3 * step).contains(&apart(b).to_degrees());
            assert!(around.iter().all(is_near), "{cells}: {a} {around:?}");
            let corner = lattice.direction(a).abs().min_element() > 0.577;
            for pair in around.chunks_exact(2) {
                let [u, v] = [pair[0], pair[1]].map(|b| lattice.direction(b) - lattice.direction(a));
                let angle = u.angle_between(v).to_degrees();
                assert!(angle > 95.0, "{cells}: {a} {pair:?}: {angle}");
            }
            let is_twice = |i: usize| around[i + 1..].contains(&around[i]);
            assert!(corner || !(0..4).any(is_twice), "{cells}: {a} {around:?}");
        }
    }
    let chosen: Lattice = "cube:6x5,edges".parse().unwrap();
    assert_eq!((chosen.edges, chosen.to_string()), (Some(true), "cube:6x5,outer=8,edges".to_owned()));
    assert_eq!("cube:6x5,edges=auto".parse::<Lattice>().unwrap().edges, None);
}

#[test]
fn samples_lie_on_their_shells() {
    for lattice in lattices() {
        let last = lattice.shells - 1;
        assert!((lattice.shell(0) - lattice.inner).abs() < ROUNDING, "{lattice}");
        assert!(last == 0 || (lattice.shell(last) - lattice.outer).abs() < ROUNDING * lattice.outer, "{lattice}");
        for shell in 1..lattice.shells {
            assert!(lattice.shell(shell) > lattice.shell(shell - 1), "{lattice}: shells grow");
        }
        for index in 0..lattice.sample_count() {
            let shell = index / lattice.direction_count();
            let direction = index % lattice.direction_count();
            let unit = lattice.direction(direction);
            assert!((unit.length() - 1.0).abs() < 1e-14, "{lattice}: direction {direction}");
            let position = lattice.position(index);
            assert!((position - lattice.shell(shell) * unit).length() < 1e-12 * lattice.outer, "{lattice}");
        }
    }
}

/// The space of a fitted lattice is that of a round one: the same weights at the mapped place.
#[test]
fn fitted_lattices_are_round_ones_in_their_own_space() {
    let round: Lattice = "cube:6x5,inner=0.4".parse().unwrap();
    let fitted = Lattice { fit: Some(Fit { centre: [0.125, -0.25, 0.0], stretch: [1.0, 1.5, 1.25] }), ..round };
    let mut rng = Rng::with_seed(11);
    for _ in 0..300 {
        let q = random_direction(&mut rng) * 10.0 * rng.f64();
        let p = DVec3::new(q.x + 0.125, q.y / 1.5 - 0.25, q.z / 1.25);
        assert!((fitted.distance(p) - q.length()).abs() < 1e-12);
        let (a, b) = (fitted.corners(p), round.corners(q));
        assert_eq!(a.index, b.index, "{p}");
        assert!(a.weight.iter().zip(b.weight).all(|(a, b)| (a - b).abs() < 1e-9), "{p}");
    }
    for index in 0..round.sample_count() {
        assert!((fitted.fit().apply(fitted.position(index)) - round.position(index)).length() < 1e-12);
    }
    // What is chosen once stays.
    let flat = Fit { centre: [0.0, 0.25, 0.0], stretch: [1.0, 1.5, 1.0] };
    let chosen = Lattice::default().fitted(flat, |fit| if *fit == flat { 0.375 } else { 9.0 });
    assert_eq!((chosen.fit(), chosen.inner, chosen.outer), (flat, 0.375, 8.0));
    assert_eq!(chosen.fitted(Fit::ROUND, |_| 0.5), chosen);
    assert_eq!(fitted.fitted(flat, |_| 0.5), fitted);
    assert_eq!(round.fitted(flat, |_| 0.5).fit(), Fit::ROUND, "a first shell of its own");
}

#[test]
fn warp_and_unwarp_are_inverse_and_near_equal_angles() {
    assert!((CELL_WARP.iter().sum::<f64>() - 1.0).abs() < 1e-15, "s = 1 is u = 1");
    for i in -1000..=1000 {
        let u = f64::from(i) / 1000.0;
        assert!((warp(unwarp(u)) - u).abs() < 1e-14, "{u}");
        assert!((warp(u) - 4.0 / PI * u.atan()).abs() < 4.3e-3, "{u}: the documented distance from the arctangent");
    }
}

#[test]
fn cap_of_the_bounding_sphere() {
    for (d, half_angle) in [(1.0, 90.0), (2.0, 30.0), (2.0_f64.sqrt(), 45.0), (0.5, 150.0), (0.0, 180.0)] {
        let c = f64::to_radians(half_angle).cos();
        assert!((cap_cosine(d) - c).abs() < 1e-12 && (cap_height(d) - (1.0 - c)).abs() < 1e-12, "{d}");
    }
    // Far away 1 - c is 1/(2 d^2); the plain difference would have lost every digit.
    assert!((cap_height(1e7) * 2e14 - 1.0).abs() < 1e-12);
}

#[test]
fn shells_of_a_roomy_object_are_dense_from_the_first_on() {
    let roomy = Lattice { inner: 0.4, ..Lattice::default() };
    let radii: Vec<f64> = (0..roomy.shells).map(|i| roomy.shell(i)).collect();
    assert!((radii[0] - 0.4).abs() < 1e-12 && (radii[radii.len() - 1] - 8.0).abs() < 1e-9, "{radii:?}");
    // No gap is wider than in proportion to the distance, and none collapses at d = 1, where nothing happens.
    for pair in radii.windows(2) {
        assert!(pair[1] > pair[0] && pair[1] - pair[0] < 0.45 * pair[1], "{radii:?}");
    }
    let step_at = |d: f64| radii.windows(2).find(|p| p[1] >= d).map(|p| p[1] - p[0]).unwrap();
    assert!(step_at(1.0) > step_at(0.7) && step_at(1.0) > 0.1, "{radii:?}");
    // Where the first shell lies outside the sphere, the half-angle is the sphere's own.
    let outside = Lattice { inner: OUTSIDE_INNER, ..Lattice::default() };
    for d in [1.02, 1.5, 3.0, 9.0] {
        assert!((outside.reach(d) - d).abs() < 1e-12);
        assert!(roomy.reach(d) >= d && roomy.scale(d) > 0.0);
    }
    assert!((roomy.reach(0.4) - 1.0).abs() < 1e-12);
}

#[test]
fn unscale_undoes_scale_and_falls_off() {
    for lattice in lattices() {
        for shell in 0..lattice.shells {
            let d = lattice.shell(shell).clamp(lattice.inner, lattice.outer);
            assert!((lattice.unscale(d) * lattice.scale(d) - 1.0).abs() < 1e-12, "{lattice}, shell {shell}");
        }
        let limit = lattice.unscale(lattice.outer);
        for factor in [1.0, 1.001, 2.0, 17.0, 1e5] {
            let ratio = lattice.unscale(factor * lattice.outer) / limit;
            assert!((ratio * factor * factor - 1.0).abs() < 1e-12, "{lattice}: {factor} times the last shell");
        }
        // Inside the first shell the first shell holds.
        assert_eq!(lattice.unscale(0.0), lattice.unscale(lattice.inner), "{lattice}");
    }
}

#[test]
fn text_form_round_trips() {
    let mut all = lattices();
    all.push(Lattice::default());
    all.push(Lattice { inner: 0.1 + 0.2, outer: 1e3 / 7.0, ..Lattice::default() });
    for lattice in all {
        let text = lattice.to_string();
        let back: Lattice = text.parse().unwrap_or_else(|error| panic!("{text}: {error}"));
        assert_eq!(back, lattice, "{text}");
    }
    let short: Lattice = "cube:20x7,edges=auto".parse().unwrap();
    assert_eq!(short, Lattice::default(), "the documented default");
}

#[test]
fn bad_lattices_are_refused() {
    // Between bars.
    let texts = "\
        |cube|cube:|cube:16|cube:16x8x8|latlon:8x4x4|cube:0x7|cube:16x0|cube:16x8|cube:-1x7|cube:1e3x7|\
        cube:16x7,foo|cube:16x7,inner|cube:16x7,inner=|cube:16x7,inner=-0.5|cube:16x7,inner=9|cube:16x7,inner=8|\
        cube:16x7,outer=nan|cube:16x7,outer=inf|cube:16x7,inner=nan|cube:16x7,outer=20000|cube:16x7,outer=0|\
        cube:1000x101|cube:5000x1|cube:4294967295x4294967295|cube:1x4294967295|cube:1x2147483647|cube:16x7,,|\
        cube:16x7 ,edges";
    for text in texts.split('|') {
        let outcome = std::panic::catch_unwind(|| text.parse::<Lattice>());
        let refused = outcome.unwrap_or_else(|_| panic!("\"{text}\" panics instead of being refused"));
        let message = refused.expect_err(text);
        assert!(!message.is_empty() && !message.contains('\n'), "{text}: one line, not {message:?}");
    }
}

#[test]
fn first_shell_follows_the_shape() {
    let lattice = |mesh: Mesh| bake::header(&mesh, FieldKind::Occlusion, &bake::Options::default()).lattice;
    let first = |mesh| lattice(mesh).inner;
    assert_eq!(first(generate::sphere(3.0, 3)), OUTSIDE_INNER);
    assert_eq!(first(generate::torus(1.0, 0.3, 24, 12)), 0.25, "room up to the centre");
    // A box of 4 x 1 x 2: its middle is the shells', its short edges are stretched by half their proportions.
    let slab = lattice(generate::cuboid(glam::Vec3::new(4.0, 1.0, 2.0), 2));
    assert_eq!((slab.fit().stretch, slab.outer), ([1.0, 2.0, 1.421875], 8.0));
    // Half an edge of 1 in bounding radii of sqrt 21 / 2, stretched by 2.
    assert!((slab.inner - 2.0 / 21.0_f64.sqrt()).abs() < 1e-6, "{}", slab.inner);
    // A cube's faces stand 1 / sqrt 3 of the bounding radius from the centre.
    let cube = first(generate::cuboid(glam::Vec3::ONE, 2));
    assert!((cube - 3.0_f64.sqrt().recip()).abs() < 1e-6, "{cube}");
}
