//! The lattice: sample points, weights, continuity, fall-off, text form. Seeds are fixed; "exactly" means f64 rounding.

#[path = "common/generate.rs"]
mod generate;
use fastrand::Rng;
use glam::DVec3;
use shadow_fields::bake;
use shadow_fields::field::lattice::{
    CELL_WARP, Directions, OUTSIDE_INNER, Spacing, cap_cosine, cap_height, unwarp, warp,
};
use shadow_fields::field::{FieldHeader, FieldKind, Fit, Lattice, Lookup, ShadowField, Storage};
use std::f64::consts::{PI, TAU};

/// A few f64 roundings, widened by the steepest slope of a shell coordinate (some hundreds a unit of distance).
const ROUNDING: f64 = 1e-9;

const LOOKUPS: [Lookup; 3] = [Lookup::Nearest, Lookup::Radial, Lookup::Trilinear];

/// Every spacing, both arrangements, both ways to store, one shell, one cell, both first shells that a bake takes.
fn lattices() -> Vec<Lattice> {
    [
        "cube:16x8,inner=1.02",
        "cube:16x8,inner=0.25",
        "cube:6x5,log,raw,inner=0.2",
        "cube:5x4,linear,scaled,inner=0.5,outer=3.5",
        "cube:1x3,inner=1.5,outer=4",
        "cube:2x1,inner=0.25",
        "cube:5x4,edges,linear,scaled,inner=0.5,outer=3.5",
        "cube:2x1,edges,log,inner=0.25",
        "latlon:8x4x4,linear,raw,inner=0.2",
        "latlon:3x1x1,inner=1.02",
        "latlon:4x5x7,log,inner=0.3",
    ]
    .map(|text| text.parse().unwrap_or_else(|error| panic!("{error}")))
    .to_vec()
}

fn unit(rng: &mut Rng) -> DVec3 {
    loop {
        let v = DVec3::from_array([0; 3].map(|_| 2.0 * rng.f64() - 1.0));
        if (0.01..1.0).contains(&v.length_squared()) {
            return v.normalize();
        }
    }
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

fn interpolate(lattice: &Lattice, stored: &[f64], position: DVec3, lookup: Lookup) -> f64 {
    let corners = lattice.corners(position, lookup);
    (0..8).map(|k| corners.weight[k] * stored[corners.index[k] as usize]).sum()
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
fn default_counts() {
    // Samples on the edges of faces, a row and column more than cells; or in cells' centres, with a border of copies around.
    for (edges, side) in [(Some(true), 9), (Some(false), 7)] {
        let lattice = Lattice { edges, ..Lattice::default() };
        assert_eq!((lattice.sample_count(), lattice.stored_count()), (18 * 6 * side * side, 18 * 6 * 9 * 9));
        assert_eq!(lattice.sources().len() as u32, lattice.stored_direction_count());
    }
}

#[test]
fn faces_share_the_samples_on_their_edges() {
    for cells in [1, 2, 7, 8] {
        let lattice: Lattice = format!("cube:3x{cells},edges,inner=0.5").parse().unwrap();
        let columns = cells + 2;
        assert_eq!(
            (lattice.direction_count(), lattice.stored_direction_count()),
            (6 * columns * columns, 6 * columns * columns)
        );
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
            assert!(
                around.iter().all(|b| (0.6 * step..1.3 * step).contains(&apart(b).to_degrees())),
                "{cells}: {a} {around:?}"
            );
            let corner = lattice.direction(a).abs().min_element() > 0.577;
            for pair in around.chunks_exact(2) {
                let [u, v] = [pair[0], pair[1]].map(|b| lattice.direction(b) - lattice.direction(a));
                let angle = u.angle_between(v).to_degrees();
                assert!(angle > 95.0, "{cells}: {a} {pair:?}: {angle}");
            }
            assert!(
                corner || (0..4).all(|i| around[i + 1..].iter().all(|b| *b != around[i])),
                "{cells}: {a} {around:?}"
            );
        }
    }
    let chosen: Lattice = "cube:6x5,edges".parse().unwrap();
    assert_eq!((chosen.edges, chosen.to_string()), (Some(true), "cube:6x5,chord,scaled,outer=8,edges".to_owned()));
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
            let (shell, direction) = (index / lattice.direction_count(), index % lattice.direction_count());
            let unit = lattice.direction(direction);
            assert!((unit.length() - 1.0).abs() < 1e-14, "{lattice}: direction {direction}");
            let position = lattice.position(index);
            assert!((position.length() - lattice.shell(shell)).abs() < 1e-12 * lattice.outer, "{lattice}");
            assert!((position - lattice.shell(shell) * unit).length() < 1e-12 * lattice.outer, "{lattice}");
        }
    }
}

