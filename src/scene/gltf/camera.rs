//! The viewpoint: the file's first perspective camera.

use ::gltf::json::camera::Type;
use ::gltf::json::validation::Checked;
use glam::DVec3;

use super::document::Document;
use super::notes::Notes;
use super::tree::Stand;
use crate::asset::Mesh;
use crate::asset::enclose::around_boxes;
use crate::error::Result;
use crate::scene::data::{Camera, EntityData, Output};

/// Height of pictures in pixels where the camera states an aspect.
const HEIGHT_PX: f32 = 640.0;

/// The file's camera of that name, or its first, and the size of its pictures, for a scene with that bounding sphere
/// (metres); `None` if it has none.
pub fn camera(
    document: &Document,
    stands: &[Stand],
    name: Option<&str>,
    (centre, radius_m): (DVec3, f64),
    notes: &mut Notes,
) -> Result<Option<(Camera, Output)>> {
    let mut found = None;
    let mut names = Vec::new();
    for stand in stands {
        let node = &document.root.nodes[stand.node];
        let Some(index) = node.camera.map(|camera| camera.value()) else { continue };
        let json = &document.root.cameras[index];
        let own = [node.name.as_deref(), json.name.as_deref()];
        if name.is_some_and(|name| !own.contains(&Some(name))) {
            names.extend(own.into_iter().flatten().map(|name| format!("{name:?}")));
            continue;
        }
        match (&json.type_, &json.perspective) {
            (Checked::Valid(Type::Perspective), Some(_)) if found.is_some() => notes.leave_out("further cameras"),
            (Checked::Valid(Type::Perspective), Some(perspective)) => found = Some((index, stand, perspective)),
            _ => notes.leave_out("cameras without perspective"),
        }
    }
    if let (Some(name), None) = (name, found) {
        let known = if names.is_empty() { "it has none with a name".into() } else { names.join(", ") };
        return Err(document.fail("cameras", format!("there is no camera {name:?} with perspective: {known}")));
    }
    let Some((index, stand, perspective)) = found else {
        notes.say("there is no camera: one that sees everything is added".into());
        return Ok(None);
    };
    let place = format!("cameras[{index}].perspective");
    let fov_deg = perspective.yfov.to_degrees();
    if !(1.0..=170.0).contains(&fov_deg) {
        return Err(document.fail(place, format!("a yfov of {fov_deg} degrees is not within 1 to 170")));
    }
    if !stand.motion.is_empty() {
        notes.leave_out("movements of cameras (they stand where they are at time 0)");
    }
    // Cameras look along -z.
    let at = stand.at(0.0);
    let to_world = |p: DVec3| at.transform_point3(p);
    let eye = to_world(DVec3::ZERO);
    let ahead = to_world(DVec3::NEG_Z);
    let ahead = (ahead - eye).try_normalize().ok_or_else(|| document.fail(&place, "its node squeezes space flat"))?;
    let distance_m = (centre - eye).dot(ahead).max(0.1 * radius_m).max(1e-3);
    let camera = Camera { eye: eye.as_vec3(), target: (eye + ahead * distance_m).as_vec3(), fov_deg };
    if camera.eye.distance(camera.target) < 1e-6 || !camera.target.is_finite() {
        return Err(document.fail(place, "it stands too far out to look anywhere"));
    }
    let up = (to_world(DVec3::Y) - eye).normalize_or_zero();
    let right = ahead.cross(camera.up().as_dvec3()).normalize_or_zero();
    if up.dot(right).abs() > 0.02 {
        notes.leave_out("tilts of cameras (up stays up in the picture)");
    }
    let mut output = Output::default();
    if let Some(aspect) = perspective.aspect_ratio {
        if !(0.05..=20.0).contains(&aspect) {
            return Err(document.fail(place, format!("an aspectRatio of {aspect} is not within 0.05 to 20")));
        }
        (output.width, output.height) = ((HEIGHT_PX * aspect).round() as u32, HEIGHT_PX as u32);
    }
    Ok(Some((camera, output)))
}

/// A sphere around entities at time 0, each with its mesh: centre and radius in metres.
pub fn bounds<'a>(entities: impl Iterator<Item = (&'a Mesh, &'a EntityData)>) -> (DVec3, f64) {
    let boxes = entities.map(|(mesh, entity)| {
        let (centre, radius_m) = entity.at(0.0).sphere(mesh.bounding_sphere());
        [centre - radius_m, centre + radius_m]
    });
    let Some([low, high]) = around_boxes(boxes) else { return (DVec3::ZERO, 1.0) };
    // The box of the spheres is larger than what is in them.
    ((low + high) / 2.0, ((high - low).length() / 2.0 / 3.0_f64.sqrt() * 1.2).max(1e-3))
}
