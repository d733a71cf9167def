//! Every parser and decoder, with the inputs that mutation starts from.

use super::{farm, stored};
use glam::DVec3;
use shadow_fields::asset::equirect::Equirect;
use shadow_fields::asset::{Mesh, embedded, picture};
use shadow_fields::field::file::VERSION;
use shadow_fields::scene::{Scene, gltf};
use shadow_fields::{Error, Result};
use std::path::Path;

/// A parser, what it says to an input, and words of its format.
pub struct Target {
    pub name: &'static str,
    pub seeds: fn() -> Vec<Vec<u8>>,
    /// Separated by bars.
    pub tokens: &'static str,
    /// Parses; what was read is used as the program would use it.
    pub parse: fn(&[u8]) -> Result<()>,
    /// Whether it reads a file: then an error is one line that names it.
    pub reads_file: bool,
}

/// The name under which inputs are read.
pub const NAME: &str = "fuzzed";

pub const TARGETS: &[Target] = &[
    Target { name: "obj", seeds: meshes, tokens: OBJ, parse: mesh, reads_file: true },
    Target { name: "toml", seeds: scenes, tokens: TOML, parse: scene, reads_file: true },
    Target { name: "glb", seeds: models, tokens: GLTF, parse: model, reads_file: true },
    Target { name: "sf", seeds: stored::fields, tokens: HEADER, parse: stored::field, reads_file: true },
    Target { name: "outlines", seeds: stored::outlines, tokens: HEADER, parse: stored::outline, reads_file: true },
    Target { name: "picture", seeds: pictures, tokens: PICTURE, parse: decode, reads_file: false },
    Target { name: "plan", seeds: farm::plans, tokens: farm::TOKENS, parse: farm::plan, reads_file: true },
    Target { name: "slice", seeds: farm::slices, tokens: farm::TOKENS, parse: farm::slice, reads_file: false },
];

const OBJ: &str = "v |vn |vt |f |//|/|\n|\\\n|g x\n|usemtl m\n|1/1/1";
const PICTURE: &str = "\
    #?RADIANCE\n|FORMAT=32-bit_rle_rgbe\n|-Y 2 +X 4\n|IHDR|IDAT|acTL|channels|chlist|dataWindow|compression";
const TOML: &str = "\
    [camera]\n|[output]\n|[environment]\n|[[mesh]]\n|[[entity]]\n|eye = |target = |fov_deg = |width = |height = |\
    exposure_ev = |time_s = |strength = |turn_deg = |uniform = |gradient = { radiance = |key = { radiance = |\
    sky = { turbidity = |image = { file = \"sky.hdr\" }\n|name = \"m\"\n|file = \"m.obj\"\n|\
    plane = { size_m = 1, cells = 2 }\n|sphere = { radius_m = 1, subdivisions = 1 }\n|\
    disc = { radius_m = 1 }\n|mesh = \"m\"\n|position = |rotation = |scale = |albedo = |emission = |\
    emits = true\n|motion = [|keyframes = { keys = [|orbit = |spin = |bob = |[0, 1, 0]|true|\n";
const GLTF: &str = "\
    \"bufferView\":|\"byteOffset\":|\"byteStride\":|\"count\":|\"componentType\":|\"extensions\":{|\"attributes\":{|\
    \"mode\":\"INDICES\"|\"filter\":\"QUATERNION\"|\"targets\":[{|\"skin\":0|null|1e999|{|}|[|]";
const HEADER: &str =
    "\"bands\":|\"lattice\":|\"shells\":|\"cells\":|\"map_px\":|\"view_px\":|\"radius_m\":|null|1e999|{|}|[|]";

fn meshes() -> Vec<Vec<u8>> {
    let cut = "v 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 0 1 0 0 0 1\nvn 0 0 1\nvt 0 0\nf 1/1/1 2/1/1 3//1\nf -1 -2 -3\n# end\n";
    vec![embedded::read(Path::new("assets/meshes/cuboid.obj")).unwrap(), cut.into()]
}

fn mesh(bytes: &[u8]) -> Result<()> {
    Mesh::parse(bytes, Path::new(NAME)).map(|_| ())
}

/// Packed meshes and textures.
fn models() -> Vec<Vec<u8>> {
    let files: [&[u8]; 4] = [
        include_bytes!("corpus/glb/draco.glb"),
        include_bytes!("corpus/glb/meshopt.glb"),
        include_bytes!("corpus/glb/etc1s.glb"),
        include_bytes!("corpus/glb/uastc.glb"),
    ];
    files.map(<[u8]>::to_vec).to_vec()
}

