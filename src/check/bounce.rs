//! "hidden links", "runs", "bounce" and "movers" against their twin in f64, which reads the same links and the same direct light.

use super::CheckRow;
use super::merge::{options, scene};
use crate::bake::Baker;
use crate::bake::cache::Cache;
use crate::bounce::Bounces;
use crate::error::Result;
use crate::frame::{self, Frame};
use crate::scene::Lights;

/// A corner of a room with a box in it, a ball and a box that move, and a lamp.
const CORNER: &str = r#"
[[mesh]]
name = "wall"
cuboid = { size_m = [3, 0.1, 3], cells = 8 }
[[mesh]]
name = "ball"
sphere = { radius_m = 0.3, subdivisions = 2 }
[[entity]]
mesh = "wall"
albedo = [0.8, 0.7, 0.6]
[[entity]]
mesh = "wall"
albedo = [0.2, 0.7, 0.3]
position = [-1.45, 1.5, 0]
rotation = { axis = [0, 0, 1], angle_deg = 90 }
[[entity]]
mesh = "wall"
scale = 0.2
position = [0.4, 0.3, 0.2]
rotation = { axis = [1, 0, 0.3], angle_deg = 70 }
[[entity]]
mesh = "ball"
position = [-0.5, 0.7, 0.3]
motion = [{ spin = { period_s = 4 } }]
[[entity]]
mesh = "wall"
scale = 0.25
position = [-0.3, 0.4, -0.5]
rotation = { axis = [1, 0, 0.3], angle_deg = 80 }
motion = [{ spin = { period_s = 4 } }]
[[entity]]
mesh = "ball"
scale = 0.5
position = [0.3, 2.3, 0.4]
emission = [9, 8, 7]
"#;

/// Shares of links that boxes hide are rounded to 0.4 %, and f32 and f64 may differ in which way: then a link of the usual
/// share differs by so much.
const ROUNDING: f64 = 1e-4;

/// What lights it: a sharp lamp, past maps of self-visibility, or a sky, past transfers.
const SKY: &str = "[environment]\nsky = { sun_elevation_deg = 50, sun_azimuth_deg = 60, radiance = 0.8, sun = 0 }\n";

pub fn rows(baker: &Baker, add: &mut dyn FnMut(CheckRow)) -> Result<()> {
    let lamp = CORNER.to_owned();
    let sky = format!("{}{SKY}", CORNER.replace("emission = [9, 8, 7]\n", ""));
    let cases =
        [("one bounce", Bounces::One, &lamp), ("all bounces", Bounces::All, &lamp), ("a sky", Bounces::All, &sky)];
    for (what, bounces, text) in cases {
        let scene = scene(text)?;
        let bake = crate::bake::Options { groups: true, ..options().bake };
        let options = frame::Options { bounces, bake, lights: Lights::Sharp, ..options() };
        let mut frame = Frame::new(baker, &Cache::default(), &scene, options, &|_, _, _| ())?;
        let placements = scene.at(0.0);
        frame.render(&placements, None)?;
        let most = |light: &mut dyn Iterator<Item = f64>| light.fold(0.0, f64::max);
        let worst = frame.bounced_beside_twin(&placements)?.map_or(f64::INFINITY, |[found, wanted]| {
            let pairs = || found.iter().zip(&wanted);
            let off = most(&mut pairs().map(|(found, wanted)| (*found - *wanted).abs().max_element()));
            off / most(&mut wanted.iter().map(|light| light.max_element()))
        });
        add(CheckRow::new("bounce", what, "of the brightest", worst, ROUNDING));
    }
    Ok(())
}
