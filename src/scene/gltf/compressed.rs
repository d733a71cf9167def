//! Compressed meshes (`EXT_meshopt_compression`, `KHR_draco_mesh_compression`): they are unpacked into buffers of their
//! own before anything reads them.

use ::gltf::json::Value;
use serde::Deserialize;

use super::accessor::COUNT_LIMIT;
use super::document::Document;
use crate::error::Result;

/// Unpacks all that is compressed.
pub fn unpack(document: &mut Document) -> Result<()> {
    for index in 0..document.root.buffer_views.len() {
        unpack_view(document, index)?;
    }
    #[cfg(feature = "decoders")]
    for mesh in 0..document.root.meshes.len() {
        for at in 0..document.root.meshes[mesh].primitives.len() {
            draco::unpack_primitive(document, mesh, at)?;
        }
    }
    Ok(())
}

/// A buffer view's part of the extension of meshoptimizer.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Packed {
    buffer: usize,
    #[serde(default)]
    byte_offset: usize,
    byte_length: usize,
    byte_stride: usize,
    count: usize,
    mode: Mode,
    #[serde(default)]
    filter: Filter,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "UPPERCASE")]
enum Mode {
    Attributes,
    Triangles,
    Indices,
}

#[derive(Clone, Copy, Default, Deserialize)]
#[serde(rename_all = "UPPERCASE")]
enum Filter {
    #[default]
    None,
    Octahedral,
    Quaternion,
    Exponential,
    Color,
}

/// Largest stride of the elements of vertices, in words of 4 bytes.
const WORDS: usize = 64;

impl Packed {
    fn decode(&self, bytes: &[u8]) -> std::result::Result<Vec<u8>, String> {
        let damaged = |error: meshopt::Error| format!("its data are damaged: {error}");
        let bytes_of_indices = |wide: meshopt::Result<Vec<u32>>| -> std::result::Result<Vec<u8>, String> {
            let wide = wide.map_err(damaged)?;
            Ok(match self.byte_stride {
                2 => wide.iter().flat_map(|index| (*index as u16).to_le_bytes()).collect(),
                _ => wide.iter().flat_map(|index| index.to_le_bytes()).collect(),
            })
        };
        let of_indices = matches!(self.byte_stride, 2 | 4);
        match self.mode {
            Mode::Triangles if of_indices && self.count.is_multiple_of(3) => {
                bytes_of_indices(meshopt::decode_index_buffer(bytes, self.count))
            }
            Mode::Indices if of_indices => bytes_of_indices(meshopt::decode_index_sequence(bytes, self.count)),
            Mode::Attributes if self.byte_stride.is_multiple_of(4) => {
                let mut words = vertices(bytes, self.count, self.byte_stride / 4).map_err(damaged)?;
                self.unfilter(&mut words)?;
                Ok(bytemuck::cast_slice(&words).to_vec())
            }
            _ => Err(format!("{} elements of {} bytes do not fit its mode", self.count, self.byte_stride)),
        }
    }

    fn unfilter(&self, words: &mut [u32]) -> std::result::Result<(), String> {
        match (self.filter, self.byte_stride) {
            (Filter::None, _) => {}
            (Filter::Octahedral, 4) => meshopt::decode_filter_oct::<i8>(bytemuck::cast_slice_mut(words)),
            (Filter::Octahedral, 8) => meshopt::decode_filter_oct::<i16>(bytemuck::cast_slice_mut(words)),
            (Filter::Quaternion, 8) => meshopt::decode_filter_quat(bytemuck::cast_slice_mut(words)),
            (Filter::Exponential, _) => meshopt::decode_filter_exp::<1>(bytemuck::cast_slice_mut(words)),
            (Filter::Color, 4) => meshopt::decode_filter_color::<u8>(bytemuck::cast_slice_mut(words)),
            (Filter::Color, 8) => meshopt::decode_filter_color::<u16>(bytemuck::cast_slice_mut(words)),
            (_, stride) => return Err(format!("{stride} bytes do not fit its filter")),
        }
        Ok(())
    }
}