fn model(bytes: &[u8]) -> Result<()> {
    with_file(bytes, |path| gltf::load(path, &gltf::Options::default())).map(|_| ())
}

fn scenes() -> Vec<Vec<u8>> {
    let small = "[camera]\neye = [0, 1, 5]\ntarget = [0, 0, 0]\n[[mesh]]\nname = \"m\"\nsphere = { radius_m = 1, subdivisions = 0 }\n\
        [[entity]]\nmesh = \"m\"\nposition = [0, 1, 0]\n";
    vec![small.into(), include_bytes!("corpus/toml/all_keys.toml").to_vec()]
}

fn scene(bytes: &[u8]) -> Result<()> {
    let text = std::str::from_utf8(bytes).map_err(|error| Error::input(Path::new(NAME), error))?;
    let read = |path: &Path| match path.extension().and_then(|ending| ending.to_str()) {
        Some("obj") => Ok(meshes().remove(1)),
        Some("hdr") => Ok(radiance_picture()),
        _ => embedded::read(path),
    };
    let scene = Scene::parse(text, Path::new(NAME), &read)?;
    for time_s in [0.0, 0.3, -1e9] {
        let finite = scene.at(time_s).iter().all(|p| p.position.is_finite() && p.rotation.is_finite() && p.scale > 0.0);
        assert!(finite, "a placement is not finite");
    }
    // What is read can be saved and read again; the largest meshes, which are slow to make, are made once.
    let saved = scene.to_toml().unwrap();
    if scene.meshes.iter().map(|mesh| mesh.triangles.len()).sum::<usize>() < 100_000 {
        Scene::parse(&saved, Path::new(NAME), &read)
            .unwrap_or_else(|error| panic!("what was saved is refused: {error}\n{saved}"));
    }
    Ok(())
}

/// A file in memory that functions which take paths can read.
pub fn with_file<R>(bytes: &[u8], read: impl FnOnce(&Path) -> R) -> R {
    thread_local! {
        static FOLDER: tempfile::TempDir = {
            let memory = Path::new("/dev/shm");
            if memory.is_dir() { tempfile::tempdir_in(memory) } else { tempfile::tempdir() }.unwrap()
        };
    }
    FOLDER.with(|folder| {
        let path = folder.path().join(NAME);
        std::fs::write(&path, bytes).unwrap();
        read(&path)
    })
}

/// Header and payload of a stored file with a zero byte between them: what mutation changes.
pub fn unframed(file: &[u8]) -> Vec<u8> {
    let payload = 56 + u32::from_le_bytes(file[12..16].try_into().unwrap()) as usize;
    [&file[56..payload], b"\0", &file[payload..]].concat()
}

/// The file of them, whose lengths and hash are right: `tests/files/field_file.rs` tries all others.
pub fn framed(bytes: &[u8], magic: [u8; 8]) -> Vec<u8> {
    let (header, payload) =
        bytes.split_at(bytes.windows(2).position(|pair| pair == b"}\0").map_or(bytes.len(), |at| at + 1));
    let payload = payload.strip_prefix(b"\0").unwrap_or(payload);
    let mut out = [&magic[..], &VERSION.to_le_bytes()].concat();
    out.extend((header.len() as u32).to_le_bytes());
    out.extend((payload.len() as u64).to_le_bytes());
    let hash = blake3::Hasher::new().update(&out).update(header).update(payload).finalize();
    [&out, &hash.as_bytes()[..], header, payload].concat()
}

fn radiance_picture() -> Vec<u8> {
    let mut bytes = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 2 +X 4\n".to_vec();
    bytes.extend([128, 64, 32, 129].repeat(8));
    bytes
}

fn pictures() -> Vec<Vec<u8>> {
    let linear: Vec<f32> = (0..24).map(|i| i as f32 / 8.0).collect();
    let folder = tempfile::tempdir().unwrap();
    let [png, exr] = ["p.png", "p.exr"].map(|name| folder.path().join(name));
    picture::write_png(&png, 4, 2, &linear, 0.0).unwrap();
    picture::write_exr(&exr, 4, 2, &linear).unwrap();
    let mut long = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 8\n\x02\x02\x00\x08".to_vec();
    long.extend([0x88, 128].repeat(4));
    vec![radiance_picture(), long, std::fs::read(png).unwrap(), std::fs::read(exr).unwrap()]
}

fn decode(bytes: &[u8]) -> Result<()> {
    let picture = Equirect::decode(bytes)?;
    let finite = picture.coefficients.iter().all(|channel| channel.iter().all(|c| c.is_finite()));
    assert!(finite, "a coefficient is not finite");
    assert!(picture.radiance(DVec3::new(0.6, 0.0, -0.8)).is_finite());
    Ok(())
}
