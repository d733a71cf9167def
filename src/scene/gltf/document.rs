//! The file: its container, its JSON and its buffers, all within limits before anything of their size is made.
//!
//! The crate `gltf` reads and validates JSON. It panics where an accessor leaves its buffer and where an index that its
//! validation does not visit is out of range, so these are checked here, and accessors are read in [`super::accessor`].

use std::cell::Cell;
use std::fmt::Display;
use std::ops::Range;
use std::path::{Component, Path, PathBuf};

use ::gltf::json::validation::{self, Checked, USize64, Validate as _};
use ::gltf::json::{self, Buffer, Index, Root, Value};
use base64::Engine as _;
use base64::engine::DecodePaddingMode;
use base64::engine::general_purpose::{GeneralPurpose, GeneralPurposeConfig};

use super::compressed;
use crate::asset::read_file;
use crate::error::{Error, Result};

/// Largest file of JSON, GLB or a buffer, in bytes: 256 MiB.
pub const FILE_LIMIT_BYTES: u64 = 256 << 20;
/// Largest sum of all buffers in bytes: 1 GiB.
const BUFFERS_LIMIT_BYTES: u64 = 1 << 30;
/// Largest number of objects in the JSON; each takes some hundred bytes once it is read.
const OBJECT_LIMIT: usize = 1_000_000;
/// Largest JSON that [`rewritten`] takes apart, in bytes: each number of it takes up to 16 times its length.
const REWRITTEN_LIMIT_BYTES: usize = 32 << 20;
/// Largest number of numbers that are read from accessors in all, however often one is used: 512 MiB.
const NUMBER_BUDGET: u64 = 1 << 27;

/// Extensions that a file may require, because this reader follows them or says what it leaves out.
const EXTENSIONS: [&str; 11] = [
    "EXT_mesh_gpu_instancing",
    "EXT_meshopt_compression",
    "KHR_lights_punctual",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_mesh_quantization",
    "KHR_meshopt_compression",
    "KHR_texture_transform",
];
/// Those that the feature `decoders` adds.
const DECODED: [&str; 3] = ["EXT_texture_webp", "KHR_draco_mesh_compression", "KHR_texture_basisu"];

/// A file that was read and whose indices are within range.
pub struct Document {
    pub root: Root,
    /// Channels of animations that move no node, which are not among those of the JSON.
    pub nodeless_channels: usize,
    path: PathBuf,
    buffers: Vec<Option<Vec<u8>>>,
    /// How many more bytes all buffers may hold.
    pub bytes_left: u64,
    numbers_left: Cell<u64>,
}

impl Document {
    /// Reads a `.glb` or `.gltf` file and its buffers.
    pub fn load(path: &Path) -> Result<Self> {
        let bytes = read_file(path, FILE_LIMIT_BYTES)?;
        let (text, mut rest) = split(&bytes).map_err(|what| Error::input(path, what))?;
        if text.iter().filter(|byte| **byte == b'{').count() > OBJECT_LIMIT {
            return Err(Error::input(path, format!("over the limit of {OBJECT_LIMIT} objects in its JSON")));
        }
        let (root, nodeless_channels) =
            parse(text).map_err(|error| Error::input(path, format!("its JSON: {error}")))?;
        check(&root).map_err(|(place, what)| Error::input(path, format!("{place}: {what}")))?;
        let mut document = Document {
            root,
            nodeless_channels,
            path: path.to_owned(),
            buffers: Vec::new(),
            bytes_left: BUFFERS_LIMIT_BYTES,
            numbers_left: Cell::new(NUMBER_BUDGET),
        };
        for index in 0..document.root.buffers.len() {
            let buffer = document.buffer(index, &mut rest)?;
            document.take_bytes(buffer.as_ref().map_or(0, Vec::len), &format!("buffers[{index}]"))?;
            document.buffers.push(buffer);
        }
        for (index, view) in document.root.buffer_views.iter().enumerate() {
            let Some(buffer) = &document.buffers[view.buffer.value()] else { continue };
            let size = buffer.len() as u64;
            let start = view.byte_offset.unwrap_or_default().0;
            if start.checked_add(view.byte_length.0).is_none_or(|end| end > size) {
                let what = format!("{} bytes from {start} leave a buffer of {size}", view.byte_length.0);
                return Err(document.fail(format!("bufferViews[{index}]"), what));
            }
        }
        compressed::unpack(&mut document)?;
        Ok(document)
    }