/// Elements of vertices of `width` words, at most [`WORDS`]. The crate takes the width from a type.
fn vertices(bytes: &[u8], count: usize, width: usize) -> meshopt::Result<Vec<u32>> {
    #[derive(Clone, Copy)]
    struct Element<const N: usize>([u32; N]);
    impl<const N: usize> Default for Element<N> {
        fn default() -> Self {
            Element([0; N])
        }
    }
    fn of_width<const N: usize>(bytes: &[u8], count: usize) -> meshopt::Result<Vec<u32>> {
        let elements: Vec<Element<N>> = meshopt::decode_vertex_buffer(bytes, count)?;
        Ok(elements.into_iter().flat_map(|element| element.0).collect())
    }
    macro_rules! by_width {
        ($($n:literal)*) => {
            match width {
                $($n => of_width::<$n>(bytes, count),)*
                _ => unreachable!("a stride within {WORDS} words was checked"),
            }
        };
    }
    by_width!(1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20 21 22 23 24 25 26 27 28 29 30 31 32 33 34 35 36 37 38
        39 40 41 42 43 44 45 46 47 48 49 50 51 52 53 54 55 56 57 58 59 60 61 62 63 64)
}

fn unpack_view(document: &mut Document, index: usize) -> Result<()> {
    let extensions = document.root.buffer_views[index].extensions.as_ref().map(|extensions| &extensions.others);
    let named = ["EXT_meshopt_compression", "KHR_meshopt_compression"]
        .into_iter()
        .find_map(|name| Some((name, extensions?.get(name)?.clone())));
    let Some((name, json)) = named else { return Ok(()) };
    let place = format!("bufferViews[{index}].extensions.{name}");
    let packed: Packed = read(document, json, &place)?;
    if !(1..=COUNT_LIMIT).contains(&(packed.count as u64)) || !(2..=256).contains(&packed.byte_stride) {
        let Packed { count, byte_stride, .. } = packed;
        let what = format!("{count} elements of {byte_stride} bytes are not within 1 to {COUNT_LIMIT} of 2 to 256");
        return Err(document.fail(place, what));
    }
    let size = packed.count * packed.byte_stride;
    document.take_bytes(size, &place)?;
    let range = packed.byte_offset..packed.byte_offset.saturating_add(packed.byte_length);
    let bytes = document.slice(packed.buffer, range, &place)?;
    let unpacked = packed.decode(bytes).map_err(|what| document.fail(&place, what))?;
    let buffer = document.add_buffer(unpacked);
    let view = &mut document.root.buffer_views[index];
    view.buffer = buffer;
    view.byte_offset = None;
    view.byte_length = size.into();
    Ok(())
}

fn read<T: for<'de> Deserialize<'de>>(document: &Document, json: Value, place: &str) -> Result<T> {
    serde_json::from_value(json).map_err(|error| document.fail(place, error))
}

#[cfg(feature = "decoders")]
mod draco {
    use super::*;
    use crate::scene::gltf::accessor::largest;
    use ::gltf::json::Index;
    use ::gltf::json::accessor::{Accessor, ComponentType, GenericComponentType};
    use ::gltf::json::buffer::View;
    use ::gltf::json::mesh::Mode;
    use ::gltf::json::validation::{Checked, USize64};
    use draco_core::{DecodeLimits, DecoderBuffer, Mesh, MeshDecoder};
    use std::collections::HashMap;

    /// A primitive's part of the extension: the numbers of attributes by their names.
    #[derive(Deserialize)]
    #[serde(rename_all = "camelCase")]
    struct Packed {
        buffer_view: usize,
        attributes: HashMap<String, u32>,
    }

