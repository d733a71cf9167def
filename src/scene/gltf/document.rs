//! The file: its container, its JSON and its buffers, all within limits before anything of their size is made.
//!
//! The crate `gltf` reads and validates JSON. It panics where an accessor leaves its buffer and where an index that its validation
//! does not visit is out of range, so these are checked here, and accessors are read in [`super::accessor`].

use std::cell::Cell;
use std::fmt::Display;
use std::path::{Component, Path, PathBuf};

use ::gltf::json::validation::{self, Checked, Validate as _};
use ::gltf::json::{self, Root};
use base64::Engine as _;
use base64::engine::DecodePaddingMode;
use base64::engine::general_purpose::{GeneralPurpose, GeneralPurposeConfig};

use crate::asset::read_file;
use crate::error::{Error, Result};

/// Largest file of JSON, GLB or a buffer, in bytes: 256 MiB.
pub const FILE_LIMIT_BYTES: u64 = 256 << 20;
/// Largest sum of all buffers in bytes: 1 GiB.
const BUFFERS_LIMIT_BYTES: u64 = 1 << 30;
/// Largest number of objects in the JSON; each takes some hundred bytes once it is read.
const OBJECT_LIMIT: usize = 1_000_000;
/// Largest number of numbers that are read from accessors in all, however often one is used: 512 MiB.
const NUMBER_BUDGET: u64 = 1 << 27;

/// Extensions that a file may require, because this reader follows them or says what it leaves out.
const EXTENSIONS: [&str; 6] = [
    "KHR_lights_punctual",
    "KHR_materials_emissive_strength",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_mesh_quantization",
    "KHR_texture_transform",
];

/// A file that was read and whose indices are within range.
pub struct Document {
    /// The JSON.
    pub root: Root,
    path: PathBuf,
    buffers: Vec<Vec<u8>>,
    numbers_left: Cell<u64>,
}

impl Document {
    /// Reads a `.glb` or `.gltf` file and its buffers.
    ///
    /// # Errors
    /// [`Error::Input`], one line that starts with the file and the place in its JSON.
    pub fn load(path: &Path) -> Result<Self> {
        let bytes = read_file(path, FILE_LIMIT_BYTES)?;
        let (text, mut rest) = split(&bytes).map_err(|what| Error::input(path, what))?;
        if text.iter().filter(|byte| **byte == b'{').count() > OBJECT_LIMIT {
            return Err(Error::input(path, format!("over the limit of {OBJECT_LIMIT} objects in its JSON")));
        }
        let root = Root::from_slice(text).map_err(|error| Error::input(path, format!("its JSON: {error}")))?;
        check(&root).map_err(|(place, what)| Error::input(path, format!("{place}: {what}")))?;
        let mut document =
            Document { root, path: path.to_owned(), buffers: Vec::new(), numbers_left: Cell::new(NUMBER_BUDGET) };
        let mut left = BUFFERS_LIMIT_BYTES;
        for index in 0..document.root.buffers.len() {
            let buffer = document.buffer(index, &mut rest)?;
            left = left.checked_sub(buffer.len() as u64).ok_or_else(|| {
                document.fail(format!("buffers[{index}]"), "the buffers are over the limit of 1024 MiB in all")
            })?;
            document.buffers.push(buffer);
        }
        for (index, view) in document.root.buffer_views.iter().enumerate() {
            let size = document.buffers.get(view.buffer.value()).map_or(0, Vec::len) as u64;
            let start = view.byte_offset.unwrap_or_default().0;
            if start.checked_add(view.byte_length.0).is_none_or(|end| end > size) {
                let what = format!("{} bytes from {start} leave a buffer of {size}", view.byte_length.0);
                return Err(document.fail(format!("bufferViews[{index}]"), what));
            }
        }
        Ok(document)
    }

    /// An error at a place of the JSON.
    pub fn fail(&self, place: impl Display, what: impl Display) -> Error {
        Error::input(&self.path, format!("{place}: {what}"))
    }

