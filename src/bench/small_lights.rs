//! Cases with small lights, which run only when they are named: one light of 1 to 30 degrees over a floor and an object, and a room
//! of many small lights in which all moves.

use super::cases::{Case, FAR, FINE_CELLS, NEAR, PLACE, bulb, over_floor};
use crate::asset::{Mesh, embedded};
use crate::error::Result;
use crate::scene::Scene;
use crate::truth::raycast::Distant;
use std::f64::consts::TAU;
use std::fmt::Write;
use std::path::Path;

/// Half angles of the lights as seen from the object's centre, degrees.
pub const HALF_ANGLES_DEG: [u32; 5] = [1, 3, 8, 15, 30];
/// Objects over the floor: two built-in meshes, and an animal on thin legs.
pub const OBJECTS: [&str; 3] = ["teapot", "torus", "animal"];
/// Number of lights and of things that move in [`many`].
pub const MANY: [usize; 2] = [32, 24];

/// Which case it is, before its meshes are read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SmallLight {
    /// One light over a floor and an object.
    One {
        /// One of [`OBJECTS`].
        object: &'static str,
        /// 1 000 bounding radii away instead of 5.
        distant: bool,
        /// One of [`HALF_ANGLES_DEG`].
        half_angle_deg: u32,
    },
    /// [`many`].
    Many,
}

impl SmallLight {
    /// All of them: by object, near lights before distant ones, and small ones first; last the many.
    pub fn all() -> Vec<Self> {
        let angles = |object, distant| {
            HALF_ANGLES_DEG.map(|half_angle_deg| SmallLight::One { object, distant, half_angle_deg }).into_iter()
        };
        let object = |object| angles(object, false).chain(angles(object, true));
        OBJECTS.into_iter().flat_map(object).chain([SmallLight::Many]).collect()
    }

    /// Name in tables and for `--case`: `torus, near light of 3 degrees`.
    pub fn name(&self) -> String {
        match self {
            SmallLight::One { object, distant, half_angle_deg } => {
                format!("{object}, {} light of {half_angle_deg} degrees", if *distant { "distant" } else { "near" })
            }
            SmallLight::Many => format!("{} small lights, {} moving objects", MANY[0], MANY[1]),
        }
    }

    /// The case.
    ///
    /// # Errors
    /// `Input` when a built-in mesh or scene is malformed; tests run all.
    pub fn case(&self) -> Result<Case> {
        let SmallLight::One { object, distant, half_angle_deg } = *self else {
            return Ok(Case { time_s: MANY_TIME_S, ..Case::at_start(self.name(), many()?, Distant::Exact) });
        };
        let file = Path::new(PLACE).with_file_name("../meshes").join(object).with_extension("obj");
        let (head, middle_y) = over_floor(&Mesh::parse(&read(&file)?, &file)?, object, FINE_CELLS);
        let light = bulb(half_angle_deg.into(), if distant { FAR } else { NEAR }, middle_y);
        let scene = Scene::parse(&format!("{head}{light}"), Path::new(PLACE), &read)?;
        Ok(Case::at_start(self.name(), scene, Distant::Exact))
    }
}

/// Built-in files, and the animal.
fn read(path: &Path) -> Result<Vec<u8>> {
    if path.file_name().is_some_and(|name| name == "animal.obj") {
        Ok(animal().into_bytes())
    } else {
        embedded::read(path)
    }
}

/// Radius of the animal's legs, metres: 0.03 of its bounding radius.
const LEG_M: f64 = 0.022;

