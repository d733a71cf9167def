//! The merge on the device against its twin in f64, which reads the same stored numbers; and the barriers of a frame.

use crate::common::{Gpu, gpu, open, shown};
use crate::stage::{difference, scene, small};
use shadow_fields::asset::{Generator, embedded};
use shadow_fields::bake::Baker;
use shadow_fields::bake::silhouette::SilhouetteOptions;
use shadow_fields::check::merge::{ARITHMETIC, MIXED, against_twin};
use shadow_fields::check::sharp::sharp_options;
use shadow_fields::draw::{Antialias, Shading};
use shadow_fields::field::Storage;
use shadow_fields::frame::{self, Frame};
use shadow_fields::gpu::Device;
use shadow_fields::lists::skip::Skip;
use shadow_fields::merge::variant::Variant;
use shadow_fields::scene::{Placement, Scene};
use std::path::Path;
use std::sync::Arc;

fn agrees(what: &str, frame: &mut Frame, placements: &[Placement]) {
    let worst = against_twin(frame, placements).unwrap();
    assert!(worst < ARITHMETIC, "{what}: {worst:e} of the brightest radiosity");
}

/// A built-in scene, its floor made coarse.
fn built_in(name: &str, text: &str) -> Scene {
    let path = format!("assets/scenes/{name}.toml");
    let mut scene = Scene::parse(text, Path::new(&path), &embedded::read).unwrap();
    for mesh in &mut scene.data.meshes {
        if let Some(Generator::Plane { cells, .. }) = &mut mesh.generator {
            *cells = 24;
        }
    }
    Scene::parse(&scene.data.to_toml().unwrap(), Path::new(&path), &embedded::read).unwrap()
}

#[test]
fn built_in_scenes() {
    let Some(gpu) = gpu() else { return };
    let scenes = embedded::scenes();
    assert_eq!(scenes.len(), 7);
    // Of the room, 2 vertices of 27 000 differ by 0.003 and 0.0007: faces of boxes lie in the planes of others there.
    for (name, text) in scenes.into_iter().filter(|(name, _)| *name != "room") {
        let scene = built_in(name, text);
        let options =
            frame::Options { bake: shadow_fields::bake::Options { storage: Storage::F16, ..small().bake }, ..small() };
        let mut frame = gpu.frame(&scene, options);
        for time_s in [0.0, 1.7] {
            agrees(&format!("{name} at {time_s} s"), &mut frame, &scene.at(time_s));
        }
    }
}

/// Variants, skips and lattices are compared by `check`.
#[test]
fn other_bands() {
    let Some(gpu) = gpu() else { return };
    let scene = scene(MIXED);
    let placements = scene.at(0.0);
    let base = small();
    for bands in [2, 3, 5] {
        let bake = shadow_fields::bake::Options { bands, ..base.bake };
        agrees(&format!("{bands} bands"), &mut gpu.frame(&scene, frame::Options { bake, ..base }), &placements);
    }
}

const FLOOR_AND_BALL: &str = "[[mesh]]\nname = \"floor\"\nplane = { size_m = 4, cells = 20 }\n\
    [[mesh]]\nname = \"ball\"\nsphere = { radius_m = 0.5, subdivisions = 2 }\n[[entity]]\nmesh = \"floor\"\n";

#[test]
fn emitters_that_occlude_and_receive() {
    let Some(gpu) = gpu() else { return };
    let entity = |more: &str| format!("[[entity]]\nmesh = \"ball\"\n{more}\n");
    let two = |switches: &str| {
        let lit = entity(&format!("position = [-0.617, 0.731, 0.113]\nemission = [9, 7, 5]\n{switches}"));
        let far = entity("position = [1.3, 2.1, 0.2]\nscale = 0.5\nemission = [30, 40, 60]");
        scene(&format!("{FLOOR_AND_BALL}{lit}{far}"))
    };
    let (shining, blocking) = (two(""), two("occludes = true"));
    let placements = blocking.at(0.0);
    let mut frame = gpu.frame(&blocking, small());
    agrees("emitter that occludes", &mut frame, &placements);
    let blocked = gpu.light(&mut frame, &placements);
    let open = gpu.light(&mut gpu.frame(&shining, small()), &placements);
    let sum = |light: &[[f32; 3]]| light.iter().map(|v| v[2]).sum::<f32>();
    // Rays leave .970 of the floor's light; cones that only begin to meet count less, so the merge leaves .986.
    let left = sum(&blocked[0]) / sum(&open[0]);
    assert!(left < 0.988, "it takes the other light's place on the floor: {left}");
    assert_eq!(blocked[1], open[1], "it does not shade itself: the other light still falls on it");
    assert!(sum(&open[1]) > 0.0 && sum(&open[2]) > 0.0, "lights are lit by each other");

    let alone = scene(&format!("{FLOOR_AND_BALL}{}", entity("position = [0, 0.9, 0]\nemission = [9, 7, 5]")));
    let light = gpu.lit(&alone, small());
    assert!(light[1].iter().flatten().all(|b| *b == 0.0), "nothing is lit by its own light");
    assert!(sum(&light[0]) > 0.0);
}

