//! What tests share: one validated device a test binary, used by one test at a time, with a cache of fields that lives as
//! long as the binary, and helpers.
//!
//! With SHADOW_FIELDS_REQUIRE_DEVICE=1 a missing device, validation layer or tool fails the tests; without it they are
//! skipped with a line on stderr.

#![allow(dead_code, unused_imports)] // every test binary uses its own part

pub use shadow_fields::asset::generate;

use glam::{DVec3, Vec3};
use shadow_fields::asset::{Mesh, embedded};
use shadow_fields::bake::cache::Cache;
use shadow_fields::bake::{self, Baker};
use shadow_fields::farm::{Film, Input, Plan};
use shadow_fields::frame::{self, Frame};
use shadow_fields::gpu::{Device, DeviceOptions, Validation};
use shadow_fields::scene::{Placement, Scene};
use shadow_fields::sh::basis::MAX_BANDS;
use shadow_fields::sh::lobe::zonal;
use shadow_fields::shaders::Library;
use std::f64::consts::PI;
use std::path::{Path, PathBuf};
use std::process::Child;
use std::sync::{Arc, Mutex, MutexGuard, OnceLock};

/// Whether what is missing is a failure rather than a reason to skip.
pub fn required() -> bool {
    std::env::var_os("SHADOW_FIELDS_REQUIRE_DEVICE").is_some_and(|value| value == "1")
}

/// Says why a test does nothing, or fails where it has to do something.
#[allow(clippy::print_stderr)]
pub fn skip(reason: &str) {
    assert!(!required(), "SHADOW_FIELDS_REQUIRE_DEVICE=1, but: {reason}");
    eprintln!("skipped: {reason}");
}

/// A figure for people; seen with `--nocapture`.
#[allow(clippy::print_stderr)]
pub fn report(line: &str) {
    eprintln!("{line}");
}

/// The built-in teapot, which is open.
pub fn teapot() -> Mesh {
    let path = Path::new("assets/meshes/teapot.obj");
    Mesh::parse(&embedded::read(path).unwrap(), path).unwrap()
}

/// The zonal coefficients of a cap about +z whose half angle has the cosine `c`: 1 inside, 0 outside.
///
/// z_0 = sqrt(pi) (1 - c), z_l = sqrt(pi / (2l + 1)) (P_l-1(c) - P_l+1(c)), the integral of Y_l0 over the cap.
fn cap_zonal(bands: usize, c: f64) -> Vec<f64> {
    let mut legendre = [1.0, c, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    for l in 2..=bands.min(MAX_BANDS) {
        let lf = l as f64;
        legendre[l] = ((2.0 * lf - 1.0) * c * legendre[l - 1] - (lf - 1.0) * legendre[l - 2]) / lf;
    }
    let band = |l: usize| (PI / (2 * l + 1) as f64).sqrt() * (legendre[l - 1] - legendre[l + 1]);
    (0..bands).map(|l| if l == 0 { PI.sqrt() * (1.0 - c) } else { band(l) }).collect()
}

/// The blocked part of a cap: the SH of 1 within `half_angle_rad` (0 to pi) of the unit vector `axis`, 0 elsewhere.
pub fn cap(bands: usize, axis: DVec3, half_angle_rad: f64) -> Vec<f64> {
    zonal(bands, &cap_zonal(bands, half_angle_rad.cos()), axis)
}

/// Names in a folder, sorted.
pub fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).unwrap();
    let mut names: Vec<_> = entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

/// Everything in a folder and below, folders too.
pub fn paths_below(folder: &Path) -> Vec<PathBuf> {
    let mut out = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display())) {
        let path = entry.unwrap().path();
        if path.is_dir() {
            out.extend(paths_below(&path));
        }
        out.push(path);
    }
    out
}

/// A program that is ended with the test.
pub struct Running(pub Child);

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Folder that all tests share for compiled shaders and pipelines.
pub fn cache_dir() -> PathBuf {
    Path::new(env!("CARGO_TARGET_TMPDIR")).join("cache")
}

pub fn library() -> Library {
    Library { shader_dir: None, cache_dir: Some(cache_dir()) }
}

/// Another device like the one that the tests share.
pub fn open() -> shadow_fields::Result<Arc<Device>> {
    Device::new(&DeviceOptions { device: None, validation: Validation::Sync, cache_dir: Some(cache_dir()) })
}

/// The device of this test binary, held by one test, which fails at the end if the validation layer said anything.
pub struct Gpu {
    pub device: Arc<Device>,
    pub library: Library,
    _turn: MutexGuard<'static, ()>,
}

