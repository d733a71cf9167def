//! Structs that Rust writes and shaders read: every name and offset as the compiler made it, sizes, and strides of
//! arrays.

use crate::common::{library, usual_permutation};
use bytemuck::Zeroable;
use shadow_fields::bake::project::{Project, SampleFaces};
use shadow_fields::bake::raster::{Face, Raster};
use shadow_fields::field::FieldKind;
use shadow_fields::gloss::gloss_row;
// In a shader there is no other entity.
use shadow_fields::layout::{Cluster, DeviceEntity as Entity, GlossEntity};
use shadow_fields::merge::variant::{MergePermutation, Reads, VARIANTS};
use std::mem::offset_of;

/// Compares a struct of the shader with a Rust struct, field by field, and the stride of arrays of it. The pattern
/// names every field, so one that is missing here does not compile.
macro_rules! same_layout {
    ($reflection:expr, $kind:ident: $($field:ident)*) => {
        let $kind { $($field: _),* } = $kind::zeroed();
        let rust: Vec<(String, u32)> = vec![$((stringify!($field).into(), offset_of!($kind, $field) as u32)),*];
        let shader = $reflection.structs.get(stringify!($kind));
        assert_eq!(shader, Some(&rust), "{}: shader, then Rust", stringify!($kind));
        assert_eq!($reflection.strides.get(stringify!($kind)), Some(&(size_of::<$kind>() as u32)));
    };
}

#[test]
fn glossy_entities() {
    let reflection = library().shader(&gloss_row(false, true)).unwrap().reflection;
    same_layout!(reflection, GlossEntity: row_x row_y row_z albedo roughness eye metallic lights more_lights f0 sky_scale
        vertex_first radiosity_first vertex_count mean_energy light_count textured factors glow mirror_x
        mirror_y mirror_z mirror_offset mirror_left mirror_behind mirror_share mirror_view probe);
}

#[test]
fn entities_and_clusters_of_the_merge() {
    // What reads them from texels is generated with their fields, and `check` holds it against twins.
    for variant in VARIANTS.iter().filter(|variant| variant.reads != Reads::Texels) {
        let row = MergePermutation { variant: *variant, ..usual_permutation() }.row();
        let reflection = library().shader(&row).unwrap().reflection;
        same_layout!(reflection, Cluster: receiver vertex_first vertex_count transfer_first radiosity_first entry_first
            entry_count unused sharp_count self_first);
        same_layout!(reflection, Entity: centre alpha_beta gamma blocked_base radiance_base radial emission opacity
            shift albedo scale area_x area_y area_terms silhouette light_kind light_size light_ratio light_ramp
            half_sides irradiance_first unused unused_pair);
    }
}

#[test]
fn samples_of_captured_faces() {
    for kind in [FieldKind::Occlusion, FieldKind::Radiance] {
        let reflection = library().shader(&Project::row(4, kind)).unwrap().reflection;
        same_layout!(reflection, SampleFaces: slots scale);
    }
}

#[test]
fn faces_that_are_computed() {
    let reflection = library().shader(&Raster::row()).unwrap().reflection;
    same_layout!(reflection, Face: eye right down forward slot range_first range_count unused);
}