/// On the floor's line x = 0 a light and its mirror image, an occluder, are equally far to the bit: the index decides.
#[test]
fn ties_go_by_index() {
    let Some(gpu) = gpu() else { return };
    let light = "[[entity]]\nmesh = \"ball\"\nposition = [0.55, 0.75, 0]\nemission = [9, 7, 5]\n";
    let block = "[[entity]]\nmesh = \"ball\"\nposition = [-0.55, 0.75, 0]\n";
    let line = |text: &str| {
        let scene = scene(&format!("{FLOOR_AND_BALL}{text}"));
        let mut frame = gpu.frame(&scene, small());
        agrees("tie", &mut frame, &scene.at(0.0));
        let floor = gpu.light(&mut frame, &scene.at(0.0)).swap_remove(0);
        let positions = &scene.meshes[0].positions;
        let on_line: Vec<_> = (0..floor.len()).filter(|&v| positions[v].x == 0.0).map(|v| floor[v]).collect();
        assert_eq!(on_line.len(), 21);
        on_line
    };
    let (before, after) = (line(&format!("{block}{light}")), line(&format!("{light}{block}")));
    let alone = line(light);
    assert_eq!(after, alone, "an occluder behind the light changes nothing");
    let (worst, _) = difference(&before, &alone);
    assert!(worst > 1e-3, "an occluder before the light counts: {worst:e}");
    // Two occluders equally far: swapping them changes the order of two products that commute but for truncation.
    let again = line(&format!("{block}{light}{block}"));
    assert_eq!(again, before, "of two equal occluders the one behind the light changes nothing");
}

/// A floor under so many balls, without skips, that its lists are longer than any other buffer; a small light, the sky.
fn crowd() -> (Scene, frame::Options) {
    let mut text = "environment = { uniform = [0.1, 0.2, 0.3] }\n\
        [[mesh]]\nname = \"floor\"\nplane = { size_m = 6, cells = 32 }\n\
        [[mesh]]\nname = \"box\"\ncuboid = { size_m = [0.2, 0.3, 0.2], cells = 1 }\n\
        [[mesh]]\nname = \"ball\"\nsphere = { radius_m = 0.11, subdivisions = 0 }\n\
        [[entity]]\nmesh = \"floor\"\nposition = [0, -1, 0]\n\
        [[entity]]\nmesh = \"box\"\nposition = [0.11, -0.3, 0.07]\nreceives = false\n\
        [[entity]]\nmesh = \"ball\"\nposition = [0.31, 2.07, 0.17]\nreceives = false\nemission = [300, 200, 100]\n"
        .to_owned();
    for i in 0..400 {
        let [x, z] = [i % 20, i / 20].map(|at| 0.27 * f64::from(at) - 2.53);
        let y = -0.7 + 0.01 * f64::from(i % 7);
        text += &format!("[[entity]]\nmesh = \"ball\"\nposition = [{x}, {y}, {z}]\nreceives = false\n");
    }
    let base = sharp_options();
    let silhouette = SilhouetteOptions { map_px: 8, ..base.bake.silhouette };
    let lattice = "cube:4x3".parse().unwrap();
    let bake = shadow_fields::bake::Options { storage: Storage::F16, lattice, silhouette, ..base.bake };
    (scene(&text), frame::Options { skip: Skip::NONE, antialias: Antialias::None, bake, ..base })
}

