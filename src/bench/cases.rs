//! The measured cases: the embedded scenes, and a teapot over a plane under one kind of light at a time.

use crate::asset::{Mesh, embedded};
use crate::error::{Error, Result};
use crate::scene::Scene;
use crate::truth::raycast::Distant;
use std::path::Path;

/// A scene at one moment, and the distant light that its truth integrates.
pub struct Case {
    /// Name in tables.
    pub name: String,
    /// Description of its light.
    pub light: String,
    /// The scene.
    pub scene: Scene,
    /// Scene time in seconds.
    pub time_s: f64,
    /// Form of the distant light that ray casting integrates.
    pub distant: Distant,
}

impl Case {
    /// A scene at time 0.
    pub fn at_start(name: String, scene: Scene, distant: Distant) -> Self {
        Case { name, light: light(&scene), scene, time_s: 0.0, distant }
    }
}

/// Direction of the key light and of the sphere lights.
const TOWARD: [f64; 3] = [0.5, 0.707, 0.5];
/// Gap between floor and teapot, in bounding radii.
const GAP: f64 = 0.02;
/// Distance of the sphere lights from the teapot's centre, in bounding radii.
const LIGHT_DISTANCE: f64 = 5.0;
/// Distance of a disc in the sky, in bounding radii: its direction changes by 0.25 degrees over the floor.
const FAR: f64 = 1000.0;

/// The items whose name contains any of the texts, in their order; all if there is no text.
///
/// # Errors
/// `Usage` with a list of the names when no name contains one of the texts.
pub fn named<T>(mut all: Vec<T>, texts: &[String], name: impl Fn(&T) -> &str) -> Result<Vec<T>> {
    for text in texts {
        if !all.iter().any(|case| name(case).contains(text)) {
            let names: Vec<&str> = all.iter().map(&name).collect();
            return Err(Error::Usage(format!("no case has \"{text}\" in its name ({})", names.join("; "))));
        }
    }
    all.retain(|case| texts.is_empty() || texts.iter().any(|text| name(case).contains(text)));
    Ok(all)
}

/// The embedded scenes at time 0.
///
/// # Errors
/// `Input` when an embedded scene is malformed; tests read all of them.
pub fn scenes() -> Result<Vec<Case>> {
    let names = embedded::scenes().into_iter().map(|(name, _)| name);
    names.map(scene).collect()
}

/// An embedded scene by name.
///
/// # Errors
/// `Input` when there is no such scene.
pub fn scene(name: &str) -> Result<Case> {
    let path = Path::new(embedded::ROOT).join("scenes").join(format!("{name}.toml"));
    let scene = Scene::load(&path)?;
    Ok(Case::at_start(name.to_owned(), scene, Distant::Exact))
}

/// Description of a scene's light: its distant light and the number of local lights.
pub fn light(scene: &Scene) -> String {
    let source = scene.environment.source();
    let named = [
        (source.uniform.is_some(), "uniform sky"),
        (source.gradient.is_some(), "sky gradient"),
        (source.key.is_some(), "soft key light"),
        (source.sky.is_some(), "daylight"),
        (source.image.is_some(), "sky picture"),
    ];
    let mut words: Vec<String> = named.iter().filter(|(is, _)| *is).map(|(_, word)| (*word).to_owned()).collect();
    match scene.entities.iter().filter(|e| e.emits).count() {
        0 => {}
        1 => words.push("1 local light".into()),
        count => words.push(format!("{count} local lights")),
    }
    words.join(" + ")
}

/// Cells along a side of the floor of [`teapot_lights`]: as many vertices as the floors of the embedded scenes have.
const FINE_CELLS: usize = 112;

/// Teapot of bounding radius 1 over a floor of 113 x 113 vertices and 6 x 6 m that alone is lit, under one light at a time:
/// (a) a uniform sky, (b) a sky that brightens upwards, (c) a soft key light that is defined by its 4 bands, (d) a sphere
/// light seen from the teapot's centre under a half angle of 15 and of 7.5 degrees.
///
/// # Errors
/// As [`floor`].
pub fn teapot_lights() -> Result<Vec<Case>> {
    Ok(floor(FINE_CELLS)?.into_iter().filter(|case| !case.name.contains("disc")).collect())
}

/// As [`teapot_lights`] over a floor with `cells` cells along a side, followed by discs of half-angles of 30 and 15 degrees in the
/// sky: sphere lights so far away that they look the same from all vertices.
///
/// # Errors
/// `Input` when the embedded mesh or a scene of this function is malformed; tests run it.
pub fn floor(cells: usize) -> Result<Vec<Case>> {
    let mesh = Mesh::parse(&embedded::read(Path::new("assets/meshes/teapot.obj"))?, Path::new("teapot.obj"))?;
    let (centre, radius_m) = mesh.bounding_sphere();
    let (centre, scale) = (centre.as_dvec3(), 1.0 / f64::from(radius_m));
    let lowest = mesh.positions.iter().map(|p| f64::from(p.y)).fold(f64::INFINITY, f64::min);
    let place = [-centre.x * scale, GAP - lowest * scale, -centre.z * scale];
    let middle_y = place[1] + centre.y * scale;
    let head = format!(
        r#"
        [camera]
        eye = [0, 3, 6]
        target = [0, 0.5, 0]
        [[mesh]]
        name = "floor"
        plane = {{ size_m = 6, cells = {cells} }}
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
    let bulb = |half_angle_deg: f64, distance: f64| {
        let length = TOWARD.iter().map(|c| c * c).sum::<f64>().sqrt();
        let at = TOWARD.map(|c| c * distance / length);
        let scale = distance * half_angle_deg.to_radians().sin();
        // Radiance that gives a facing surface at the centre the irradiance pi.
        let radiance = half_angle_deg.to_radians().sin().powi(-2);
        format!(
            "[[entity]]\nmesh = \"bulb\"\nreceives = false\nscale = {scale}\nposition = [{}, {}, {}]\nemission = [{radiance}, {radiance}, {radiance}]",
            at[0],
            at[1] + middle_y,
            at[2]
        )
    };
    let lights = [
        ("teapot, (a) uniform sky", "[environment]\nuniform = [1, 1, 1]".to_owned(), Distant::Exact),
        ("teapot, (b) sky gradient", "[environment]\ngradient = { radiance = [1, 1, 1] }".to_owned(), Distant::Exact),
        (
            "teapot, (c) key of 4 bands",
            format!("[environment]\nkey = {{ radiance = [1, 1, 1], toward = {TOWARD:?}, sharpness = 4 }}"),
            Distant::Bands(4),
        ),
        ("teapot, (d) sphere light of 15 degrees", bulb(15.0, LIGHT_DISTANCE), Distant::Exact),
        ("teapot, (d) sphere light of 7.5 degrees", bulb(7.5, LIGHT_DISTANCE), Distant::Exact),
        ("teapot, disc of half-angle 30 degrees", bulb(30.0, FAR), Distant::Exact),
        ("teapot, disc of half-angle 15 degrees", bulb(15.0, FAR), Distant::Exact),
    ];
    let case = |(name, light, distant): (&str, String, Distant)| {
        let path = Path::new("assets/scenes/teapot_over_plane.toml");
        let scene = Scene::parse(&format!("{head}{light}"), path, &embedded::read)?;
        Ok(Case::at_start(name.to_owned(), scene, distant))
    };
    lights.into_iter().map(case).collect()
}
