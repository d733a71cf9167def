//! Capture on the device against rays on the host: coverage, culling, faces left out, colours on the right faces.

use crate::common::{generate, gpu, joined, teapot};
use glam::{Quat, Vec3};
use shadow_fields::asset::Mesh;
use shadow_fields::bake::capture::{Capture, Model, NO_SLOT, Way};
use shadow_fields::check::capture::{self as check, capture_of, differing_limit, eyes_outside, faces};
use shadow_fields::field::FieldKind;
use std::collections::HashSet;

const FACE_PX: u32 = 32;
const WAYS: [Way; 2] = [Way::Drawn, Way::Computed];

fn tilted_plane() -> Mesh {
    let plane = generate::plane(2.0, 5);
    let turn = Quat::from_axis_angle(Vec3::new(1.0, 2.0, 3.0).normalize(), 0.7);
    let positions = plane.positions.iter().map(|p| turn * *p + Vec3::new(0.3, -4.0, 1.0)).collect();
    Mesh::new("tilted plane", positions, Vec::new(), None, plane.triangles.clone()).unwrap()
}

/// (mesh, eyes besides those outside).
fn scenes() -> Vec<(Mesh, Vec<Vec3>)> {
    let hole = vec![Vec3::ZERO, Vec3::new(0.2, 0.05, -0.1), Vec3::new(0.0, 0.3, 0.25)];
    vec![
        (generate::sphere(0.5, 3), vec![Vec3::new(0.58, -0.58, 0.58) * 1.01]),
        (generate::torus(1.0, 0.3, 48, 24), hole),
        (teapot(), vec![Vec3::new(0.0, 0.9, 0.0), Vec3::new(0.1, 0.0, 0.05)]),
        (generate::cuboid(Vec3::new(0.4, 1.0, 0.7), 2), vec![Vec3::new(0.33, 0.0, 0.1), Vec3::new(0.0, 0.82, 0.0)]),
        (tilted_plane(), vec![Vec3::new(0.01, 0.02, 0.01), Vec3::new(-0.1, 0.6, 0.1)]),
    ]
}

#[test]
fn coverage_is_what_rays_meet() {
    let Some(gpu) = gpu() else { return };
    for (mesh, more) in scenes() {
        let eyes = [eyes_outside(), more].concat();
        for way in WAYS {
            let found = check::coverage(&gpu.baker(), &mesh, &eyes, FACE_PX, way).unwrap();
            assert_eq!(found.off_edge, 0, "{}, {way:?}: texels differ where there is no edge", mesh.name);
            assert_eq!(found.left_out_wrongly, 0, "{}: a face was left out that shows the object", mesh.name);
            assert!(found.left_out > 0, "{}: no face was left out", mesh.name);
            assert!(found.error() < differing_limit(&gpu.device), "{}, {way:?}: {found:?}", mesh.name);
        }
    }
}

/// Faces that are computed in several bands of rows, of which the last has fewer.
#[test]
fn large_faces_are_computed_in_bands() {
    let Some(gpu) = gpu() else { return };
    let mesh = generate::torus(1.0, 0.3, 16, 8);
    let eyes = [Vec3::new(0.7, 0.8, -0.4), Vec3::new(0.2, 0.05, -0.1)];
    let found = check::coverage(&gpu.baker(), &mesh, &eyes, 200, Way::Computed).unwrap();
    assert!(found.error() < 1e-3, "{found:?}");
}

/// From inside a solid only back faces are seen, and culled they vanish: why no sample inside is captured.
#[test]
fn culled_from_inside_a_solid_nothing_is_left() {
    let Some(gpu) = gpu() else { return };
    let mesh = generate::cuboid(Vec3::ONE, 1);
    let eyes = [Vec3::new(0.1, 0.2, -0.1)];
    for way in WAYS {
        let covered = |cull| {
            let found = faces::<u8>(&gpu.baker(), &mesh, &eyes, (FACE_PX, FieldKind::Occlusion, cull), way).unwrap();
            assert!(found.iter().flatten().flatten().flatten().all(|texel| [0, 255].contains(texel)));
            found[0].iter().flatten().flatten().filter(|texel| **texel == 0).count()
        };
        assert_eq!(covered(true), 0, "{way:?}");
        assert_eq!(covered(false), 6 * (FACE_PX * FACE_PX) as usize, "{way:?}");
    }
}

/// Walls of a box around the origin, of one colour a direction, and a small box before one of them, in either order.
fn painted_box(inner_first: bool) -> Mesh {
    let walls = generate::cuboid(Vec3::splat(2.0), 3);
    let small = generate::cuboid(Vec3::splat(0.1), 1);
    let mut parts = [(&walls, Vec3::ZERO), (&small, Vec3::new(0.0, 0.0, 0.6))];
    if inner_first {
        parts.reverse();
    }
    let both = joined(&parts);
    let color = |(place, normal): (&Vec3, &Vec3)| {
        let is_wall = place.abs().max_element() > 0.9;
        if is_wall { (*normal + 2.0) * Vec3::new(1.0, 0.5, 4.0) } else { Vec3::new(9.0, 0.0, 0.25) }
    };
    let colors = both.positions.iter().zip(&both.normals).map(color).collect();
    Mesh::new("painted box", both.positions, Vec::new(), Some(colors), both.triangles).unwrap()
}

/// Colours of the nearest surface, as rays find them: on a mesh that hides parts of itself.
#[test]
fn colours_are_what_rays_meet() {
    let Some(gpu) = gpu() else { return };
    for mesh in [painted_box(true), painted_box(false), generate::torus_two_colour(0.5, 0.15, 48, 20)] {
        let off = check::colors(&gpu.baker(), &mesh, &eyes_outside(), FACE_PX).unwrap();
        assert!(off < 2.0 * differing_limit(&gpu.device), "{}: {off} of the texels differ", mesh.name);
    }
}

#[test]
fn what_does_not_fit_waits_for_the_next_batch() {
    let Some(gpu) = gpu() else { return };
    let mesh = generate::sphere(1.0, 1);
    let capture = capture_of(&gpu.baker(), &mesh, (512, FieldKind::Occlusion, true), Way::Drawn).unwrap();
    let eyes = vec![Vec3::new(1.5, 0.0, 0.0); 100];
    let batches = capture.plan(&eyes);
    assert!(batches.len() > 1 && batches.iter().map(Vec::len).sum::<usize>() == eyes.len(), "{}", batches.len());
    for batch in batches {
        let slots: Vec<u32> = batch.iter().flatten().copied().filter(|s| *s != NO_SLOT).collect();
        assert!(slots.iter().all(|slot| *slot < capture.capacity()));
        let places: HashSet<u32> = slots.iter().copied().collect();
        assert_eq!(places.len(), slots.len(), "no two faces share a place");
    }
    let model = Model::new(&gpu.device, &mesh, FieldKind::Occlusion).unwrap();
    let face_px = gpu.device.limits.max_image_dimension2_d;
    let too_large = Capture::new(&gpu.device, &gpu.library, model, face_px, FieldKind::Occlusion, Way::Drawn);
    assert_eq!(too_large.err().map(|error| error.exit_code()), Some(4));
}