    /// The bytes of a buffer view and the stride that it states.
    pub fn view(&self, index: usize) -> (&[u8], Option<usize>) {
        let view = &self.root.buffer_views[index];
        let start = view.byte_offset.unwrap_or_default().0 as usize;
        let bytes = &self.buffers[view.buffer.value()][start..start + view.byte_length.0 as usize];
        (bytes, view.byte_stride.map(|stride| stride.0))
    }

    /// Takes numbers off what may be read from accessors.
    ///
    /// # Errors
    /// [`Error::Input`] where nothing is left.
    pub fn spend(&self, count: u64, place: &str) -> Result<()> {
        let left = self.numbers_left.get().checked_sub(count);
        let what = || format!("over the limit of {NUMBER_BUDGET} numbers that are read in all");
        self.numbers_left.set(left.ok_or_else(|| self.fail(place, what()))?);
        Ok(())
    }

    fn buffer(&self, index: usize, rest: &mut Option<&[u8]>) -> Result<Vec<u8>> {
        let buffer = &self.root.buffers[index];
        let place = format!("buffers[{index}]");
        let mut bytes = match &buffer.uri {
            Some(uri) => self.linked(uri, &format!("{place}.uri"))?,
            None if index == 0 => rest
                .take()
                .map(<[u8]>::to_vec)
                .ok_or_else(|| self.fail(&place, "there is neither a uri nor a binary part of a GLB file"))?,
            None => return Err(self.fail(&place, "only the first buffer may have no uri")),
        };
        if (bytes.len() as u64) < buffer.byte_length.0 {
            let what = format!("byteLength is {}, but there are {} bytes", buffer.byte_length.0, bytes.len());
            return Err(self.fail(&place, what));
        }
        bytes.truncate(buffer.byte_length.0 as usize);
        Ok(bytes)
    }

    /// What a uri stands for: base64 within itself, or a file in the folder of this file or below.
    ///
    /// # Errors
    /// [`Error::Input`] for other schemes, for files outside the folder, and for those that cannot be read.
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

/// The JSON and the binary part of a file.
fn split(bytes: &[u8]) -> std::result::Result<(&[u8], Option<&[u8]>), String> {
    if !bytes.starts_with(b"glTF") {
        return Ok((bytes, None));
    }
    let word = |at: usize| bytes.get(at..at + 4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as usize);
    let (version, length) = (word(4), word(8));
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
        let (size, kind) = (word(at).ok_or_else(cut)?, bytes.get(at + 4..at + 8).ok_or_else(cut)?);
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

type Misplaced = (String, String);

/// Refuses what is not version 2, extensions that change what the file means, and indices out of range.
fn check(root: &Root) -> std::result::Result<(), Misplaced> {
    let refused = |place: String, what: String| Err((place, what));
    let version = root.asset.min_version.as_ref().unwrap_or(&root.asset.version);
    if version != "2.0" && !(root.asset.min_version.is_none() && version.starts_with("2.")) {
        return refused("asset".into(), format!("version {version:?} is not supported, only 2.0"));
    }
    for (index, name) in root.extensions_required.iter().enumerate() {
        if !EXTENSIONS.contains(&name.as_str()) {
            return refused(format!("extensionsRequired[{index}]"), format!("{name} is not supported"));
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
        // Bounds of positions are not read. Extensions are judged above, and a texture may have only pictures of an extension.
        let bounds = place.ends_with(".min") || place.ends_with(".max");
        let excused = bounds || place.starts_with("extensionsRequired") || place.ends_with(".source");
        if first.is_none() && !excused {
            let what = match error {
                validation::Error::IndexOutOfBounds => "the index is out of range",
                validation::Error::Invalid => "the value is not a valid one",
                validation::Error::Missing => "it is missing",
                validation::Error::Oversize => "the size is too large",
                validation::Error::Unsupported => "it is not supported",
            };
            first = Some((place.replace("[\"", ".").replace("\"]", ""), what.to_owned()));
        }
    });
    first.map_or(Ok(()), Err)
}