/// Waits for this test's turn with the device; `None` when the test is to be skipped.
pub fn gpu() -> Option<Gpu> {
    static DEVICE: OnceLock<Result<Arc<Device>, String>> = OnceLock::new();
    static TURN: Mutex<()> = Mutex::new(());
    let turn = TURN.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
    match DEVICE.get_or_init(|| open().map_err(|error| error.to_string())) {
        Ok(device) => Some(Gpu { device: device.clone(), library: library(), _turn: turn }),
        Err(error) => {
            skip(error);
            None
        }
    }
}

impl Drop for Gpu {
    fn drop(&mut self) {
        let messages = self.device.take_validation_messages();
        self.device.save_pipeline_cache();
        if !std::thread::panicking() {
            assert!(messages.is_empty(), "the validation layer said: {}", messages.join("\n"));
        }
    }
}

impl Gpu {
    pub fn baker(&self) -> Baker {
        Baker::new(&self.device, &self.library)
    }

    /// A scene on the shared device, its fields baked.
    pub fn frame(&self, scene: &Scene, options: frame::Options) -> Frame {
        self.frame_on(&self.baker(), scene, options)
    }

    /// The same on the device of another baker, by the fields that are baked already.
    pub fn frame_on(&self, baker: &Baker, scene: &Scene, options: frame::Options) -> Frame {
        // Emptied first: fields of an earlier build would hide what this one bakes.
        static FIELDS: OnceLock<PathBuf> = OnceLock::new();
        let fields = FIELDS.get_or_init(|| {
            let name = format!("fields-{}", env!("CARGO_CRATE_NAME"));
            let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
            let _ = std::fs::remove_dir_all(&folder);
            folder
        });
        Frame::new(baker, &Cache::new(Some(fields)), scene, options, &|_, _, _| ()).unwrap()
    }

    /// Radiosity of every entity's vertices in turn, red, green and blue.
    pub fn light(&self, frame: &mut Frame, placements: &[Placement]) -> Vec<Vec<[f32; 3]>> {
        frame.render(placements, None).unwrap();
        (0..placements.len()).map(|entity| frame.radiosity(entity).unwrap()).collect()
    }

    /// The same of a scene at its start.
    pub fn lit(&self, scene: &Scene, options: frame::Options) -> Vec<Vec<[f32; 3]>> {
        self.light(&mut self.frame(scene, options), &scene.at(0.0))
    }

    /// A picture of a scene at its start, linear RGB.
    pub fn picture(&self, scene: &Scene, options: frame::Options, white: f32) -> Vec<f32> {
        shown(&mut self.frame(scene, options), &scene.at(0.0), white)
    }

    /// What comes of recordings without the barrier of that index.
    pub fn without_barrier<R>(&self, index: usize, record: impl FnOnce() -> R) -> R {
        self.device.omit_barrier(Some(index));
        let outcome = record();
        self.device.omit_barrier(None);
        outcome
    }
}

/// A picture of things at their places, linear RGB.
pub fn shown(frame: &mut Frame, placements: &[Placement], white: f32) -> Vec<f32> {
    frame.render(placements, Some(white)).unwrap();
    frame.picture()
}

/// A scene from its text, which may name files of the program.
pub fn parse(text: &str) -> Scene {
    Scene::parse(text, Path::new("test.toml"), &shadow_fields::asset::embedded::read).unwrap()
}

/// Meshes in one, each moved.
pub fn joined(parts: &[(&Mesh, Vec3)]) -> Mesh {
    let mut positions = Vec::new();
    let mut normals = Vec::new();
    let mut triangles = Vec::new();
    for (part, by) in parts {
        let first = positions.len() as u32;
        positions.extend(part.positions.iter().map(|p| *p + *by));
        normals.extend(&part.normals);
        triangles.extend(part.triangles.iter().map(|t| t.map(|i| i + first)));
    }
    Mesh::new("joined", positions, normals, None, triangles).unwrap()
}

/// A mesh whose places are moved, with normals of its own.
pub fn reshaped(mesh: &Mesh, place: impl Fn(Vec3) -> Vec3) -> Mesh {
    let places = mesh.positions.iter().map(|p| place(*p)).collect();
    Mesh::new("reshaped", places, Vec::new(), None, mesh.triangles.clone()).unwrap()
}

pub fn inside_out(mesh: &Mesh) -> Mesh {
    let normals = mesh.normals.iter().map(|normal| -*normal).collect();
    let triangles = mesh.triangles.iter().map(|[a, b, c]| [*a, *c, *b]).collect();
    Mesh::new("inside out", mesh.positions.clone(), normals, None, triangles).unwrap()
}