/// An OBJ file: a body, a neck and a head on four thin legs, 1.1 m high.
fn animal() -> String {
    let mut obj = Obj::default();
    // Half of each circle that is turned about +y, as (radius, height) from below.
    let ball: Vec<[f64; 2]> =
        (0..=12).map(|i| (f64::from(i) / 24.0 * TAU).sin_cos()).map(|(sin, cos)| [sin, -cos]).collect();
    let tube = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    obj.turned(&ball, |[x, y, z]| [0.48 * x, 0.74 + 0.18 * y, 0.17 * z]);
    obj.turned(&ball, |[x, y, z]| [0.58 + 0.16 * x, 1.02 + 0.08 * y, 0.09 * z]);
    obj.turned(&tube, |[x, y, z]| [0.34 + 0.07 * x + 0.2 * y, 0.8 + 0.22 * y, 0.06 * z]);
    for (x, z) in [(-0.32, -0.1), (-0.32, 0.1), (0.32, -0.1), (0.32, 0.1)] {
        obj.turned(&tube, |[dx, y, dz]| [x + LEG_M * dx, 0.7 * y, z + LEG_M * dz]);
    }
    obj.text
}

/// Text of an OBJ file in the making.
#[derive(Default)]
struct Obj {
    text: String,
    vertices: usize,
}

impl Obj {
    /// Adds a closed surface: a profile of (radius, height) that is turned about +y, starts and ends on it, and is placed by a map.
    fn turned(&mut self, profile: &[[f64; 2]], place: impl Fn([f64; 3]) -> [f64; 3]) {
        const AROUND: usize = 24;
        for [radius, height] in profile {
            for i in 0..AROUND {
                let (sin, cos) = (i as f64 / AROUND as f64 * TAU).sin_cos();
                let [x, y, z] = place([radius * cos, *height, radius * sin]);
                let _ = writeln!(self.text, "v {x:.6} {y:.6} {z:.6}");
            }
        }
        let vertex = |ring: usize, i: usize| 1 + self.vertices + ring * AROUND + i % AROUND;
        for ring in 0..profile.len() - 1 {
            for i in 0..AROUND {
                let [a, b, c, d] = [vertex(ring, i), vertex(ring + 1, i), vertex(ring + 1, i + 1), vertex(ring, i + 1)];
                // At either end the ring is a point, and one of the two triangles nothing.
                if ring > 0 {
                    let _ = writeln!(self.text, "f {a} {b} {d}");
                }
                if ring + 2 < profile.len() {
                    let _ = writeln!(self.text, "f {b} {c} {d}");
                }
            }
        }
        self.vertices += profile.len() * AROUND;
    }
}

/// Moment at which [`many`] is measured, seconds: nothing is where it stands in the text.
const MANY_TIME_S: f64 = 1.7;