/// The space of a fitted lattice is that of a round one: the same weights at the mapped place.
#[test]
fn fitted_lattices_are_round_ones_in_their_own_space() {
    let round: Lattice = "cube:6x5,inner=0.4".parse().unwrap();
    let fitted: Lattice = "cube:6x5,inner=0.4,centre=0.125:-0.25:0,stretch=1:1.5:1.25".parse().unwrap();
    let mut rng = Rng::with_seed(11);
    for _ in 0..300 {
        let q = unit(&mut rng) * 10.0 * rng.f64();
        let p = DVec3::new(q.x + 0.125, q.y / 1.5 - 0.25, q.z / 1.25);
        assert!((fitted.distance(p) - q.length()).abs() < 1e-12);
        let (a, b) = (fitted.corners(p, Lookup::Trilinear), round.corners(q, Lookup::Trilinear));
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
    let round_by_word: Lattice = "cube:6x5,round".parse().unwrap();
    assert_eq!(round_by_word.fitted(flat, |_| 0.5).fit(), Fit::ROUND);
    for text in [chosen.to_string(), fitted.to_string(), round.to_string(), round_by_word.to_string()] {
        assert_eq!(text.parse::<Lattice>().unwrap().to_string(), text);
    }
    for text in ["cube:6x5,stretch=1:3:1", "cube:6x5,stretch=1:1", "cube:6x5,centre=2:0:0", "cube:6x5,centre=a:0:0"] {
        text.parse::<Lattice>().expect_err(text);
    }
}

#[test]
fn directions_cover_the_sphere_evenly() {
    // The mean of an odd function vanishes by symmetry; that of x^2 is 1/3 only when cells are nearly equal.
    let lattice: Lattice = "cube:2x8,inner=1.02".parse().unwrap();
    let count = lattice.direction_count();
    let all: Vec<DVec3> = (0..count).map(|i| lattice.direction(i)).collect();
    assert!(all.iter().sum::<DVec3>().length() < 1e-12);
    let nearest = |v: DVec3| all.iter().map(|w| w.angle_between(v)).fold(f64::MAX, f64::min);
    let mut rng = Rng::with_seed(1);
    let farthest = (0..2000).map(|_| nearest(unit(&mut rng))).fold(0.0, f64::max);
    // Cells of 90 / 8 = 11.25 degrees: half a diagonal is 8 degrees at a face's centre.
    assert!(farthest < 8.5_f64.to_radians(), "{} degrees from the nearest sample", farthest.to_degrees());
    for (i, a) in all.iter().enumerate() {
        let near =
            all.iter().enumerate().filter(|(k, _)| *k != i).map(|(_, b)| a.angle_between(*b)).fold(4.0, f64::min);
        assert!(near > 5.0_f64.to_radians(), "sample {i} has a neighbour {} degrees away", near.to_degrees());
    }
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
fn weights_are_convex_everywhere() {
    let mut rng = Rng::with_seed(2);
    for lattice in lattices() {
        let radial = (0..3000).map(|_| unit(&mut rng) * 10.0_f64.powf(3.0 * rng.f64() - 1.5));
        let far = [DVec3::ZERO, DVec3::splat(1e-300), DVec3::splat(-1e6), DVec3::new(1e6, 0.0, 0.0), -1e6 * DVec3::Y];
        let axes = [DVec3::X, DVec3::Y, DVec3::Z].into_iter().flat_map(|v| [v, -v, 3.0 * v, -0.3 * v]);
        let corners = (0..8).map(|k| DVec3::new(1.0, f64::from(k & 2) - 1.0, f64::from((k & 1) * 2) - 1.0));
        let edges = [DVec3::new(1.0, 1.0, 0.0), DVec3::new(0.0, -1.0, 1.0), DVec3::new(-2.0, 0.3, 2.0)];
        for position in radial.chain(far).chain(axes).chain(corners).chain(edges) {
            for lookup in LOOKUPS {
                let found = lattice.corners(position, lookup);
                assert!(found.weight.iter().all(|w| *w >= 0.0 && w.is_finite()), "{lattice} {position} {found:?}");
                assert!((found.weight.iter().sum::<f64>() - 1.0).abs() < ROUNDING, "{lattice} {position} {found:?}");
                assert!(found.index.iter().all(|i| *i < lattice.stored_count()), "{lattice} {position} {found:?}");
            }
            let unscale = lattice.unscale(position.length());
            assert!(unscale.is_finite() && unscale >= 0.0, "{lattice} {position}");
        }
    }
}

#[test]
fn a_sample_point_gives_its_sample() {
    let mut rng = Rng::with_seed(3);
    for lattice in lattices() {
        let captured = noise(&lattice, &mut rng);
        let stored = store(&lattice, &captured);
        for index in 0..lattice.sample_count() {
            for lookup in LOOKUPS {
                let value = interpolate(&lattice, &stored, lattice.position(index), lookup);
                let wanted = captured[index as usize];
                assert!(
                    (value - wanted).abs() < ROUNDING,
                    "{lattice} {lookup:?} sample {index}: {value}, not {wanted}"
                );
            }
        }
    }
}

#[test]
fn nearest_takes_a_near_sample() {
    let mut rng = Rng::with_seed(4);
    let lattice: Lattice = "cube:16x8,inner=1.02".parse().unwrap();
    let directions: Vec<DVec3> = (0..lattice.direction_count()).map(|i| lattice.direction(i)).collect();
    let index: Vec<f64> = (0..lattice.sample_count()).map(f64::from).collect();
    let stored = store(&lattice, &index);
    let mut wrong = 0;
    for _ in 0..2000 {
        let direction = unit(&mut rng);
        let position = direction * (1.02 * (8.0_f64 / 1.02).powf(rng.f64()));
        // A corner of a border holds a mean: there the value is no index, and any of the three is as near.
        let value = interpolate(&lattice, &stored, position, Lookup::Nearest);
        let sample = value.round() as u32 % lattice.direction_count();
        let best = directions.iter().map(|d| d.angle_between(direction)).fold(4.0, f64::min);
        // Nearest in the cell coordinate, which the projection skews: it may take a sample a little farther away.
        wrong += usize::from(directions[sample as usize].angle_between(direction) > best + 2.5_f64.to_radians());
    }
    assert!(wrong <= 20, "{wrong} of 2000 lookups took a far sample");
}

#[test]
fn shells_of_a_roomy_object_are_dense_from_the_first_on() {
    let roomy = Lattice::default().starting_at(0.4);
    let radii: Vec<f64> = (0..roomy.shells).map(|i| roomy.shell(i)).collect();
    assert!((radii[0] - 0.4).abs() < 1e-12 && (radii[radii.len() - 1] - 8.0).abs() < 1e-9, "{radii:?}");
    // No gap is wider than what is in proportion to the distance, and none collapses where d = 1, where nothing happens.
    for pair in radii.windows(2) {
        assert!(pair[1] > pair[0] && pair[1] - pair[0] < 0.45 * pair[1], "{radii:?}");
    }
    let step_at = |d: f64| radii.windows(2).find(|p| p[1] >= d).map(|p| p[1] - p[0]).unwrap();
    assert!(step_at(1.0) > step_at(0.7) && step_at(1.0) > 0.1, "{radii:?}");
    // Where the first shell lies outside the sphere, the half-angle is the sphere's own.
    let outside = Lattice::default().starting_at(OUTSIDE_INNER);
    for d in [1.02, 1.5, 3.0, 9.0] {
        assert!((outside.reach(d) - d).abs() < 1e-12);
        assert!(roomy.reach(d) >= d && roomy.scale(d) > 0.0);
    }
    assert!((roomy.reach(0.4) - 1.0).abs() < 1e-12);
}

#[test]
fn linear_in_the_shell_coordinate_is_exact() {
    let mut rng = Rng::with_seed(5);
    for lattice in lattices() {
        let captured: Vec<f64> =
            (0..lattice.sample_count()).map(|i| 3.0 - 0.25 * f64::from(i / lattice.direction_count())).collect();
        let stored = store(&lattice, &captured);
        let (slope, offset) = lattice.radial_map();
        for _ in 0..500 {
            let d = lattice.inner + (lattice.outer - lattice.inner) * rng.f64();
            let wanted = 3.0 - 0.25 * (slope * lattice.coordinate(d) + offset);
            for lookup in [Lookup::Radial, Lookup::Trilinear] {
                let value = interpolate(&lattice, &stored, d * unit(&mut rng), lookup);
                assert!((value - wanted).abs() < ROUNDING, "{lattice} {d}: {value}, not {wanted}");
            }
        }
    }
}

/// Walks from direction to direction and through the shells; the stored values are noise in [0, 1], so that a wrong border
/// shows as a jump of the size of the noise.
///
/// Bound: along one axis of a cell an interpolated value changes by at most the cell coordinate's change times the range of
/// the values, 1. A step of angle h moves s or t by at most h sqrt((1 + s^2)(1 + s^2 + t^2)) <= h sqrt 6, u by 4/pi times
/// that, and a cell coordinate by cells / 2 times that again; there are two such axes. The shell coordinate and the unscale
/// factor are computed.
#[test]
fn interpolation_is_continuous() {
    let mut rng = Rng::with_seed(6);
    for lattice in lattices() {
        let Directions::Cube { cells } = lattice.directions else { continue };
        let steps_of_row = if lattice.has_edges() { cells + 1 } else { cells };
        let stored = store(&lattice, &noise(&lattice, &mut rng));
        let (slope, offset) = lattice.radial_map();
        let last = f64::from(lattice.shells - 1);
        let shell_at = |d: f64| (slope * lattice.coordinate(d) + offset).clamp(0.0, last);
        let at = |p: DVec3| interpolate(&lattice, &stored, p, Lookup::Trilinear) * lattice.unscale(p.length());
        let mut paths: Vec<(DVec3, DVec3)> = (0..12).map(|_| (unit(&mut rng), unit(&mut rng))).collect();
        // Across corners, along edges, and along them on either side.
        paths.push((DVec3::new(1.0, 1.0, 0.9), DVec3::new(1.0, 1.0, 1.2)));
        paths.push((DVec3::new(1.0, 0.9, 0.8), DVec3::new(0.8, 1.0, 1.1)));
        paths.push((DVec3::new(-1.0, 1.0, -1.0), DVec3::new(1.0, 1.0, 1.0)));
        paths.push((DVec3::new(1.0, -1.0 + 1e-9, -0.9), DVec3::new(1.0, -1.0 - 1e-9, 0.9)));
        let (mut largest, mut steps) = (0.0_f64, 0);
        for (from, to) in paths {
            // The distance swings from inside the first shell to beyond the last.
            let radius = |f: f64| (lattice.outer * 1.5 * (0.5 - 0.5 * (3.0 * TAU * f).cos())).max(0.2 * lattice.inner);
            let (from, to) = (from.normalize(), to.normalize());
            let count = 20_000;
            let point = |i: u32| {
                let f = f64::from(i) / f64::from(count);
                radius(f) * from.lerp(to, f).normalize()
            };
            let (mut before, mut value) = (point(0), at(point(0)));
            for i in 1..=count {
                let next = point(i);
                let (d0, d1) = (before.length(), next.length());
                let angle = before.cross(next).length().atan2(before.dot(next));
                let cell = 2.0 * f64::from(steps_of_row) / 2.0 * 4.0 / PI * 6.0_f64.sqrt() * angle;
                let shell = (shell_at(d1) - shell_at(d0)).abs();
                let (u0, u1) = (lattice.unscale(d0), lattice.unscale(d1));
                let bound = (cell + shell) * u0.max(u1) + (u1 - u0).abs() + 1e-12;
                let now = at(next);
                assert!(
                    (now - value).abs() <= bound,
                    "{lattice}: {before} to {next} jumps by {}, bound {bound}",
                    (now - value).abs()
                );
                // At d = 1 the chord coordinate is continuous but infinitely steep.
                if (d0 - 1.0).abs() > 0.05 {
                    largest = largest.max(bound / u0.max(u1));
                }
                steps += 1;
                (before, value) = (next, now);
            }
        }
        assert!(steps > 100_000, "{steps}");
        // The test is worth something only where the bound is far below the noise.
        assert!(largest < 0.3, "{lattice}: a bound of {largest} would let a jump pass");
    }
}

#[test]
fn longitudes_wrap() {
    let mut rng = Rng::with_seed(7);
    let lattice: Lattice = "latlon:4x5x7,log,inner=0.3".parse().unwrap();
    let captured = noise(&lattice, &mut rng);
    let stored = store(&lattice, &captured);
    let at = |polar: f64, azimuth: f64| {
        let p = DVec3::new(polar.sin() * azimuth.cos(), polar.cos(), polar.sin() * azimuth.sin());
        interpolate(&lattice, &stored, 1.3 * p, Lookup::Trilinear)
    };
    for polar in [0.2, 1.0, 1.6, 3.0] {
        let count = 40_000;
        let mut before = at(polar, 0.0);
        for i in 1..=count {
            let value = at(polar, TAU * f64::from(i) / f64::from(count));
            // Seven cells around: a step is 7 / count of a cell, times the noise's range of 1.
            assert!((value - before).abs() < 7.0 / f64::from(count) + 1e-9, "polar {polar}, step {i}");
            before = value;
        }
        assert!((before - at(polar, 0.0)).abs() < 1e-9, "once around");
    }
    // Halfway between the last longitude and the first.
    let ring = lattice.direction_count() + 2 * 7;
    let inner_shell = lattice.shell(1);
    let (polar, azimuth) = (2.5 * PI / 5.0, 6.5 * TAU / 7.0);
    let p = DVec3::new(polar.sin() * azimuth.cos(), polar.cos(), polar.sin() * azimuth.sin());
    let mean = (captured[ring as usize + 6] + captured[ring as usize]) / 2.0;
    assert!((interpolate(&lattice, &stored, inner_shell * p, Lookup::Trilinear) - mean).abs() < ROUNDING);
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
    let short: Lattice = "cube:18x7,edges=auto".parse().unwrap();
    assert_eq!(short, Lattice::default(), "the documented default");
    assert_eq!(short.starting_at(OUTSIDE_INNER).inner, OUTSIDE_INNER);
    assert_eq!(short.starting_at(0.5).starting_at(0.7).inner, 0.5, "chosen once");
}

#[test]
fn bad_lattices_are_refused() {
    for text in [
        "",
        "cube",
        "cube:",
        "cube:16",
        "cube:16x8x8",
        "latlon:8x4",
        "sphere:16x8",
        "cube:0x8",
        "cube:16x0",
        "latlon:8x0x4",
        "latlon:8x4x0",
        "cube:-1x8",
        "cube:1e3x8",
        "cube:16x8,foo",
        "cube:16x8,inner",
        "cube:16x8,inner=",
        "cube:16x8,inner=-0.5",
        "cube:16x8,inner=9",
        "cube:16x8,inner=8",
        "cube:16x8,outer=nan",
        "cube:16x8,outer=inf",
        "cube:16x8,inner=nan",
        "cube:16x8,outer=20000",
        "cube:16x8,outer=0",
        "cube:1000x100",
        "cube:5000x1",
        "cube:4294967295x4294967295",
        "cube:1x4294967295",
        "cube:1x2147483648",
        "latlon:4294967295x4294967295x4294967295",
        "latlon:1x65536x65536",
        "cube:16x8,,",
        "cube:16x8 ,log",
    ] {
        let outcome = std::panic::catch_unwind(|| text.parse::<Lattice>());
        let refused = outcome.unwrap_or_else(|_| panic!("\"{text}\" panics instead of being refused"));
        let message = refused.expect_err(text);
        assert!(!message.is_empty() && !message.contains('\n'), "{text}: one line, not {message:?}");
    }
}

#[test]
fn first_shell_follows_the_shape() {
    let first = |mesh: &shadow_fields::asset::Mesh| {
        bake::header(mesh, FieldKind::Occlusion, &bake::Options::default()).lattice.inner
    };
    assert_eq!(first(&generate::sphere(3.0, 3)), OUTSIDE_INNER);
    assert_eq!(first(&generate::torus(1.0, 0.3, 24, 12)), 0.25, "room up to the centre");
    // A box of 4 x 1 x 2: its middle is the shells', its short edges are stretched by half their proportions.
    let slab = bake::header(
        &generate::cuboid(glam::Vec3::new(4.0, 1.0, 2.0), 2),
        FieldKind::Occlusion,
        &bake::Options::default(),
    );
    let lattice = slab.lattice;
    assert_eq!((lattice.fit().stretch, lattice.outer), ([1.0, 2.0, 1.421875], 8.0));
    // Half an edge of 1 in bounding radii of sqrt 21 / 2, stretched by 2.
    assert!((lattice.inner - 2.0 / 21.0_f64.sqrt()).abs() < 1e-6, "{}", lattice.inner);
    // A cube's faces stand 1 / sqrt 3 of the bounding radius from the centre.
    let cube = first(&generate::cuboid(glam::Vec3::ONE, 2));
    assert!((cube - 3.0_f64.sqrt().recip()).abs() < 1e-6, "{cube}");
}

#[test]
fn lookup_of_a_field_is_the_lattice_and_the_factor() {
    let mut rng = Rng::with_seed(8);
    let lattice: Lattice = "cube:4x3,inner=1.02".parse().unwrap();
    let captured = noise(&lattice, &mut rng);
    let stored = store(&lattice, &captured);
    let header = FieldHeader {
        lattice,
        ..bake::header(&generate::sphere(1.0, 1), FieldKind::Radiance, &bake::Options::default())
    };
    let header = FieldHeader { bands: 2, storage: Storage::F32, radiance_scale: 2.5, ..header };
    // Channel and coefficient as multiples of the value, so that a swapped index shows.
    let payload = stored
        .iter()
        .flat_map(|v| (0..12).map(move |k| (v * f64::from(k + 1)) as f32))
        .flat_map(f32::to_le_bytes)
        .collect();
    let field = ShadowField { header, payload };
    assert_eq!(field.header.payload_bytes(), field.payload.len() as u64);
    for _ in 0..300 {
        let position = unit(&mut rng) * (0.3 + 12.0 * rng.f64());
        for lookup in LOOKUPS {
            for channel in 0..3 {
                let mut out = [0.0; 4];
                field.lookup(position, lookup, channel, &mut out);
                let value = 2.5 * interpolate(&lattice, &stored, position, lookup) * lattice.unscale(position.length());
                for (k, found) in out.into_iter().enumerate() {
                    let wanted = value * (4 * channel + k + 1) as f64;
                    assert!((found - wanted).abs() < 1e-6 * wanted.abs() + 1e-9, "{position}: {found}, not {wanted}");
                }
            }
        }
    }
}

#[test]
fn spacings_agree_with_their_definition() {
    for d in [0.3, 1.0, 1.7, 8.0] {
        assert_eq!(Spacing::Linear.coordinate(d), d);
        assert!((Spacing::Log.coordinate(d) - f64::ln(d)).abs() < 1e-15);
        let half_angle = cap_cosine(d).acos();
        assert!((Spacing::Chord.coordinate(d) - (half_angle / 2.0).sin()).abs() < 1e-12, "{d}");
    }
}
