//! The measured cases: the embedded scenes, and a teapot over a plane under one kind of light at a time.

use crate::asset::{Mesh, embedded};
use crate::error::{Error, Result};
use crate::scene::Scene;
use crate::truth::raycast::Distant;
use std::path::Path;

/// A scene at one time, and the distant light that its truth integrates.
pub struct Case {
    pub name: String,
    pub scene: Scene,
    pub time_s: f64,
    /// Form of the distant light that ray casting integrates.
    pub distant: Distant,
}

impl Case {
    /// A scene at time 0.
    pub fn at_start(name: String, scene: Scene) -> Self {
        Case { name, scene, time_s: 0.0, distant: Distant::Exact }
    }

    /// The scene of a file at the time of its first picture, named after the file.
    pub fn of_file(path: &Path, scene: Scene) -> Result<Self> {
        let missing = if !scene.entities.iter().any(|e| e.receives) {
            "no entity receives light"
        } else if scene.environment.is_none() && !scene.entities.iter().any(|e| e.emits) {
            "nothing shines: there is no [environment], and no entity emits"
        } else {
            let name = path.file_stem().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
            let time_s = scene.data.output.time_s;
            return Ok(Case { time_s, ..Case::at_start(name, scene) });
        };
        Err(Error::input(path, format!("{missing}, so there is no radiosity to judge")))
    }
}

/// Direction of the key light and of the sphere lights.
const TOWARD: [f64; 3] = [0.5, 0.707, 0.5];
/// Gap between floor and teapot, in bounding radii.
const GAP: f64 = 0.02;
/// Distance of the sphere lights from the teapot's centre, in bounding radii.
const DISTANCE: f64 = 5.0;

/// The cases whose names contain one of the texts, in their order. Without texts all cases are returned.
pub fn named(mut all: Vec<Case>, texts: &[String]) -> Result<Vec<Case>> {
    for text in texts {
        if !all.iter().any(|case| case.name.contains(text)) {
            let names: Vec<&str> = all.iter().map(|case| case.name.as_str()).collect();
            return Err(Error::Usage(format!("no case has \"{text}\" in its name ({})", names.join("; "))));
        }
    }
    all.retain(|case| texts.is_empty() || texts.iter().any(|text| case.name.contains(text)));
    Ok(all)
}

/// The embedded scenes at time 0.
pub fn scenes() -> Result<Vec<Case>> {
    let names = embedded::scenes().into_iter().map(|(name, _)| name);
    names.map(scene).collect()
}

pub fn scene(name: &str) -> Result<Case> {
    let path = Path::new(embedded::ROOT).join("scenes").join(format!("{name}.toml"));
    let scene = Scene::load(&path)?;
    Ok(Case::at_start(name.to_owned(), scene))
}

/// Cells along a side of the floor of [`teapot_lights`]: as many vertices as the floors of the embedded scenes have.
const FLOOR_CELLS: usize = 112;

/// Teapot of bounding radius 1 over a floor of 113 x 113 vertices and 6 x 6 m that alone is lit, under one light at a
/// time: (a) a uniform sky, (b) a sky that brightens upwards, (c) a soft key light that is defined by its 4 bands, (d)
/// a sphere light seen from the teapot's centre under a half angle of 15 and of 7.5 degrees.
pub fn teapot_lights() -> Result<Vec<Case>> {
    let mesh = Mesh::parse(&embedded::read(Path::new("assets/meshes/teapot.obj"))?, Path::new("teapot.obj"))?;
    let (head, middle_y) = over_floor(&mesh);
    let lights = [
        ("teapot, (a) uniform sky", "[environment]\nuniform = [1, 1, 1]".to_owned(), Distant::Exact),
        ("teapot, (b) sky gradient", "[environment]\ngradient = { radiance = [1, 1, 1] }".to_owned(), Distant::Exact),
        (
            "teapot, (c) key of 4 bands",
            format!("[environment]\nkey = {{ radiance = [1, 1, 1], toward = {TOWARD:?}, sharpness = 4 }}"),
            Distant::Bands(4),
        ),
        ("teapot, (d) sphere light of 15 degrees", bulb(15.0, middle_y), Distant::Exact),
        ("teapot, (d) sphere light of 7.5 degrees", bulb(7.5, middle_y), Distant::Exact),
    ];
    let case = |(name, light, distant): (&str, String, Distant)| {
        let scene = Scene::parse(&format!("{head}{light}"), Path::new(PLACE), &embedded::read)?;
        Ok(Case { distant, ..Case::at_start(name.to_owned(), scene) })
    };
    lights.into_iter().map(case).collect()
}

/// Path under which the texts of these scenes are read, so that they find `../meshes`.
const PLACE: &str = "assets/scenes/over_floor.toml";

/// Text of a scene without light, and the height of the teapot's centre in metres. The teapot is scaled to a bounding
/// radius of 1 m, at a small distance above the floor's middle. The scene also has a mesh "bulb", a ball of radius 1 m,
/// which no entity uses yet.
fn over_floor(mesh: &Mesh) -> (String, f64) {
    let (centre, radius_m) = mesh.bounding_sphere();
    let centre = centre.as_dvec3();
    let scale = 1.0 / f64::from(radius_m);
    let lowest = mesh.positions.iter().map(|p| f64::from(p.y)).fold(f64::INFINITY, f64::min);
    let place = [-centre.x * scale, GAP - lowest * scale, -centre.z * scale];
    let text = format!(
        r#"
        [camera]
        eye = [0, 3, 6]
        target = [0, 0.5, 0]
        [[mesh]]
        name = "floor"
        plane = {{ size_m = 6, cells = {FLOOR_CELLS} }}
        [[mesh]]
        name = "teapot"
        file = "../meshes/teapot.obj"
        [[mesh]]
        name = "bulb"
        sphere = {{ radius_m = 1, subdivisions = 4 }}
        [[entity]]
        mesh = "floor"
        [[entity]]
        mesh = "teapot"
        position = {place:?}
        scale = {scale}
        receives = false
        "#
    );
    (text, place[1] + centre.y * scale)
}

/// Text of a sphere light that is seen under a half angle from the teapot's centre. A surface there that faces it
/// receives the irradiance pi.
fn bulb(half_angle_deg: f64, middle_y: f64) -> String {
    let length = TOWARD.iter().map(|c| c * c).sum::<f64>().sqrt();
    let [x, y, z] = TOWARD.map(|c| c * DISTANCE / length);
    let scale = DISTANCE * half_angle_deg.to_radians().sin();
    let radiance = half_angle_deg.to_radians().sin().powi(-2);
    format!(
        "[[entity]]\nmesh = \"bulb\"\nreceives = false\nscale = {scale}\nposition = [{x}, {}, {z}]\nemission = [{radiance}, {radiance}, {radiance}]",
        y + middle_y,
    )
}