/// A floor of 12 x 12 m, 24 things that circle, turn and bob over it, and 32 small lights above and among them that circle too. All
/// things are lit. The same in every run.
///
/// # Errors
/// `Input` when the scene of this function is malformed; tests run it.
pub fn many() -> Result<Scene> {
    let mut text = "[camera]\neye = [0, 7, 11]\ntarget = [0, 0.6, 0]\n\
        [[mesh]]\nname = \"floor\"\nplane = { size_m = 12, cells = 96 }\n\
        [[mesh]]\nname = \"bulb\"\nsphere = { radius_m = 0.1, subdivisions = 2 }\n\
        [[mesh]]\nname = \"ball\"\nsphere = { radius_m = 0.45, subdivisions = 3 }\n\
        [[mesh]]\nname = \"box\"\ncuboid = { size_m = [0.7, 0.5, 0.6], cells = 6 }\n\
        [[mesh]]\nname = \"ring\"\ntorus = { major_m = 0.42, minor_m = 0.14, segments = 32, sides = 12 }\n\
        [[mesh]]\nname = \"pot\"\nteapot = { subdivisions = 4 }\n[[entity]]\nmesh = \"floor\"\n"
        .to_owned();
    let [lights, things] = MANY;
    // Equal areas of a disc of 5 m, by the golden angle.
    let spread = |i: usize, count: usize| {
        let (radius, turn) = (5.0 * ((i as f64 + 0.5) / count as f64).sqrt(), i as f64 * 2.399_963);
        [radius * turn.cos(), radius * turn.sin()]
    };
    for i in 0..things {
        let [x, z] = spread(i, things);
        let (mesh, y, scale) = [("ball", 0.55, 1.0), ("ring", 0.7, 1.0), ("box", 0.6, 1.0), ("pot", 0.15, 0.28)][i % 4];
        let _ = writeln!(
            text,
            "[[entity]]\nmesh = \"{mesh}\"\nposition = [{x}, {y}, {z}]\nscale = {scale}\nmotion = [{{ spin = {{ axis = [0.3, 1, 0.2], period_s = {} }} }}, \
             {{ orbit = {{ centre = [{}, 0, {z}], period_s = {} }} }}, {{ bob = {{ amplitude_m = 0.1, period_s = 3, phase_deg = {} }} }}]",
            4 + i % 5,
            x + 0.3,
            if i.is_multiple_of(2) { 6 } else { -7 },
            i * 77 % 360,
        );
    }
    for i in 0..lights {
        let [x, z] = spread(i, lights);
        let scale = [0.5, 0.8, 1.2, 2.0][i % 4];
        // As bright from 2 m, whatever the size.
        let color = [[1.0, 0.8, 0.6], [0.6, 0.8, 1.0], [1.0, 0.6, 0.7]][i % 3].map(|c| 60.0 * c / (scale * scale));
        let _ = writeln!(
            text,
            "[[entity]]\nmesh = \"bulb\"\nposition = [{x}, {}, {z}]\nscale = {scale}\nreceives = false\nemission = {color:?}\n\
             motion = [{{ orbit = {{ centre = [0, 0, 0], period_s = {} }} }}]",
            1.4 + 0.2 * (i % 8) as f64,
            if i.is_multiple_of(2) { 11 } else { -13 },
        );
    }
    Scene::parse(&text, Path::new(PLACE), &read)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_light_is_seen_under_its_angle() {
        for which in SmallLight::all() {
            let SmallLight::One { distant, half_angle_deg, .. } = which else { continue };
            let case = which.case().unwrap();
            let placements = case.scene.at(case.time_s);
            let [object, light] = [1, 2].map(|i| {
                let (centre, radius_m) = case.scene.meshes[case.scene.entities[i].mesh].bounding_sphere();
                (placements[i].position + placements[i].scale * centre, placements[i].scale * radius_m)
            });
            let (far, radius_m) = (object.0.distance(light.0), light.1);
            assert!((object.1 - 1.0).abs() < 1e-4, "{}: {object:?}", case.name);
            assert!((far / if distant { 1000.0 } else { 5.0 } - 1.0).abs() < 1e-4, "{}: {far}", case.name);
            assert!(((radius_m / far).asin().to_degrees() - half_angle_deg as f32).abs() < 0.01, "{}", case.name);
            assert_eq!(case.name, which.name());
        }
    }

    #[test]
    fn the_animal_stands_on_thin_legs_over_the_floor() {
        let mesh = Mesh::parse(animal().as_bytes(), Path::new("animal.obj")).unwrap();
        let radius = f64::from(mesh.bounding_sphere().1);
        assert!((LEG_M / radius - 0.03).abs() < 0.002, "{}", LEG_M / radius);
        let low = mesh.positions.iter().filter(|p| p.y < 0.3);
        assert!(
            low.clone().count() > 100 && low.clone().all(|p| p.y.abs() < 1e-6),
            "legs have rings only at their ends"
        );
    }

    #[test]
    fn the_many_are_as_many_and_the_same_each_time() {
        let case = SmallLight::Many.case().unwrap();
        let count = |of: &dyn Fn(&crate::scene::Entity) -> bool| case.scene.entities.iter().filter(|e| of(e)).count();
        assert_eq!([count(&|e| e.emits), count(&|e| e.occludes)], MANY);
        assert_eq!(count(&|e| e.receives), 1 + MANY[1]);
        let (first, later) = (case.scene.at(0.0), case.scene.at(case.time_s));
        let moved = first.iter().zip(&later).filter(|(a, b)| a.position.distance(b.position) > 0.01).count();
        assert!(moved >= MANY[0] + MANY[1] - 1, "{moved} have moved");
        assert_eq!(case.scene.to_toml().unwrap(), many().unwrap().to_toml().unwrap());
    }
}
