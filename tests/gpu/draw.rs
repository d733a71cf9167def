//! Pictures: what stands where, what hides what, and in which colour.

use crate::common::{Gpu, gpu, relative_rms, shown};
use crate::stage::{at, holed, scene, shines, small, stands};
use glam::{DVec2, EulerRot, Quat, Vec2, Vec3};
use shadow_fields::asset::environment::EnvironmentData;
use shadow_fields::asset::mesh::Attributes;
use shadow_fields::asset::texture::Texture;
use shadow_fields::asset::{Generator, Mesh};
use shadow_fields::bake::Baker;
use shadow_fields::check::sharp::sharp_options;
use shadow_fields::draw::Antialias;
use shadow_fields::draw::camera::through_pixels;
use shadow_fields::frame;
use shadow_fields::scene::{Albedo, Camera, EntityData, Placement, Scene};
use shadow_fields::shaders::Library;

const WIDTH: usize = 96;
const HEIGHT: usize = 64;

fn options(antialias: Antialias) -> frame::Options {
    frame::Options { size: [WIDTH as u32, HEIGHT as u32], antialias, ..small() }
}

/// Balls of radius .4 m that shine and are not lit, seen from z = 5 m along -z.
fn balls(environment: &str, emissions: &[[f32; 3]]) -> Scene {
    let mut text =
        format!("{environment}\n[[mesh]]\nname = \"ball\"\nsphere = {{ radius_m = 0.4, subdivisions = 3 }}\n");
    for emission in emissions {
        text += &format!("[[entity]]\nmesh = \"ball\"\nreceives = false\nemission = {emission:?}\n");
    }
    scene(&text)
}

type Picture = Vec<[f32; 3]>;

fn draw(gpu: &Gpu, scene: &Scene, places: &[[f32; 3]], antialias: Antialias, white: f32) -> Picture {
    let placements: Vec<_> = places.iter().map(|&[x, y, z]| at(x, y, z)).collect();
    let mut frame = gpu.frame(scene, options(antialias));
    shown(&mut frame, &placements, white).as_chunks().0.to_vec()
}

/// Middle of what has a channel, in pixels from the left and the top, and its area in pixels.
fn middle(picture: &Picture, channel: usize) -> [f32; 3] {
    let mut sum = [0.0; 3];
    for (i, pixel) in picture.iter().enumerate() {
        let weight = pixel[channel];
        let place = [(i % WIDTH) as f32 + 0.5, (i / WIDTH) as f32 + 0.5, 1.0];
        (0..3).for_each(|k| sum[k] += weight * place[k]);
    }
    [sum[0] / sum[2], sum[1] / sum[2], sum[2]]
}

const RED: [f32; 3] = [1.0, 0.0, 0.0];
const BLUE: [f32; 3] = [0.0, 0.0, 1.0];

#[test]
fn things_stand_where_they_should() {
    let Some(gpu) = gpu() else { return };
    let scene = balls("", &[RED]);
    // 40 degrees over 64 pixels at 5 m: 17.58 pixels a metre.
    let px_per_m = HEIGHT as f32 / (2.0 * 5.0 * 20_f32.to_radians().tan());
    let see = |place| middle(&draw(&gpu, &scene, &[place], Antialias::Samples, 1.0), 0);
    for (place, x, y) in [
        ([0.0, 0.0, 0.0], 0.0, 0.0),
        ([1.0, 0.0, 0.0], 1.0, 0.0),
        ([0.0, 1.0, 0.0], 0.0, -1.0),
        ([-1.5, -0.8, 0.0], -1.5, 0.8),
    ] {
        let [found_x, found_y, area] = see(place);
        let expected = [WIDTH as f32 / 2.0 + px_per_m * x, HEIGHT as f32 / 2.0 + px_per_m * y];
        // A sphere off the axis is seen as an ellipse whose middle lies a little further out.
        let tolerance = 0.1 + 0.25 * (x * x + y * y);
        let off = [found_x - expected[0], found_y - expected[1]].map(f32::abs);
        assert!(off.iter().all(|off| *off < tolerance), "{place:?}: at {found_x}, {found_y} for {expected:?}");
        let disc = std::f32::consts::PI * (0.4 * px_per_m).powi(2);
        assert!((area / disc - 1.0).abs() < 0.08, "{area} of {disc} pixels");
    }
    let larger = see([0.0, 0.0, 2.5])[2] / see([0.0, 0.0, 0.0])[2];
    assert!((3.6..4.4).contains(&larger), "half as far, four times the area: {larger}");
}