/// A device whose texel views are shorter than the lists of [`crowd`] and longer than everything else.
fn short_views() -> Arc<Device> {
    let mut device = open().unwrap();
    Arc::get_mut(&mut device).unwrap().limits.max_texel_buffer_elements = 8192;
    device
}

/// Lists that texel views cannot hold are read from storage blocks, in the very frame in which they are too long.
#[test]
fn lists_too_long_for_texel_views() {
    let Some(gpu) = gpu() else { return };
    let (scene, base) = crowd();
    let placements = scene.at(0.0);
    let variant = |name: &str| Some(Variant::named(name).unwrap());
    let expected = gpu.lit(&scene, frame::Options { variant: variant("storage"), ..base });
    let device = short_views();
    let baker = Baker::new(&device, &gpu.library);
    for name in ["texel-packed", "texel-shifted"] {
        let mut frame = gpu.frame_on(&baker, &scene, frame::Options { variant: variant(name), ..base });
        assert_eq!(frame.variant().name, name, "all but the lists has room");
        let found = gpu.light(&mut frame, &placements);
        assert_eq!(frame.variant().name, "storage", "{name}");
        let (worst, brightest) = difference(&found[0], &expected[0]);
        assert!(brightest > 0.1 && worst <= 2e-6 * (1.0 + brightest), "{name}: {worst:e} of {brightest}");
        assert_eq!(gpu.light(&mut frame, &placements), found, "{name}: a frame leaves nothing to the next");
    }
    assert_eq!(device.take_validation_messages(), [""; 0]);
}

/// Pixels whose chains texel views cannot hold leave sharp lights to vertices.
#[test]
fn chains_too_long_for_texel_views() {
    let Some(gpu) = gpu() else { return };
    let (scene, base) = crowd();
    let device = short_views();
    let baker = Baker::new(&device, &gpu.library);
    let picture = |baker: Option<&Baker>, shading: Shading| {
        let options = frame::Options { shading: Some(shading), size: [96, 64], ..base };
        let mut frame = baker.map_or_else(|| gpu.frame(&scene, options), |baker| gpu.frame_on(baker, &scene, options));
        shown(&mut frame, &scene.at(0.0), 1.0)
    };
    let by_vertex = picture(Some(&baker), Shading::Vertex);
    assert!(picture(Some(&baker), Shading::Pixel) == by_vertex, "vertices evaluate the light");
    assert!(picture(None, Shading::Pixel) != by_vertex, "where there is room, pixels evaluate the light");
    assert_eq!(device.take_validation_messages(), [""; 0]);
}

/// Every barrier of a frame is needed: left out, the frame is refused with pass and resource named, and nothing runs.
#[test]
fn every_barrier_is_needed() {
    let Some(gpu) = gpu() else { return };
    let scene = scene(MIXED);
    let mut frame = gpu.frame(&scene, small());
    let (rest, mut moved) = (scene.at(0.0), scene.at(0.0));
    moved[1].position.x += 0.3;
    frame.render(&rest, Some(1.0)).unwrap();
    let light = frame.radiosity(0).unwrap();
    let picture = frame.picture();
    let refused = |frame: &mut Frame, gpu: &Gpu, index: usize| {
        let outcome = gpu.without_barrier(index, || frame.render(&moved, Some(1.0)));
        // The layer hears most of these while they are recorded, but not a dispatch after a dispatch on one buffer.
        let _ = gpu.device.take_validation_messages();
        outcome.err().map(|error| error.to_string())
    };
    let expected = [
        // Vertices of triangles, and what fragments of a grid look up.
        ("radiosity", "pass merge and pass draw"),
        ("radiosity", "pass merge and pass draw"),
        ("picture", "pass draw and pass read back"),
        ("readback", "pass read back and pass host"),
    ];
    for (index, (resource, passes)) in expected.into_iter().enumerate() {
        let message = refused(&mut frame, &gpu, index).unwrap_or_else(|| panic!("barrier {index} is not missed"));
        assert!(message.contains(resource) && message.contains(passes), "barrier {index}: {message}");
        assert_eq!(frame.radiosity(0).unwrap(), light, "nothing was submitted");
        assert_eq!(frame.picture(), picture, "nothing was submitted");
    }
    assert_eq!(refused(&mut frame, &gpu, expected.len()), None, "there are no more barriers than these");
    assert_ne!(frame.radiosity(0).unwrap(), light, "with all barriers it runs");
}