/// The triangles of a mesh that are wanted, by their corners.
pub fn part(mesh: &Mesh, is_wanted: impl Fn(&[u32; 3]) -> bool) -> Mesh {
    let triangles = mesh.triangles.iter().filter(|triangle| is_wanted(triangle)).copied().collect();
    Mesh::new("part", mesh.positions.clone(), mesh.normals.clone(), None, triangles).unwrap()
}

/// A mesh of quads, four corners each.
pub fn of_quads(name: &str, corners: Vec<Vec3>) -> Mesh {
    let quads = 0..corners.len() as u32 / 4;
    let triangles = quads.flat_map(|i| [[4 * i, 4 * i + 1, 4 * i + 2], [4 * i, 4 * i + 2, 4 * i + 3]]).collect();
    Mesh::new(name, corners, Vec::new(), None, triangles).unwrap()
}

/// A solid of some of the cells between planes along each axis, which cut its faces too.
pub fn of_cells(planes: [&[f32]; 3], holds: impl Fn([usize; 3]) -> bool) -> Mesh {
    let exists = |cell: [usize; 3]| (0..3).all(|axis| cell[axis] + 1 < planes[axis].len());
    let place = |corner: [usize; 3]| Vec3::from_array(std::array::from_fn(|axis| planes[axis][corner[axis]]));
    let [x, y, z] = planes.map(|planes| planes.len() - 1);
    let mut corners = Vec::new();
    for cell in (0..x * y * z).map(|i| [i / (y * z), i / z % y, i % z]).filter(|cell| holds(*cell)) {
        for (axis, end) in [(0, 0), (0, 1), (1, 0), (1, 1), (2, 0), (2, 1)] {
            let mut beside = cell;
            beside[axis] = if end == 1 { cell[axis] + 1 } else { cell[axis].wrapping_sub(1) };
            if beside[axis] != usize::MAX && exists(beside) && holds(beside) {
                continue;
            }
            let mut quad = [[0, 0], [1, 0], [1, 1], [0, 1]].map(|[i, j]| {
                let mut corner = cell;
                corner[axis] += end;
                corner[(axis + 1) % 3] += i;
                corner[(axis + 2) % 3] += j;
                place(corner)
            });
            if end == 0 {
                quad.reverse();
            }
            corners.extend(quad);
        }
    }
    of_quads("solid", corners)
}

pub fn obj(mesh: &Mesh) -> String {
    let places = mesh.positions.iter().map(|p| format!("v {} {} {}\n", p.x, p.y, p.z));
    let faces = mesh.triangles.iter().map(|t| t.map(|v| v + 1)).map(|[a, b, c]| format!("f {a} {b} {c}\n"));
    places.chain(faces).collect()
}

/// A PNG that states 65 535 x 65 535 pixels and has none.
pub fn huge_png() -> Vec<u8> {
    let mut png = b"\x89PNG\r\n\x1a\n\0\0\0\x0dIHDR".to_vec();
    png.extend([0, 0, 255, 255, 0, 0, 255, 255, 8, 2, 0, 0, 0]);
    // Its checksum, and no pixels.
    png.extend(0x3967_4e07_u32.to_be_bytes());
    png.extend(b"\0\0\0\0IDAT\x35\xaf\x06\x1e\0\0\0\0IEND\xae\x42\x60\x82");
    png
}

/// A plan of two meshes and of two pictures, each a slice.
pub fn plan() -> Plan {
    let mut plan = Plan::new("a (b)".into(), "results".into(), bake::Options::default());
    let input = |path: &str| Input { path: path.into(), hash: path.into() };
    plan.add_meshes(["a.obj", "b.obj"].map(input).into(), 1);
    let options = frame::Options::default();
    let film =
        Film { scene: input("s.toml"), pictures: "f_#.png".into(), options, exposure_ev: 0.0, first_s: 0.0, fps: 24 };
    plan.add_film(film, 2, 1);
    plan
}

/// Root mean square of what found numbers are off true ones by, relative to that of the true ones.
pub fn relative_rms<T: Into<f64>>(found_and_true: impl IntoIterator<Item = (T, T)>) -> f64 {
    let mut off = 0.0_f64;
    let mut whole = 0.0;
    for (found, truth) in found_and_true.into_iter().map(|(found, truth)| (found.into(), truth.into())) {
        off += (found - truth).powi(2);
        whole += truth * truth;
    }
    (off / whole).sqrt()
}