#[test]
fn nearer_hides_farther() {
    let Some(gpu) = gpu() else { return };
    let scene = balls("", &[RED, BLUE]);
    let centre = WIDTH / 2 + HEIGHT / 2 * WIDTH;
    // Large balls 300 m away, 1 cm one behind the other: reversed depth in f32 tells them apart.
    let mut frame = gpu.frame(&scene, options(Antialias::Samples));
    let far = |z| Placement { scale: 40.0, ..at(0.0, 0.0, z) };
    for (placements, front) in [([far(-300.0), far(-300.01)], RED), ([far(-300.01), far(-300.0)], BLUE)] {
        let picture = shown(&mut frame, &placements, 1.0);
        let found = picture[3 * centre..][..3].iter().map(|c| c.round()).collect::<Vec<_>>();
        assert_eq!(found, front);
    }
    let behind = draw(&gpu, &scene, &[[0.0, 0.0, 7.0], [0.0, 0.0, 6.0]], Antialias::Samples, 1.0);
    assert!(behind.iter().flatten().all(|c| *c == 0.0), "what is behind the camera is not seen");
}

/// Nothing in view is a picture of the sky alone, and what comes back into view is drawn again.
#[test]
fn nothing_in_view_is_a_picture_too() {
    let Some(gpu) = gpu() else { return };
    let sky = "environment = { uniform = [0.1, 0.2, 0.3], gradient = { radiance = [1, 0.5, 0] } }";
    let scene = balls(sky, &[RED, BLUE]);
    let through = through_pixels(&scene.data.camera, [WIDTH as f64, HEIGHT as f64]);
    let is_sky = |(pixel, found): (usize, &[f32; 3])| {
        let toward = through([(pixel % WIDTH) as f64 + 0.5, (pixel / WIDTH) as f64 + 0.5]);
        let wanted = Vec3::new(0.1, 0.2, 0.3) + (0.2 + 0.8 * toward.y.max(0.0) as f32) * Vec3::new(1.0, 0.5, 0.0);
        // Texels are 0.35 degrees wide, and half floats have 11 bits.
        Vec3::from_array(*found).distance(wanted) < 5e-3
    };
    let is_background = |picture: &[f32]| picture.as_chunks().0.iter().enumerate().all(is_sky);
    let (seen, unseen) = ([at(-0.5, 0.0, 0.0), at(0.5, 0.2, 0.0)], [at(0.0, 0.0, 9.0), at(0.0, 1.0, 9.0)]);
    for antialias in [Antialias::None, Antialias::Samples, Antialias::Outlines] {
        let mut frame = gpu.frame(&scene, options(antialias));
        assert!(is_background(&shown(&mut frame, &unseen, 1.0)), "{antialias:?}: nothing in the first picture");
        let first = shown(&mut frame, &seen, 1.0);
        assert!(!is_background(&first), "{antialias:?}: something is seen");
        assert!(is_background(&shown(&mut frame, &unseen, 1.0)), "{antialias:?}: nothing is seen any more");
        frame.show(&unseen, 1.0).unwrap();
        assert!(shown(&mut frame, &seen, 1.0) == first, "{antialias:?}: what comes back is as it was");
    }
}

