//! "merge" against its twin in f64, which reads the same stored numbers: every variant, skip, number format and kind
//! of lattice.

use super::CheckRow;
use crate::asset::embedded;
use crate::bake::cache::Cache;
use crate::bake::{self, Baker};
use crate::bounce::Bounces;
use crate::draw::Shading;
use crate::error::Result;
use crate::field::Storage;
use crate::frame::{self, Frame};
use crate::lists::skip::Skip;
use crate::merge::Variant;
use crate::merge::variant::VARIANTS;
use crate::scene::{Lights, Placement, Scene};
use std::path::Path;

/// Differences of f32 arithmetic between device and twin: some 20 products and rotations of numbers around the
/// brightest radiosity, each off by 6e-8 of it. The stored numbers are the same in both, f16 or not.
pub const ARITHMETIC: f64 = 1e-5;

/// A floor, a wall that stands on it, a ball that is lit and shades itself with a ring, two lights of which one has
/// colours of its own, and a sky. Positions are odd, so that no vertex lies on a border between samples.
pub const MIXED: &str = r#"
environment = { uniform = [0.1, 0.12, 0.2], key = { radiance = [2, 1.5, 1], toward = [1, 2, 0.5], sharpness = 3 } }
[[mesh]]
name = "floor"
plane = { size_m = 7, cells = 20 }
[[mesh]]
name = "ball"
sphere = { radius_m = 0.5, subdivisions = 2 }
[[mesh]]
name = "ring"
torus = { major_m = 0.5, minor_m = 0.2, segments = 16, sides = 8 }
[[mesh]]
name = "glow"
torus_two_colour = { major_m = 0.4, minor_m = 0.1, segments = 16, sides = 8 }
[[entity]]
mesh = "floor"
[[entity]]
mesh = "ball"
position = [-0.713, 0.667, 0.119]
[[entity]]
mesh = "ring"
position = [0.613, 0.871, -0.379]
rotation = { axis = [1, 0.3, -0.4], angle_deg = 67 }
scale = 0.8
[[entity]]
mesh = "glow"
position = [0.177, 1.731, 0.913]
rotation = { axis = [0.2, 0.9, 0.5], angle_deg = 41 }
emission = [5, 6, 7]
[[entity]]
mesh = "ball"
position = [1.513, 2.177, 0.691]
scale = 0.4
emission = [20, 15, 10]
[[mesh]]
name = "wall"
plane = { size_m = 1.4, cells = 5 }
[[entity]]
mesh = "wall"
position = [-1.431, 0.7, 0.231]
rotation = { axis = [0, 0, 1], angle_deg = 90 }
"#;

/// A scene from the text of its meshes, entities and sky; a camera is added.
pub fn scene(text: &str) -> Result<Scene> {
    let text = format!("{text}\n[camera]\neye = [0, 2, 5]\ntarget = [0, 0.5, 0]\n");
    Scene::parse(&text, Path::new("assets/scenes/check.toml"), &embedded::read)
}

/// Few samples of few texels in f32: quick, and all that a comparison with a twin needs. The variant is pinned.
pub fn options() -> frame::Options {
    let lattice = "cube:6x5".parse().expect("a lattice");
    frame::Options {
        bake: bake::Options { storage: Storage::F32, lattice, face_px: 16, ..Default::default() },
        lights: Lights::Sh,
        shading: Some(Shading::Vertex),
        variant: Some(Variant::named("texel-packed").expect("a variant")),
        eps: 0.0,
        size: [64, 48],
        bounces: Bounces::None,
        ..frame::Options::default()
    }
}

/// Lights the scene on the device and in f64: the largest difference of a lit vertex, as a share of 1 + the brightest
/// radiosity; infinite where a number is not finite, or all is dark.
pub fn against_twin(frame: &mut Frame, placements: &[Placement]) -> Result<f64> {
    frame.render(placements, None)?;
    let twin = frame.twin(placements)?;
    let mut worst = 0.0_f64;
    let brightest = twin.iter().flat_map(|(_, v)| v.iter().flatten()).fold(0.0_f64, |m, b| m.max(b.abs()));
    for (entity, expected) in &twin {
        let found = frame.radiosity(*entity)?;
        assert_eq!(found.len(), expected.len(), "vertices of entity {entity}");
        for (found, expected) in found.iter().zip(expected) {
            let difference = |c: usize| (f64::from(found[c]) - expected[c]).abs() / (1.0 + brightest);
            let error =
                (0..3).map(difference).fold(0.0, |m, e| if e.is_nan() { f64::INFINITY } else { f64::max(m, e) });
            worst = worst.max(error);
        }
    }
    Ok(if brightest > 0.01 { worst } else { f64::INFINITY })
}

