//! Solids with square corners as boxes.

use crate::common::{generate, of_cells, reshaped};
use glam::{DVec3, Quat, Vec3};
use shadow_fields::asset::Mesh;
use shadow_fields::field::cuboid::PlacedCuboid;

const PLANES: [&[f32]; 3] =
    [&[-2.2, -2.0, -0.6, 0.5, 2.0, 2.2], &[-0.2, 0.0, 0.8, 1.7, 2.4, 2.6], &[-1.7, -1.5, 1.5, 1.7]];

fn holds(solid: &PlacedCuboid, place: DVec3) -> bool {
    let along = |edge: &DVec3| ((place - solid.centre_m) / solid.radius_m).dot(edge.normalize()).abs() < edge.length();
    solid.cuboid.half_edges.iter().all(along)
}

/// A house, stairs, a ring and an open box, turned and moved: boxes fill just their cells, and reach across faces.
#[test]
fn boxes_fill_a_solid_and_overlap() {
    let house = |[x, y, z]: [usize; 3]| (x, y, z) != (2, 2, 0) && (x % 4 == 0 || y % 4 == 0 || z % 2 == 0);
    let stairs = |[x, y, _]: [usize; 3]| y <= x;
    let ring = |[x, y, z]: [usize; 3]| z == 1 && (x % 4 == 0 || y % 4 == 0);
    let open = |[x, y, z]: [usize; 3]| x == 0 || y == 0 || z == 0;
    let solids: [(&dyn Fn([usize; 3]) -> bool, usize); 4] = [(&house, 20), (&stairs, 5), (&ring, 4), (&open, 3)];
    let turn = Quat::from_axis_angle(Vec3::new(0.6, 0.0, 0.8), 1.0);
    let placed = |p: Vec3| turn * p + Vec3::new(4.0, -1.0, 2.0);
    let middle = |cell: [usize; 3]| {
        let ends = |axis: usize| [PLANES[axis][cell[axis]], PLANES[axis][cell[axis] + 1]];
        Vec3::from_array([0, 1, 2].map(|axis| ends(axis).iter().sum::<f32>() / 2.0))
    };
    for (wanted, most) in solids {
        let solid = reshaped(&of_cells(PLANES, wanted), placed);
        let boxes = solid.boxes();
        assert!((2..=most).contains(&boxes.len()), "{} boxes", boxes.len());
        for cell in (0..75).map(|i| [i / 15, i / 3 % 5, i % 3]) {
            let within = |place: Vec3| boxes.iter().any(|solid| holds(solid, placed(place).as_dvec3()));
            assert_eq!(within(middle(cell)), wanted(cell), "{cell:?}");
            for axis in 0..3 {
                let mut next = cell;
                next[axis] += 1;
                if next[axis] + 1 < PLANES[axis].len() && wanted(cell) && wanted(next) {
                    let mut between = middle(cell);
                    between[axis] = PLANES[axis][next[axis]];
                    assert!(within(between), "{cell:?} {next:?}");
                }
            }
        }
    }
}

#[test]
fn other_solids_have_no_boxes() {
    let stairs = of_cells(PLANES, |[x, y, _]| y <= x);
    let skewed = reshaped(&stairs, |p| Vec3::new(p.x + 0.1 * p.y, p.y, p.z));
    let wedge = reshaped(&stairs, |p| Vec3::new(p.x, p.y * (2.0 + 0.1 * p.z), p.z));
    let open = Mesh::new("open", stairs.positions.clone(), Vec::new(), None, stairs.triangles[2..].to_vec()).unwrap();
    for mesh in [skewed, wedge, open, generate::torus(1.0, 0.3, 12, 6), generate::cuboid(Vec3::ONE, 2)] {
        assert!(mesh.boxes().is_empty(), "{}", mesh.name);
    }
}