/// A picture that several render passes make is the one of a single pass, with samples and without.
#[test]
fn batches_change_nothing() {
    let Some(gpu) = gpu() else { return };
    let scene = balls("", &[[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]);
    let placements = [at(-0.3, 0.0, 0.0), at(0.3, 0.2, 0.5)];
    for antialias in [Antialias::None, Antialias::Samples, Antialias::Outlines] {
        let mut frame = gpu.frame(&scene, options(antialias));
        let whole = shown(&mut frame, &placements, 1.0);
        assert!(whole.iter().any(|c| *c > 0.5));
        for triangles in [1000, 37] {
            frame.set_batch(triangles);
            assert!(shown(&mut frame, &placements, 1.0) == whole, "batches of {triangles}, {antialias:?}");
        }
    }
}

/// A ball before another, a box with creases and a floor that ends in sight, judged by 64 samples a pixel.
#[test]
fn outlines_are_smoother_than_four_samples() {
    let Some(gpu) = gpu() else { return };
    let ball = |color: &str| format!("[[entity]]\nmesh = \"ball\"\nreceives = false\nemission = {color}\n");
    let text = "environment = { key = { radiance = [3, 3, 3], toward = [1, 2, 3], sharpness = 2 } }\n\
        [[mesh]]\nname = \"ball\"\nsphere = { radius_m = 0.4, subdivisions = 3 }\n\
        [[mesh]]\nname = \"box\"\ncuboid = { size_m = [0.8, 0.8, 0.8], cells = 1 }\n\
        [[mesh]]\nname = \"floor\"\nplane = { size_m = 3, cells = 4 }\n\
        [[entity]]\nmesh = \"box\"\n[[entity]]\nmesh = \"floor\"\nalbedo = [0.3, 0.6, 0.3]\n";
    let scene = scene(&(text.to_owned() + &ball("[0.9, 0.5, 0.3]") + &ball("[0.2, 0.6, 0.9]")));
    let turned = Quat::from_euler(EulerRot::YXZ, 0.5, 0.6, 0.2);
    let tilted = Quat::from_rotation_x(0.4);
    let placements = [
        Placement { rotation: turned, ..at(0.6, 0.3, 0.3) },
        Placement { rotation: tilted, ..at(0.1, -0.4, 0.0) },
        at(-0.8, 0.2, 0.0),
        at(-0.5, 0.4, -0.6),
    ];
    let grid: Vec<DVec2> = (0..64).map(|i| (DVec2::new(f64::from(i % 8), f64::from(i / 8)) + 0.5) / 8.0).collect();
    let mut wanted = Vec::new();
    let [none, samples, outlines] = [Antialias::None, Antialias::Samples, Antialias::Outlines].map(|antialias| {
        let mut frame = gpu.frame(&scene, options(antialias));
        frame.render(&placements, Some(1.0)).unwrap();
        if wanted.is_empty() {
            wanted = frame.twin_texels(&placements, 1.0, &grid).unwrap();
        }
        let found = frame.picture().into_iter().map(f64::from);
        relative_rms(found.zip(wanted.iter().flat_map(|texel| texel.color.to_array())))
    });
    let are_smooth = samples < 0.6 * none && outlines < 0.4 * none && outlines < samples;
    assert!(are_smooth, "none {none}, samples {samples}, outlines {outlines}");
}

/// Slivers at every angle, 0.02 to 1 pixel wide: with four samples a pixel none is brighter than its brightest vertex,
/// as it is where the values of vertices are extrapolated to a pixel's centre outside.
#[test]
fn slivers_are_no_brighter_than_their_vertices() {
    let Some(gpu) = gpu() else { return };
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in shadow_fields::shaders::FILES.iter().filter(|(name, _)| name.ends_with(".frag")) {
        std::fs::write(folder.path().join(name), text.replace("centroid ", "")).unwrap();
    }
    let library = Library { shader_dir: Some(folder.path().to_path_buf()), ..gpu.library.clone() };
    let extrapolating = Baker::new(&gpu.device, &library);
    let most = 0.5;
    let mut positions = Vec::new();
    let mut colors = Vec::new();
    for i in 0..720 {
        let turn = Quat::from_rotation_z(std::f32::consts::TAU / 720.0 * i as f32);
        let place = Vec3::new((i % 36) as f32 * 0.14 - 2.5, (i / 36) as f32 * 0.16 - 1.5, 0.0);
        let width_m = 0.001 * 1.2_f32.powi(i % 23);
        for (x, y, color) in [(-0.1, 0.0, 0.02), (0.1, 0.0, 0.02), (0.03, width_m, most)] {
            positions.push(place + turn * Vec3::new(x, y, 0.0));
            colors.push(Vec3::splat(color));
        }
    }
    let triangles = (0..720).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    let mesh = Mesh::new("slivers", positions, Vec::new(), Some(colors), triangles).unwrap();
    let slivers = EntityData {
        emission: Vec3::ONE,
        emits: Some(false),
        receives: Some(false),
        occludes: Some(false),
        ..EntityData::of_mesh("slivers")
    };
    let scene = Scene::builder().camera(Camera::new([0.0, 0.0, 5.0], [0.0; 3])).mesh("slivers", mesh).entity(slivers);
    let scene = scene.build().unwrap();
    let options = options(Antialias::Samples);
    let frames = [gpu.frame(&scene, options), gpu.frame_on(&extrapolating, &scene, options)];
    let [within, beyond] =
        frames.map(|mut frame| shown(&mut frame, &scene.at(0.0), f32::INFINITY).into_iter().fold(0.0, f32::max));
    assert!((0.2..most + 1e-3).contains(&within), "{within}");
    assert!(beyond > 2.0 * most, "the slivers are no test: {beyond}");
}

/// Lines of what is hidden leave no trace, also where the same entity hides itself.
#[test]
fn hidden_outlines_leave_no_trace() {
    let Some(gpu) = gpu() else { return };
    let scene = balls("environment = { uniform = [0.1, 0.1, 0.1] }", &[RED, BLUE]);
    let picture = |place| draw(&gpu, &scene, &[[0.0, 0.0, 1.0], place], Antialias::Outlines, 1.0);
    assert!(picture([0.0, 0.0, -1.0]) == picture([0.0, 0.0, 9.0]), "behind the first and behind the camera");
    assert!(picture([0.5, 0.0, -1.0]) != picture([0.0, 0.0, 9.0]), "beside it, it is seen");
}

/// A quad of two triangles with the whole of a texture on it.
fn quad(corners: [[f32; 3]; 4], tints: Option<Vec<Vec3>>) -> Mesh {
    let uvs = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(Vec2::from).to_vec();
    let attributes = Attributes { uvs: Some(uvs), tints, ..Attributes::default() };
    let corners = corners.map(Vec3::from).to_vec();
    Mesh::with_attributes("quad", corners, Vec::new(), attributes, vec![[0, 1, 2], [0, 2, 3]]).unwrap()
}

/// A texel shows its share of a grey surface's light, whoever evaluates a sharp light; what alpha masks is not there.
#[test]
fn textures_multiply_the_light_of_a_grey_surface() {
    let Some(gpu) = gpu() else { return };
    let wall = |albedo: Albedo| {
        let corners = [[-2.0, -2.0, 0.0], [2.0, -2.0, 0.0], [2.0, 2.0, 0.0], [-2.0, 2.0, 0.0]];
        let mesh = quad(corners, Some(vec![Vec3::new(1.0, 0.25, 1.0); 4]));
        let rgba = vec![[255, 0, 0, 255], [0, 255, 0, 255], [0, 0, 255, 255], [255, 255, 255, 100]];
        let texture = Texture { factor: Vec3::new(0.5, 1.0, 1.0), ..holed(2, rgba) };
        let lamp = Generator::Sphere { radius_m: 0.1, subdivisions: 2 };
        let environment = EnvironmentData { uniform: Some(Vec3::splat(0.2)), ..EnvironmentData::default() };
        let scene = Scene::builder()
            .camera(Camera::new([0.0, 0.0, 5.0], [0.0; 3]))
            .environment(environment)
            .texture("four", texture)
            .mesh("wall", mesh)
            .mesh("ball", lamp)
            .entity(EntityData { albedo, ..EntityData::of_mesh("wall") })
            .entity(EntityData { scale: 2.0, ..stands("ball", [0.5, 0.2, 0.6]) })
            .entity(shines("ball", [1.0, 1.0, 2.0], 40.0));
        let scene = scene.build().unwrap();
        let size = [WIDTH as u32, HEIGHT as u32];
        let mut frame =
            gpu.frame(&scene, frame::Options { size, antialias: Antialias::Samples, shading: None, ..sharp_options() });
        let timings = frame.render(&scene.at(0.0), Some(f32::INFINITY)).unwrap();
        let evaluated = timings.iter().find_map(|timing| timing.counted).unwrap();
        assert!(evaluated > 100, "no pixel evaluates a light");
        frame.picture()
    };
    let grey = wall(Albedo::Color(Vec3::splat(0.5)));
    let painted = wall(Albedo::Texture("four".into()));
    let sky = &painted[..3];
    let mut compared = [0; 4];
    for (i, (grey, painted)) in grey.chunks_exact(3).zip(painted.chunks_exact(3)).enumerate() {
        // Metres from the middle of the wall.
        let x = 5.0 * 20.0_f32.to_radians().tan() * ((i % WIDTH) as f32 + 0.5 - 48.0) / 32.0;
        let y = 5.0 * 20.0_f32.to_radians().tan() * (32.0 - (i / WIDTH) as f32 - 0.5) / 32.0;
        // Texels are constant a quarter from the edge outwards; the balls hide the rest.
        let within = |c: f32| (1.1..1.7).contains(&c.abs());
        if !within(x) || !within(y) || x > 0.0 && y > 0.0 {
            continue;
        }
        let quarter = usize::from(x > 0.0) + 2 * usize::from(y < 0.0);
        let texel = [[0.5, 0.0, 0.0], [0.0, 0.25, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, 0.0]][quarter];
        for c in 0..3 {
            // The corner of the picture shows the sky.
            let expected = if quarter == 3 { sky[c] } else { grey[c] * texel[c] / 0.5 };
            let off = (painted[c] - expected).abs();
            assert!(off < 4e-3 * grey[c].max(0.1), "{painted:?} for {texel:?} of {grey:?} at {x}, {y}");
        }
        compared[quarter] += 1;
    }
    assert!(compared[0].min(compared[2]).min(compared[3]) > 20, "{compared:?}");
}

/// A floor with a texture of that many texels along a side, seen in even light.
fn floor(camera: Camera, corners: [[f32; 3]; 4], side: usize, rgba: Vec<[u8; 4]>) -> Scene {
    Scene::builder()
        .camera(camera)
        .environment(EnvironmentData { uniform: Some(Vec3::ONE), ..EnvironmentData::default() })
        .texture("paint", Texture { alpha_cutoff: None, ..holed(side, rgba) })
        .mesh("floor", quad(corners, None))
        .entity(EntityData { albedo: Albedo::Texture("paint".into()), ..EntityData::of_mesh("floor") })
        .build()
        .unwrap()
}

/// Far from edges a texture looks the same with four samples a pixel as with one, also where it is seen slanted.
#[test]
fn textures_are_even_under_four_samples() {
    let Some(gpu) = gpu() else { return };
    let corners = [[-2.0, -1.0, 2.0], [2.0, -1.0, 2.0], [2.0, 0.5, -8.0], [-2.0, 0.5, -8.0]];
    let checks = (0..16 * 16).map(|i| [255 * (i as u8 % 2), 255 * (i / 16 % 2) as u8, 0, 255]).collect();
    let scene = floor(Camera::new([0.0, 0.5, 5.0], [0.0, -0.2, 0.0]), corners, 16, checks);
    let [one, four] =
        [Antialias::None, Antialias::Samples].map(|antialias| gpu.picture(&scene, options(antialias), f32::INFINITY));
    let mut compared = 0;
    for (one, four) in one.chunks_exact(3).zip(four.chunks_exact(3)) {
        // The sky is blue too; a pixel of an edge has some of it.
        if one[2] == 0.0 && four[2] == 0.0 {
            assert!((one[0] - four[0]).abs().max((one[1] - four[1]).abs()) < 0.01, "{one:?} and {four:?}");
            compared += 1;
        }
    }
    assert!(compared > 1000, "{compared} pixels");
}

/// Stripes that run away from the eye stay apart where a pixel covers many of their texels, but all along one.
#[test]
fn stripes_seen_along_them_stay_apart() {
    let Some(gpu) = gpu() else { return };
    let corners = [[-2.0, -1.0, 2.0], [2.0, -1.0, 2.0], [2.0, -1.0, -8.0], [-2.0, -1.0, -8.0]];
    let stripe_m = 0.25;
    let stripes = (0..64 * 64).map(|i| if i % 64 / 4 % 2 == 0 { [0, 0, 0, 255] } else { [255; 4] }).collect();
    let scene = floor(Camera::new([0.0, -0.7, 5.0], [0.0, -0.7, 0.0]), corners, 64, stripes);
    for antialias in [Antialias::None, Antialias::Samples] {
        let picture = gpu.picture(&scene, options(antialias), f32::INFINITY);
        let mut off = 0.0;
        let mut compared = 0;
        for (i, pixel) in picture.chunks_exact(3).enumerate() {
            let slope = 20.0_f32.to_radians().tan() / 32.0;
            let down = slope * ((i / WIDTH) as f32 + 0.5 - 32.0);
            let away = 0.3 / down;
            let stripes = (2.0 + away * slope * ((i % WIDTH) as f32 + 0.5 - 48.0)) / stripe_m;
            // A pixel of an edge has some of both.
            let inside = stripes.fract().min(1.0 - stripes.fract()) * stripe_m / (away * slope);
            if (3.5..8.0).contains(&away) && (0.5..15.5).contains(&stripes) && inside > 1.0 {
                off += (pixel[0] - (stripes.floor() % 2.0)).abs();
                compared += 1;
            }
        }
        let mean = off / compared as f32;
        assert!(compared > 60 && mean < 0.1, "{antialias:?}: {compared} pixels, off by {mean}");
    }
}