/// A room that is open to the front, with a table, in which a ring moves.
pub const ROOM: &str = r#"
environment = { gradient = { radiance = [1, 0.9, 0.8] } }
mesh = [
    { name = "plane", plane = { size_m = 2, cells = 4 } },
    { name = "top", cuboid = { size_m = [0.8, 0.06, 0.5], cells = 4 } },
    { name = "ring", torus = { major_m = 0.15, minor_m = 0.07, segments = 24, sides = 12 } },
]
entity = [
    { mesh = "plane" },
    { mesh = "plane", position = [0, 2, 0], rotation = { axis = [1, 0, 0], angle_deg = 180 } },
    { mesh = "plane", position = [0, 1, -1], rotation = { axis = [1, 0, 0], angle_deg = 90 } },
    { mesh = "plane", position = [-1, 1, 0], rotation = { axis = [0, 0, 1], angle_deg = -90 } },
    { mesh = "plane", position = [1, 1, 0], rotation = { axis = [0, 0, 1], angle_deg = 90 } },
    { mesh = "top", position = [0.3, 0.6, -0.5] },
    { mesh = "ring", position = [0, 1.1, 0], motion = [{ bob = { axis = [0.2, 0.1, 1], amplitude_m = 0.7, period_s = 4 } }] },
]
"#;

/// A ring that lets light through, beside [`MIXED`].
const GLASS: &str = "[[entity]]\nmesh = \"ring\"\nposition = [0.317, 0.413, 0.519]\nscale = 0.5\nopacity = 0.6\n";

/// The lattices that are tried besides the pinned one.
const LATTICES: [&str; 4] = ["cube:5x3,inner=0.5,outer=5", "cube:1x1", "cube:5x3,edges", "cube:4x5"];

pub fn rows(baker: &Baker, add: &mut dyn FnMut(CheckRow)) -> Result<()> {
    let mixed = scene(&format!("{MIXED}{GLASS}"))?;
    let placements = mixed.at(0.0);
    // Fields are baked once for all rows, by the device under test; nothing is read from disk.
    let cache = Cache::new(None);
    let mut compare = |what: String, options: frame::Options| -> Result<()> {
        let mut frame = Frame::new(baker, &cache, &mixed, options, &|_, _, _| ())?;
        let worst = against_twin(&mut frame, &placements)?;
        let what = if options.variant.is_none_or(|v| v == frame.variant()) {
            what
        } else {
            format!("{what} (as {}: the device's limits)", frame.variant().name)
        };
        add(CheckRow::new("merge", what, "of 1 + brightest", worst, ARITHMETIC));
        Ok(())
    };
    let base = options();
    for &variant in VARIANTS {
        for storage in [Storage::F32, Storage::F16] {
            let bake = bake::Options { storage, ..base.bake };
            let what = format!("{}, {}", variant.name, format!("{storage:?}").to_lowercase());
            compare(what, frame::Options { variant: Some(variant), bake, ..base })?;
        }
    }
    compare("no skip".into(), frame::Options { skip: Skip::NONE, ..base })?;
    for name in ["cones", "horizon", "caps"] {
        compare(format!("without {name}"), frame::Options { skip: Skip::without(name), ..base })?;
    }
    for lattice in LATTICES {
        let bake = bake::Options { lattice: lattice.parse().expect("a lattice in the table"), ..base.bake };
        compare(lattice.into(), frame::Options { bake, ..base })?;
    }
    let room = scene(ROOM)?;
    let ring = room.entities.len() - 1;
    let bake = bake::Options { groups: true, ..base.bake };
    let mut frame = Frame::new(baker, &cache, &room, frame::Options { bake, ..base }, &|_, _, _| ())?;
    for (what, z) in [("within a volume", 0.113), ("at the side of a volume", 0.987)] {
        let mut placements = room.at(0.0);
        placements[ring].position.z = z;
        let worst = against_twin(&mut frame, &placements)?;
        add(CheckRow::new("merge", what, "of 1 + brightest", worst, ARITHMETIC));
    }
    Ok(())
}
