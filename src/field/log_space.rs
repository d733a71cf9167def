//! A field of logarithms: what is added where chains are kept in log space (see [`crate::sh::log_space`]).

use super::ShadowField;
use super::quantity::{FieldKind, Storage};
use crate::sh::basis::coefficient_count;
use crate::sh::log_space::LogSpace;
use rayon::prelude::*;

/// The logarithm of 1 - b for every stored sample of an occlusion field, in floats, to be looked up as the field is: multiplied by
/// [`super::Lattice::scale`], since it falls off with distance as b does.
pub fn logarithms(field: &ShadowField) -> ShadowField {
    assert_eq!(field.header.kind, FieldKind::Occlusion, "only what blocks is multiplied");
    let (lattice, bands) = (field.header.lattice, field.header.bands);
    let space = LogSpace::new(bands);
    let payload = (0..lattice.stored_count())
        .into_par_iter()
        .flat_map_iter(|sample| {
            let distance = lattice.shell(sample / lattice.stored_direction_count());
            let unscale = lattice.unscale(distance);
            let blocked: Vec<f64> =
                (0..coefficient_count(bands)).map(|k| field.stored(sample, 0, k) * unscale).collect();
            let mut floats: Vec<f32> = space.logarithm(&blocked).iter().map(|log| (log / unscale) as f32).collect();
            floats.resize(field.header.sample_stride(), 0.0);
            floats.into_iter().flat_map(f32::to_le_bytes)
        })
        .collect();
    let header = super::FieldHeader { storage: Storage::F32, ..field.header.clone() };
    ShadowField { header, payload }
}

/// The same field in floats, which hold every half exactly.
pub fn widened(field: &ShadowField) -> ShadowField {
    let payload = match field.header.storage {
        Storage::F32 => field.payload.clone(),
        Storage::F16 => {
            let halves = field.payload.as_chunks::<2>().0.iter().map(|bytes| half::f16::from_le_bytes(*bytes));
            halves.flat_map(|half| half.to_f32().to_le_bytes()).collect()
        }
    };
    ShadowField { header: super::FieldHeader { storage: Storage::F32, ..field.header.clone() }, payload }
}