    /// Takes bytes off what all buffers may hold.
    pub fn take_bytes(&mut self, count: usize, place: &str) -> Result<()> {
        let left = self.bytes_left.checked_sub(count as u64);
        let what = "the buffers are over the limit of 1024 MiB in all";
        self.bytes_left = left.ok_or_else(|| self.fail(place, what))?;
        Ok(())
    }

    /// Adds a buffer, whose bytes were taken by [`Document::take_bytes`]; returns its index.
    pub fn add_buffer(&mut self, bytes: Vec<u8>) -> Index<Buffer> {
        let json = Buffer {
            byte_length: USize64::from(bytes.len()),
            name: None,
            uri: None,
            extensions: None,
            extras: Default::default(),
        };
        self.buffers.push(Some(bytes));
        self.root.push(json)
    }

    /// An error at a place of the JSON.
    pub fn fail(&self, place: impl Display, what: impl Display) -> Error {
        Error::input(&self.path, format!("{place}: {what}"))
    }

    /// The bytes of a buffer view and the stride that it states.
    pub fn view(&self, index: usize) -> Result<(&[u8], Option<usize>)> {
        let view = &self.root.buffer_views[index];
        let start = view.byte_offset.unwrap_or_default().0 as usize;
        let end = start.saturating_add(view.byte_length.0 as usize);
        let bytes = self.slice(view.buffer.value(), start..end, &format!("bufferViews[{index}]"))?;
        Ok((bytes, view.byte_stride.map(|stride| stride.0)))
    }

    pub fn slice(&self, buffer: usize, range: Range<usize>, place: &str) -> Result<&[u8]> {
        let bytes = self.buffers.get(buffer).ok_or_else(|| self.fail(place, format!("there is no buffer {buffer}")))?;
        let bytes = bytes.as_ref().ok_or_else(|| {
            let what = match buffer {
                0 => "there is neither a uri nor a binary part of a GLB file",
                _ => "only the first buffer may have no uri",
            };
            self.fail(format!("buffers[{buffer}]"), what)
        })?;
        bytes.get(range.clone()).ok_or_else(|| {
            let what = format!("bytes {} to {} leave a buffer of {}", range.start, range.end, bytes.len());
            self.fail(place, what)
        })
    }

    /// Takes numbers off what may be read from accessors.
    pub fn spend(&self, count: u64, place: &str) -> Result<()> {
        let left = self.numbers_left.get().checked_sub(count);
        let what = || format!("over the limit of {NUMBER_BUDGET} numbers that are read in all");
        self.numbers_left.set(left.ok_or_else(|| self.fail(place, what()))?);
        Ok(())
    }

    /// The bytes of a buffer; `None` where the file has none, which matters only if they are read.
    fn buffer(&self, index: usize, rest: &mut Option<&[u8]>) -> Result<Option<Vec<u8>>> {
        let buffer = &self.root.buffers[index];
        let place = format!("buffers[{index}]");
        let binary = || rest.take().filter(|_| index == 0).map(<[u8]>::to_vec);
        let linked = buffer.uri.as_ref().map(|uri| self.linked(uri, &format!("{place}.uri")));
        let Some(mut bytes) = linked.transpose()?.or_else(binary) else { return Ok(None) };
        if (bytes.len() as u64) < buffer.byte_length.0 {
            let what = format!("byteLength is {}, but there are {} bytes", buffer.byte_length.0, bytes.len());
            return Err(self.fail(&place, what));
        }
        bytes.truncate(buffer.byte_length.0 as usize);
        Ok(Some(bytes))
    }