    /// Gives a primitive accessors of its own, of f32 and u32, that read the unpacked mesh.
    pub fn unpack_primitive(document: &mut Document, mesh: usize, at: usize) -> Result<()> {
        const NAME: &str = "KHR_draco_mesh_compression";
        let primitive = &document.root.meshes[mesh].primitives[at];
        let Some(json) = primitive.extensions.as_ref().and_then(|e| e.others.get(NAME)).cloned() else { return Ok(()) };
        let place = format!("meshes[{mesh}].primitives[{at}].extensions.{NAME}");
        let packed: Packed = read(document, json, &place)?;
        if packed.buffer_view >= document.root.buffer_views.len() {
            return Err(document.fail(place, format!("there is no bufferView {}", packed.buffer_view)));
        }
        let decoded = decode(document.view(packed.buffer_view)?.0, document.bytes_left);
        let decoded = decoded.map_err(|what| document.fail(&place, format!("its data are damaged: {what}")))?;
        let count = decoded.num_points();

        let named: Vec<_> = primitive.attributes.iter().map(|(name, index)| (name.clone(), *index)).collect();
        for (name, index) in named {
            let Some(id) = packed.attributes.get(&name.to_string()) else { continue };
            let mut attributes = (0..decoded.num_attributes()).map(|id| decoded.attribute(id));
            let Some(attribute) = attributes.find(|attribute| attribute.unique_id() == *id) else {
                return Err(document.fail(place, format!("there is no attribute {id}")));
            };
            let accessor = &document.root.accessors[index.value()];
            let (Checked::Valid(component), Checked::Valid(kind)) = (accessor.component_type, accessor.type_) else {
                continue; // judged where it is read
            };
            let scale = if accessor.normalized { largest(component.0) } else { 1.0 };
            let width = kind.multiplicity();
            document.take_bytes(4 * count * width, &place)?;
            let numbers = attribute.read_f32s(count, width);
            let bytes = numbers.iter().flat_map(|number| (number / scale).to_le_bytes()).collect();
            let index = add_accessor(document, index, bytes, count, ComponentType::F32);
            document.root.meshes[mesh].primitives[at].attributes.insert(name, index);
        }
        let Some(index) = document.root.meshes[mesh].primitives[at].indices else {
            return Err(document.fail(place, "the primitive has no indices"));
        };
        let corner_count = 3 * decoded.num_faces();
        document.take_bytes(4 * corner_count, &place)?;
        let corners = decoded.faces().iter().flatten().flat_map(|corner| corner.0.to_le_bytes()).collect();
        let index = add_accessor(document, index, corners, corner_count, ComponentType::U32);
        let primitive = &mut document.root.meshes[mesh].primitives[at];
        primitive.indices = Some(index);
        primitive.mode = Checked::Valid(Mode::Triangles);
        Ok(())
    }

    fn decode(bytes: &[u8], bytes_left: u64) -> std::result::Result<Mesh, String> {
        let mut limits = DecodeLimits::default();
        limits.max_points = COUNT_LIMIT;
        limits.max_faces = COUNT_LIMIT / 3;
        limits.max_decoded_bytes = bytes_left;
        let mut mesh = Mesh::new();
        let mut buffer = DecoderBuffer::new(bytes).with_limits(limits);
        MeshDecoder::new().decode(&mut buffer, &mut mesh).map_err(|error| error.to_string().replace('\n', " "))?;
        Ok(mesh)
    }

    /// An accessor like another that reads `count` elements of these bytes, which were taken before.
    fn add_accessor(
        document: &mut Document,
        like: Index<Accessor>,
        bytes: Vec<u8>,
        count: usize,
        component: ComponentType,
    ) -> Index<Accessor> {
        let byte_length = USize64::from(bytes.len());
        let buffer = document.add_buffer(bytes);
        let view = document.root.push(View {
            buffer,
            byte_length,
            byte_offset: None,
            byte_stride: None,
            name: None,
            target: None,
            extensions: None,
            extras: Default::default(),
        });
        let accessor = Accessor {
            buffer_view: Some(view),
            byte_offset: None,
            sparse: None,
            normalized: false,
            count: USize64::from(count),
            component_type: Checked::Valid(GenericComponentType(component)),
            ..document.root.accessors[like.value()].clone()
        };
        document.root.push(accessor)
    }
}
