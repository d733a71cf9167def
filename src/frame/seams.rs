//! Where the rectangles that entities are end at boxes, as a ceiling does at its walls, they reach into these: before a sun
//! that lies behind such a seam each of the two would let half of its light pass, and both together a quarter.

use super::light_maps;
use crate::field::cuboid::PlacedCuboid;
use crate::field::sheet::Rectangle;
use crate::scene::{Placement, Scene};
use glam::DVec3;

/// How far a rectangle reaches into boxes at most, as shares of half its side. The first that fits is taken.
const REACHES: [f64; 3] = [0.02, 0.01, 0.005];
/// Places along a side that must lie in boxes.
const PLACES: usize = 17;
/// How near a box is near enough, as a share of half the side.
const GAP: f64 = 1e-3;

/// For every entity how much longer halves of its rectangle's sides are, metres of its mesh. Things that rest count, and
/// both ends of a side must lie at boxes.
pub(super) fn reaches(scene: &Scene, placements: &[Placement]) -> Vec<[f64; 2]> {
    let resting = light_maps::casters(scene);
    let boxes_of = |&entity: &usize| {
        let boxes = scene.caster(scene.entities[entity].mesh).as_boxes();
        boxes.into_iter().map(move |own| (&placements[entity], own))
    };
    let boxes: Vec<(&Placement, PlacedCuboid)> = resting.iter().flat_map(boxes_of).collect();
    let mut reaches = vec![[0.0; 2]; scene.entities.len()];
    for &entity in &resting {
        let mesh = scene.caster(scene.entities[entity].mesh);
        let Some(rectangle) = mesh.rectangle() else { continue };
        let centre = mesh.bounding_sphere().0.as_dvec3();
        let in_a_box = |place: DVec3, gap_m: f64| {
            let world = placements[entity].point(place);
            let gap_m = gap_m * f64::from(placements[entity].scale);
            boxes.iter().any(|(of, own)| holds(own, of.local(world), gap_m / f64::from(of.scale)))
        };
        for axis in 0..2 {
            reaches[entity][axis] = reach(&rectangle, centre, axis, &in_a_box);
        }
    }
    reaches
}

fn reach(rectangle: &Rectangle, centre: DVec3, axis: usize, in_a_box: &dyn Fn(DVec3, f64) -> bool) -> f64 {
    let Rectangle { axes, half_m } = rectangle;
    let at = |end: f64, number: usize| {
        let along = 0.98 * (2.0 * number as f64 / (PLACES - 1) as f64 - 1.0);
        let place = centre + end * half_m[axis] * axes[axis] + along * half_m[1 - axis] * axes[1 - axis];
        in_a_box(place, GAP * half_m[axis])
    };
    let fits = |reach: &f64| {
        let ends = [-1.0, 1.0].into_iter().flat_map(|end| (0..PLACES).map(move |number| (end, number)));
        // A rug lies on a box with all of itself.
        ends.clone().all(|(end, number)| at((1.0 + reach) * end, number))
            && !ends.clone().any(|(end, number)| at((1.0 - reach) * end, number))
    };
    REACHES.into_iter().find(fits).map_or(0.0, |reach| reach * half_m[axis])
}

/// Whether a point of the mesh's frame lies in a box, or no farther from it than `gap_m`.
fn holds(own: &PlacedCuboid, point: DVec3, gap_m: f64) -> bool {
    let off = (point - own.centre_m) / own.radius_m;
    own.cuboid.half_edges.iter().all(|half| {
        let length = half.length();
        off.dot(*half).abs() <= length * (length + gap_m / own.radius_m)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    /// A ceiling that ends at walls on two sides, on one of which there is a gap.
    #[test]
    fn a_ceiling_reaches_into_the_walls_at_both_of_its_ends() {
        let wall = |name: &str, position: [f64; 3], size: [f64; 3]| {
            format!(
                "[[mesh]]\nname = \"{name}\"\ncuboid = {{ size_m = {size:?}, cells = 1 }}\n\
                 [[entity]]\nmesh = \"{name}\"\nposition = {position:?}\n"
            )
        };
        let text = "[camera]\neye = [0, 1, 0]\ntarget = [1, 1, 0]\n[[mesh]]\nname = \"ceiling\"\n\
                    plane = { size_m = 4.0, cells = 1 }\n[[entity]]\nmesh = \"ceiling\"\nposition = [0, 3, 0]\n"
            .to_owned()
            + &wall("left", [-2.1, 1.5, 0.0], [0.2, 3.0, 4.0])
            + &wall("right", [2.1, 1.5, 0.0], [0.2, 3.0, 4.0])
            + &wall("back", [0.0, 1.5, -2.1], [4.0, 3.0, 0.2])
            + &wall("front", [-0.5, 1.5, 2.1], [3.0, 3.0, 0.2]);
        let read = |_: &Path| unreachable!("no files");
        let scene = Scene::parse(&text, Path::new("s.toml"), &read).unwrap();
        let found = reaches(&scene, &scene.at(0.0));
        let rectangle = scene.meshes[scene.entities[0].mesh].rectangle().unwrap();
        for (axis, reach) in rectangle.axes.iter().zip(found[0]) {
            let wanted = if axis.x.abs() > 0.5 { 0.04 } else { 0.0 };
            assert!((reach - wanted).abs() < 1e-9, "{axis} {reach}");
        }
        assert!(found[1..].iter().all(|reach| *reach == [0.0; 2]));
        let rug = "[camera]\neye = [0, 1, 0]\ntarget = [1, 1, 0]\n[[mesh]]\nname = \"rug\"\n\
                   plane = { size_m = 4.0, cells = 1 }\n[[entity]]\nmesh = \"rug\"\n"
            .to_owned()
            + &wall("floor", [0.0, -0.1, 0.0], [9.0, 0.2, 9.0]);
        let scene = Scene::parse(&rug, Path::new("s.toml"), &read).unwrap();
        assert_eq!(reaches(&scene, &scene.at(0.0))[0], [0.0; 2]);
    }
}