    /// What a uri stands for: base64 within itself, or a file in the folder of this file or below.
    pub fn linked(&self, uri: &str, place: &str) -> Result<Vec<u8>> {
        let fail = |what: String| self.fail(place, what);
        if let Some(data) = uri.strip_prefix("data:") {
            let encoded = data.split_once(',').filter(|(head, _)| head.ends_with(";base64"));
            let (_, encoded) = encoded.ok_or_else(|| fail("expected data in base64".into()))?;
            let config = GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent);
            let engine = GeneralPurpose::new(&base64::alphabet::STANDARD, config);
            return engine.decode(encoded).map_err(|error| fail(format!("not base64: {error}")));
        }
        let name = percent_encoding::percent_decode_str(uri).decode_utf8();
        let name = name.map_err(|_| fail(format!("{uri:?} is not UTF-8")))?;
        let scheme = uri.split_once(':').is_some_and(|(scheme, _)| {
            scheme.starts_with(|c: char| c.is_ascii_alphabetic())
                && scheme.chars().all(|c| c.is_ascii_alphanumeric() || "+-.".contains(c))
        });
        if scheme {
            return Err(fail(format!("{name:?} is refused: only data in base64 and files in the folder are read")));
        }
        let outside = || fail(format!("{name:?} is refused: it is outside the folder of the file"));
        let relative = Path::new(&*name);
        if relative.components().any(|part| !matches!(part, Component::Normal(_) | Component::CurDir)) {
            return Err(outside());
        }
        let folder = self.path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let full = folder.join(relative);
        let real = |path: &Path| path.canonicalize().map_err(|error| fail(format!("{}: {error}", full.display())));
        if !real(&full)?.starts_with(real(folder)?) {
            return Err(outside());
        }
        read_file(&full, FILE_LIMIT_BYTES).map_err(|error| fail(error.to_string()))
    }
}

pub fn split(bytes: &[u8]) -> std::result::Result<(&[u8], Option<&[u8]>), String> {
    if !bytes.starts_with(b"glTF") {
        let is_json = bytes.trim_ascii_start().starts_with(b"{");
        return is_json.then_some((bytes, None)).ok_or("no glTF: it begins neither as GLB nor as JSON".into());
    }
    let word = |at: usize| bytes.get(at..at + 4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as usize);
    let version = word(4);
    let length = word(8);
    if version != Some(2) {
        return Err(format!("expected version 2 of GLB, got {}", version.map_or("none".into(), |v| v.to_string())));
    }
    let length = length.filter(|length| (20..=bytes.len()).contains(length)).ok_or_else(|| {
        format!("a GLB file of {} bytes that states {}: it is cut off or damaged", bytes.len(), length.unwrap_or(0))
    })?;
    let mut parts = [None, None];
    let mut at = 12;
    while at < length {
        let cut = || "a part of the GLB file is cut off".to_owned();
        let size = word(at).ok_or_else(cut)?;
        let kind = bytes.get(at + 4..at + 8).ok_or_else(cut)?;
        let part = bytes[..length].get(at + 8..(at + 8).saturating_add(size)).ok_or_else(cut)?;
        // Other kinds of parts are to be passed over.
        match (kind, &mut parts) {
            (b"JSON", [json @ None, _]) => *json = Some(part),
            (b"BIN\0", [Some(_), binary @ None]) => *binary = Some(part),
            _ => {}
        }
        at += 8 + size;
    }
    let [json, binary] = parts;
    Ok((json.ok_or("a GLB file without JSON")?, binary))
}

/// Reads JSON, and counts the channels of animations that are left out because they move no node.
fn parse(text: &[u8]) -> std::result::Result<(Root, usize), json::Error> {
    let refused = match Root::from_slice(text) {
        Ok(root) => return Ok((root, 0)),
        Err(error) => error,
    };
    let (text, nodeless_channels) = rewritten(text).ok_or(refused)?;
    Ok((Root::from_slice(&text)?, nodeless_channels))
}

/// JSON that the specification allows and the crate does not, as the crate takes it: scenes without nodes, whole
/// numbers with a point or an exponent, and without the channels of animations that have no node. `None` where it has
/// nothing of these.
fn rewritten(text: &[u8]) -> Option<(Vec<u8>, usize)> {
    let mut root: Value = serde_json::from_slice(text).ok().filter(|_| text.len() <= REWRITTEN_LIMIT_BYTES)?;
    let mut changed = whole_numbers(&mut root);
    for scene in root.get_mut("scenes").and_then(Value::as_array_mut).into_iter().flatten() {
        if let Some(scene) = scene.as_object_mut().filter(|scene| !scene.contains_key("nodes")) {
            scene.insert("nodes".into(), Value::Array(Vec::new()));
            changed = true;
        }
    }
    let mut nodeless = 0;
    for animation in root.get_mut("animations").and_then(Value::as_array_mut).into_iter().flatten() {
        if let Some(channels) = animation.get_mut("channels").and_then(Value::as_array_mut) {
            let count = channels.len();
            channels.retain(|channel| channel.get("target").is_none_or(|target| target.get("node").is_some()));
            nodeless += count - channels.len();
        }
    }
    (changed || nodeless > 0).then(|| (root.to_string().into_bytes(), nodeless))
}

