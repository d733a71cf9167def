//! "sharp" against its twin in f64, which reads the same stored numbers.

use super::CheckRow;
use super::merge::{MIXED, against_twin, options, scene};
use crate::bake::Baker;
use crate::bake::cache::Cache;
use crate::bake::silhouette::SilhouetteOptions;
use crate::error::Result;
use crate::frame::{self, Frame};
use crate::lists::skip::Skip;
use crate::merge::Variant;
use crate::scene::Lights;

/// Differences of f32 arithmetic: a place on a map is off by some 1e-6 of its edge, and the distance found there is
/// divided by the half-width of a penumbra, which near an outline is a thousandth of the object's radius.
const PENUMBRA: f64 = 1e-4;

/// Further entities beside [`MIXED`]: a light with an outline of its own, a small light, a ball that stands beyond it,
/// a ring around it, a thin board in whose bounding sphere others stand, panels of every form, a spot, and a tube.
const MORE: &str = r#"
[[entity]]
mesh = "ring"
position = [-1.313, 1.917, -0.491]
rotation = { axis = [0.7, 0.1, 0.5], angle_deg = 73 }
scale = 0.6
emission = [6, 5, 9]
[[entity]]
mesh = "ball"
position = [0.171, 1.913, -1.537]
scale = 0.05
emission = [900, 700, 500]
[[entity]]
mesh = "ball"
position = [0.211, 2.613, -2.037]
scale = 0.7
[[entity]]
mesh = "ring"
position = [0.181, 1.903, -1.497]
rotation = { axis = [0.2, 0.1, 1], angle_deg = 31 }
scale = 0.9
[[mesh]]
name = "board"
cuboid = { size_m = [1.7, 0.03, 1.3], cells = 2 }
[[entity]]
mesh = "board"
opacity = 0.7
position = [0.213, 0.917, 0.191]
rotation = { axis = [0.7, 0.1, 0.3], angle_deg = 13 }
[[mesh]]
name = "lamp"
disc = { radius_m = 0.3 }
[[mesh]]
name = "window"
rectangle = { size_m = [0.5, 0.8] }
[[mesh]]
name = "strip"
rectangle = { size_m = [1.7, 0.1] }
[[entity]]
mesh = "lamp"
position = [-1.613, 2.317, 0.291]
rotation = { axis = [0, 0.3, 1], angle_deg = 217 }
emission = [9, 7, 5]
[[entity]]
mesh = "ball"
position = [1.113, 2.517, -0.791]
rotation = { axis = [0.2, 0.1, 1], angle_deg = 152 }
scale = 0.2
emission = [90, 70, 50]
spot = { inner_deg = 20, outer_deg = 45 }
[[entity]]
mesh = "window"
position = [1.913, 1.517, 0.591]
rotation = { axis = [0.1, 0.2, 1], angle_deg = 97 }
emission = [6, 7, 9]
[[entity]]
mesh = "strip"
position = [0.313, 2.717, 0.691]
rotation = { axis = [1, 0.2, 0.1], angle_deg = 171 }
emission = [9, 9, 7]
[[mesh]]
name = "tube"
cuboid = { size_m = [0.1, 1.1, 0.08], cells = 1 }
[[entity]]
mesh = "tube"
position = [-0.613, 1.417, 1.391]
rotation = { axis = [0.3, 0.1, 1], angle_deg = 71 }
emission = [7, 9, 9]
"#;

/// A small frame with sharp lights.
pub fn sharp_options() -> frame::Options {
    let base = options();
    let silhouette = SilhouetteOptions { cells: 4, map_px: 16, view_px: 64, levels: false };
    frame::Options { lights: Lights::Sharp, bake: crate::bake::Options { silhouette, ..base.bake }, ..base }
}

pub fn rows(baker: &Baker, add: &mut dyn FnMut(CheckRow)) -> Result<()> {
    let scene = scene(&format!("{MIXED}{MORE}"))?;
    let placements = scene.at(0.0);
    let cache = Cache::new(None);
    let base = sharp_options();
    let named = |name: &str| Some(Variant::named(name).expect("a variant"));
    for (what, options) in [
        ("texel-packed", base),
        ("storage", frame::Options { variant: named("storage"), ..base }),
        ("storage-uniform", frame::Options { variant: named("storage-uniform"), ..base }),
        ("no skip", frame::Options { skip: Skip::NONE, ..base }),
    ] {
        let mut frame = Frame::new(baker, &cache, &scene, options, &|_, _, _| ())?;
        let worst = against_twin(&mut frame, &placements)?;
        add(CheckRow::new("sharp", what, "of 1 + brightest", worst, PENUMBRA));
    }
    Ok(())
}
