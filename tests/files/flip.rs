//! FLIP against the authors' flip-evaluator 1.7 (LDR, 0.7 m from 3840 pixels on 0.7 m), and what its paper states.

use shadow_fields::truth::flip::flip;

const WIDTH: usize = 64;
const HEIGHT: usize = 48;

fn mean_flip(width: usize, a: &[f32], b: &[f32]) -> f64 {
    let map = flip(width, a, b);
    map.iter().sum::<f64>() / map.len() as f64
}

/// A picture in linear RGB from a function of column and row.
fn picture(of: impl Fn(i32, i32) -> [f64; 3]) -> Vec<f32> {
    let pixel = |i: usize| of((i % WIDTH) as i32, (i / WIDTH) as i32);
    (0..WIDTH * HEIGHT).flat_map(pixel).map(|c| c as f32).collect()
}

fn ramp(x: i32, y: i32) -> [f64; 3] {
    [f64::from(x) / 63.0, f64::from(y) / 47.0, 0.5]
}

/// The ramp with a disc of half its light.
fn disc(x: i32, y: i32) -> [f64; 3] {
    let within = (x - 32).pow(2) + (y - 24).pow(2) < 100;
    ramp(x, y).map(|c| if within { 0.5 * c } else { c })
}

fn checker(shift: i32) -> impl Fn(i32, i32) -> [f64; 3] {
    move |x, y| [if ((x + shift) / 4 + y / 4) % 2 == 1 { 0.8 } else { 0.2 }; 3]
}

fn noise(x: i32, y: i32) -> [f64; 3] {
    [0, 1, 2].map(|c| f64::from((x * 73 + y * 151 + c * 57) % 101) / 100.0)
}

#[test]
fn the_authors_program_finds_the_same() {
    let flat = |rgb: [f64; 3]| picture(|_, _| rgb);
    // Mean, and the pixels (0, 0), (32, 24), (42, 24) and (20, 30).
    let cases = [
        ("disc", picture(ramp), picture(disc), 0.0744266, [0.0, 0.5340492, 0.3567393, 0.0408250]),
        ("shift", picture(checker(0)), picture(checker(1)), 0.2023703, [0.0568688, 0.1744737, 0.1744740, 0.3421865]),
        ("hues", flat([0.0, 1.0, 0.0]), flat([0.0, 0.0, 1.0]), 1.0, [1.0; 4]),
        ("greys", flat([0.2; 3]), flat([0.25; 3]), 0.1834105, [0.1834094; 4]),
        ("noise", picture(noise), picture(ramp), 0.7454832, [0.9643761, 0.2940456, 0.3923472, 0.5696423]),
        ("dark", flat([0.001; 3]), flat([0.008; 3]), 0.2092289, [0.2092317; 4]),
        ("black", flat([0.0; 3]), flat([1.0; 3]), 0.9673653, [0.9673883; 4]),
    ];
    for (name, a, b, mean, pixels) in cases {
        let found = flip(WIDTH, &a, &b);
        // The program computes in f32, and its kernels are split in another way.
        let near = |found: f64, expected: f64| (found - expected).abs() < 1e-3;
        assert!(near(mean_flip(WIDTH, &a, &b), mean), "{name}: {} not {mean}", mean_flip(WIDTH, &a, &b));
        for ([x, y], expected) in [[0, 0], [32, 24], [42, 24], [20, 30]].into_iter().zip(pixels) {
            let found = found[y * WIDTH + x];
            assert!(near(found, expected), "{name} at {x}, {y}: {found} not {expected}");
        }
    }
}

#[test]
fn flip_is_symmetric_bounded_and_zero_of_the_same() {
    let pictures = [picture(ramp), picture(disc), picture(checker(0)), picture(noise)];
    for a in &pictures {
        for b in &pictures {
            let (there, back) = (flip(WIDTH, a, b), flip(WIDTH, b, a));
            assert_eq!(there, back);
            assert!(there.iter().all(|e| (0.0..=1.0).contains(e)));
            assert_eq!(mean_flip(WIDTH, a, b) == 0.0, a == b);
        }
    }
    let darker = |by: f64| picture(|x, y| ramp(x, y).map(|c| c * by));
    let means = [0.99, 0.9, 0.7, 0.4].map(|by| mean_flip(WIDTH, &pictures[0], &darker(by)));
    assert!(means.is_sorted() && means[0] > 0.0, "{means:?}");
}

#[test]
fn what_a_screen_cannot_show_counts_as_its_limits() {
    let odd = |x: i32, _: i32| [[7.0, -3.0, 0.5], [f64::INFINITY, f64::NAN, 0.5]][(x % 2) as usize];
    assert_eq!(mean_flip(WIDTH, &picture(odd), &picture(|_, _| [1.0, 0.0, 0.5])), 0.0);
    assert!(flip(5, &[], &[]).is_empty());
    // A picture smaller than the eye's blur.
    assert!(mean_flip(1, &[0.0; 3], &[1.0; 3]) > 0.9);
}

#[test]
#[should_panic(expected = "6")]
fn pictures_of_two_sizes_are_refused() {
    flip(1, &[0.0; 3], &[0.0; 6]);
}