/// Writes `4.0` and `4e0` as `4` everywhere; returns whether there are any.
fn whole_numbers(value: &mut Value) -> bool {
    match value {
        Value::Number(number) => {
            let is_whole = |x: &f64| x.fract() == 0.0 && x.is_sign_positive() && *x < 9e15;
            let Some(whole) = number.as_f64().filter(|x| number.is_f64() && is_whole(x)) else { return false };
            *number = (whole as u64).into();
            true
        }
        Value::Array(values) => values.iter_mut().fold(false, |any, value| whole_numbers(value) || any),
        Value::Object(map) => map.values_mut().fold(false, |any, value| whole_numbers(value) || any),
        _ => false,
    }
}

type Misplaced = (String, String);

/// Refuses what is not version 2, extensions that change what the file means, and indices out of range.
fn check(root: &Root) -> std::result::Result<(), Misplaced> {
    let refused = |place: String, what: String| Err((place, what));
    let version = root.asset.min_version.as_ref().unwrap_or(&root.asset.version);
    if version != "2.0" && !(root.asset.min_version.is_none() && version.starts_with("2.")) {
        return refused("asset".into(), format!("version {version:?} is not supported, only 2.0"));
    }
    for (index, name) in root.extensions_required.iter().enumerate() {
        let place = || format!("extensionsRequired[{index}]");
        let is_decoded = DECODED.contains(&name.as_str());
        if is_decoded && cfg!(not(feature = "decoders")) {
            return refused(place(), format!("{name} is not supported: this program was built without `decoders`"));
        }
        if !is_decoded && !EXTENSIONS.contains(&name.as_str()) {
            return refused(place(), format!("{name} is not supported"));
        }
    }
    // The crate's validation of a primitive takes the index of its positions for checked.
    for (index, mesh) in root.meshes.iter().enumerate() {
        for (at, primitive) in mesh.primitives.iter().enumerate() {
            for (name, accessor) in &primitive.attributes {
                if accessor.value() >= root.accessors.len() {
                    let place = format!("meshes[{index}].primitives[{at}].attributes.{}", name.to_string());
                    return refused(place, format!("there is no accessor {}", accessor.value()));
                }
            }
        }
    }
    for (index, animation) in root.animations.iter().enumerate() {
        for (at, channel) in animation.channels.iter().enumerate() {
            let place = format!("animations[{index}].channels[{at}].target");
            if channel.target.node.value() >= root.nodes.len() {
                return refused(place, format!("there is no node {}", channel.target.node.value()));
            }
            if matches!(channel.target.path, Checked::Invalid) {
                return refused(place, "its path is neither translation, rotation, scale nor weights".into());
            }
        }
    }
    let mut first = None;
    root.validate(root, json::Path::new, &mut |path, error| {
        let place = path().to_string();
        // Bounds of positions are not read, and accessors are judged where they are read: numbers without a bufferView
        // are zeros. Extensions are judged above, lights, cameras and primitives where they are made, and a texture may
        // have only pictures of an extension. The specification lets later versions add words to its lists.
        let lists =
            [".type", ".componentType", ".alphaMode", ".target", ".magFilter", ".minFilter", ".wrapS", ".wrapT"];
        let excused = match error {
            validation::Error::Invalid => lists.iter().any(|key| place.ends_with(key)),
            validation::Error::Missing => place.ends_with(".bufferView") || place.ends_with("[\"POSITION\"]"),
            _ => false,
        };
        let unread = [".min", ".max", ".source"].iter().any(|key| place.ends_with(key));
        let excused = excused || unread || place.starts_with("extensionsRequired");
        if first.is_none() && !excused {
            let what = match error {
                validation::Error::IndexOutOfBounds => "the index is out of range",
                validation::Error::Invalid => "the value is not a valid one",
                validation::Error::Missing => "it is missing",
                validation::Error::Oversize => "the size is too large",
                validation::Error::Unsupported => "it is not supported",
            };
            let place = place.replace("khrLightsPunctual", "KHR_lights_punctual");
            first = Some((place.replace("[\"", ".").replace("\"]", ""), what.to_owned()));
        }
    });
    first.map_or(Ok(()), Err)
}
