//! Data that a program hands to the library: whatever the numbers are, nothing panics, and what is refused is one line.

use glam::Vec3;
use shadow_fields::Error;
use shadow_fields::asset::{Mesh, picture};
use shadow_fields::scene::Scene;
use std::path::Path;

/// Numbers at and beyond every edge.
const ODD: [&str; 15] = [
    "nan", "inf", "-inf", "3.4e38", "-3.4e38", "1.2e-38", "1e-45", "0", "-0.0", "-1", "1e-7", "1e7", "1e15", "2", "2.5",
];

/// One line, where something is refused.
fn one_line<T>(outcome: Result<T, Error>) -> Option<T> {
    outcome.map_err(|error| assert!(!error.to_string().contains('\n'), "{error}")).ok()
}

/// Every number of a scene that has all keys becomes each of these, and all is asked of what is read that needs no
/// device. Scenes made in code go by the same rules: `tests/gpu/renderer.rs`.
#[test]
fn scenes_of_odd_numbers_are_read_or_refused_in_one_line() {
    let text = include_str!("../fuzz/corpus/toml/all_keys.toml");
    let files = tempfile::tempdir().unwrap();
    let sky = files.path().join("sky.exr");
    picture::write_exr(&sky, 4, 2, &[0.5; 24]).unwrap();
    let read = |path: &Path| match path.extension().and_then(|ending| ending.to_str()) {
        Some("obj") => Ok(b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n".to_vec()),
        _ => Ok(std::fs::read(&sky).unwrap()),
    };
    let is_part = |c: char| c.is_ascii_digit() || c == '.' || c == '-';
    let begins = |at: &usize| text[*at..].starts_with(is_part) && text[..*at].ends_with([' ', '[']);
    let mut outcomes = [0; 2];
    for at in (0..text.len()).filter(begins) {
        let end = text[at..].find(|c| !is_part(c)).map_or(text.len(), |length| at + length);
        for odd in ODD {
            let changed = format!("{}{odd}{}", &text[..at], &text[end..]);
            let scene = one_line(Scene::parse(&changed, Path::new("odd.toml"), &read));
            outcomes[usize::from(scene.is_some())] += 1;
            let Some(scene) = scene else { continue };
            for time_s in [0.0, -1e9, 1e9, f64::NAN, f64::INFINITY, f64::MAX] {
                assert_eq!(scene.at(time_s).len(), scene.entities.len());
            }
            assert!(scene.at(0.0).iter().all(|placement| placement.position.is_finite()));
            scene.environment.coefficients(4);
            scene.data.camera.up();
            one_line(scene.to_toml());
        }
    }
    assert!(outcomes.iter().all(|count| *count > 300), "refused and read: {outcomes:?}");
}

#[test]
fn a_mesh_refuses_arrays_that_do_not_fit() {
    let corners = vec![Vec3::ZERO, Vec3::X, Vec3::Y];
    let up = vec![Vec3::Z; 3];
    let mesh = |positions: &[Vec3], normals: &[Vec3], colors: Option<Vec<Vec3>>, triangle| {
        one_line(Mesh::new("m", positions.to_vec(), normals.to_vec(), colors, vec![triangle])).is_some()
    };
    assert!(mesh(&corners, &up, Some(up.clone()), [0, 1, 2]));
    assert!(!mesh(&corners, &up, None, [0, 1, 3]), "a corner that there is not");
    assert!(!mesh(&corners, &up, None, [0, 1, u32::MAX]), "a corner far beyond");
    assert!(!mesh(&corners, &up, Some(vec![Vec3::ONE; 2]), [0, 1, 2]), "too few colours");
    assert!(!mesh(&corners, &up[..2], None, [0, 1, 2]), "too few normals");
    assert!(!mesh(&[], &[], None, [0, 1, 2]), "no positions");
    for x in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let odd = vec![Vec3::splat(x); 3];
        assert!(!mesh(&odd, &up, None, [0, 1, 2]), "positions {x}");
        assert!(!mesh(&corners, &up, Some(odd), [0, 1, 2]), "colours {x}");
    }
}

#[test]
fn pictures_of_the_wrong_length_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("p.png");
    for (size, count) in [([2, 2], 11), ([2, 2], 13), ([0, 5], 3), ([u32::MAX, u32::MAX], 12), ([2, 2], 0)] {
        let [width, height] = size;
        let numbers = vec![0.5; count];
        for outcome in [
            picture::write_png(&path, width, height, &numbers, 0.0),
            picture::write_exr(&path, width, height, &numbers),
            picture::write_apng(&path, width, height, vec![Ok(vec![0; count])].into_iter(), 24),
        ] {
            let error = outcome.unwrap_err();
            assert!(error.to_string().contains("p.png") && !error.to_string().contains('\n'), "{error}");
        }
        assert!(!path.exists());
    }
}
