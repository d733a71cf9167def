//! Accessors: arrays of numbers in buffers, quantised or not, sparse or not. All that is read is finite.

use ::gltf::json::accessor::{Accessor, ComponentType, Type};
use ::gltf::json::validation::Checked;

use super::document::Document;
use crate::asset::mesh::TRIANGLE_LIMIT;
use crate::error::Result;

/// Largest number of elements of an accessor: the corners of the largest mesh.
pub const COUNT_LIMIT: u64 = 3 * TRIANGLE_LIMIT as u64;

/// Elements without gaps, as they are stored.
struct Elements {
    width: usize,
    component: ComponentType,
    normalized: bool,
    bytes: Vec<u8>,
}

/// Numbers of an accessor with `widths` numbers an element, one element after the other. Quantised numbers that are
/// normalised lie within -1 to 1.
pub fn numbers(document: &Document, index: usize, widths: &[usize]) -> Result<Vec<f32>> {
    let elements = elements(document, index)?;
    if !widths.contains(&elements.width) {
        let what = format!("{} numbers an element instead of {widths:?}", elements.width);
        return Err(document.fail(format!("accessors[{index}]"), what));
    }
    let most = largest(elements.component);
    let scaled = |value: f32| if elements.normalized { (value / most).max(-1.0) } else { value };
    let number = |bytes: &[u8]| match (elements.component, bytes) {
        (ComponentType::I8, &[a]) => scaled(f32::from(a as i8)),
        (ComponentType::U8, &[a]) => scaled(f32::from(a)),
        (ComponentType::I16, &[a, b]) => scaled(f32::from(i16::from_le_bytes([a, b]))),
        (ComponentType::U16, &[a, b]) => scaled(f32::from(u16::from_le_bytes([a, b]))),
        (ComponentType::U32, &[a, b, c, d]) => scaled(u32::from_le_bytes([a, b, c, d]) as f32),
        (ComponentType::F32, &[a, b, c, d]) => f32::from_le_bytes([a, b, c, d]),
        _ => f32::NAN,
    };
    let numbers: Vec<f32> = elements.bytes.chunks_exact(elements.component.size()).map(number).collect();
    match numbers.iter().position(|number| !number.is_finite()) {
        Some(bad) => {
            let what = format!("a number of element {} is not finite", bad / elements.width);
            Err(document.fail(format!("accessors[{index}]"), what))
        }
        None => Ok(numbers),
    }
}

/// What stands for 1 in quantised numbers that are normalised.
pub fn largest(component: ComponentType) -> f32 {
    match component {
        ComponentType::I8 => 127.0,
        ComponentType::U8 => 255.0,
        ComponentType::I16 => 32_767.0,
        ComponentType::U16 => 65_535.0,
        ComponentType::U32 => u32::MAX as f32,
        ComponentType::F32 => 1.0,
    }
}

/// Elements of three numbers.
pub fn triples(document: &Document, index: usize) -> Result<Vec<glam::Vec3>> {
    Ok(numbers(document, index, &[3])?.chunks_exact(3).map(glam::Vec3::from_slice).collect())
}

/// Whether the file gives an accessor no numbers, so that all of them are zeros.
pub fn is_unfilled(document: &Document, index: usize) -> bool {
    let accessor = &document.root.accessors[index];
    accessor.buffer_view.is_none() && accessor.sparse.is_none()
}

/// Indices: whole numbers, one an element.
pub fn indices(document: &Document, index: usize) -> Result<Vec<u32>> {
    let elements = elements(document, index)?;
    whole(elements.component, &elements.bytes)
        .filter(|_| elements.width == 1 && !elements.normalized)
        .ok_or_else(|| document.fail(format!("accessors[{index}]"), "indices are one unsigned number an element"))
}

fn whole(component: ComponentType, bytes: &[u8]) -> Option<Vec<u32>> {
    Some(match component {
        ComponentType::U8 => bytes.iter().map(|a| u32::from(*a)).collect(),
        ComponentType::U16 => bytes.chunks_exact(2).map(|a| u16::from_le_bytes([a[0], a[1]]).into()).collect(),
        ComponentType::U32 => bytes.chunks_exact(4).map(|a| u32::from_le_bytes([a[0], a[1], a[2], a[3]])).collect(),
        _ => return None,
    })
}

fn elements(document: &Document, index: usize) -> Result<Elements> {
    let place = format!("accessors[{index}]");
    let accessor: &Accessor = &document.root.accessors[index];
    let bad = |field: &str| document.fail(format!("{place}.{field}"), "the value is not a valid one");
    let Checked::Valid(component) = &accessor.component_type else { return Err(bad("componentType")) };
    let Checked::Valid(kind) = &accessor.type_ else { return Err(bad("type")) };
    let component = component.0;
    let normalized = accessor.normalized;
    if matches!(kind, Type::Mat2 | Type::Mat3) {
        return Err(document.fail(place, "matrices of two or three columns are not read"));
    }
    let width = kind.multiplicity();
    let count = accessor.count.0;
    if !(1..=COUNT_LIMIT).contains(&count) {
        return Err(document.fail(place, format!("a count of {count} is not within 1 to {COUNT_LIMIT}")));
    }
    document.spend(count * width as u64, &place)?;
    let size = width * component.size();

    let mut bytes = match accessor.buffer_view {
        Some(view) => {
            let offset = accessor.byte_offset.unwrap_or_default().0;
            slices(document, &place, view.value(), offset, size, count as usize)?.concat()
        }
        None => vec![0; size * count as usize],
    };
    if let Some(sparse) = &accessor.sparse {
        let place = format!("{place}.sparse");
        let amount = sparse.count.0;
        if !(1..=count).contains(&amount) {
            return Err(document.fail(place, format!("a count of {amount} is not within 1 to {count}")));
        }
        let Checked::Valid(of_index) = &sparse.indices.component_type else {
            return Err(document.fail(place, "its componentType is not a valid one"));
        };
        let amount = amount as usize;
        let view = sparse.indices.buffer_view.value();
        let offset = sparse.indices.byte_offset.0;
        let at = slices(document, &place, view, offset, of_index.0.size(), amount)?.concat();
        let at = whole(of_index.0, &at).unwrap_or_default();
        if at.windows(2).any(|pair| pair[1] <= pair[0]) || at.last().is_none_or(|last| u64::from(*last) >= count) {
            return Err(document.fail(place, format!("its indices do not increase, or go beyond {count} elements")));
        }
        let view = sparse.values.buffer_view.value();
        let offset = sparse.values.byte_offset.0;
        let values = slices(document, &place, view, offset, size, amount)?;
        for (index, value) in at.into_iter().zip(values) {
            bytes[size * index as usize..][..size].copy_from_slice(value);
        }
    }
    Ok(Elements { width, component, normalized, bytes })
}

/// `count` slices of `size` bytes of a buffer view.
fn slices<'a>(
    document: &'a Document,
    place: &str,
    view: usize,
    offset: u64,
    size: usize,
    count: usize,
) -> Result<Vec<&'a [u8]>> {
    let (bytes, stride) = document.view(view)?;
    let stride = stride.unwrap_or(size);
    let end = offset.checked_add((stride as u64) * (count as u64 - 1) + size as u64);
    if end.is_none_or(|end| end > bytes.len() as u64) || stride < size {
        let what = format!("{count} elements of {size} bytes, each {stride} behind the last, from {offset}");
        return Err(document.fail(place, format!("{what} leave a buffer view of {} bytes", bytes.len())));
    }
    Ok((0..count).map(|i| &bytes[offset as usize + i * stride..][..size]).collect())
}
