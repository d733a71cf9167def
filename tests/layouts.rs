//! Structs that Rust writes and shaders read: every name and offset as the compiler made it, sizes, and strides of arrays.

mod common;

use bytemuck::Zeroable;
use common::library;
use shadow_fields::bake::project::{Job, Project, Projection};
use shadow_fields::bake::raster::{Face, Raster};
use shadow_fields::bake::self_visibility::SelfVisibility;
use shadow_fields::field::{Lattice, Lookup, Storage};
use shadow_fields::gpu::reflect::Reflection;
// In a shader there is no other entity.
use shadow_fields::layout::{Cluster, DeviceEntity as Entity};
use shadow_fields::lists::gather::{ClusterBounds, Gather, Group, Report};
use shadow_fields::lists::skip::Skip;
use shadow_fields::merge::variant::{MergePermutation, VARIANTS, Variant};
use std::mem::offset_of;

/// Compares a struct of the shader with a Rust struct, field by field. The pattern names every field, so one that is missing
/// here does not compile.
macro_rules! same_layout {
    ($reflection:expr, $kind:ident { $($field:ident),* $(,)? }) => {{
        let $kind { $($field: _),* } = $kind::zeroed();
        let rust: Vec<(String, u32)> = vec![$((stringify!($field).into(), offset_of!($kind, $field) as u32)),*];
        let shader = $reflection.structs.get(stringify!($kind));
        assert_eq!(shader, Some(&rust), "{}: shader, then Rust", stringify!($kind));
        rust
    }};
}

fn merge() -> Vec<(Variant, Reflection)> {
    let permutation = |variant| MergePermutation {
        variant,
        bands: 4,
        field_bands: 4,
        storage: Storage::F16,
        lattice: Lattice::default().starting_at(1.02),
        lookup: Lookup::Trilinear,
        skip: Skip::ALL,
        lights: true,
        entity_limit: 48,
    };
    let reflection = |row| library().shader(&row).unwrap().reflection;
    VARIANTS.iter().map(|&variant| (variant, reflection(permutation(variant).row()))).collect()
}

#[test]
fn entities_and_clusters_of_the_merge() {
    for (variant, reflection) in merge() {
        // Variants that read texels take structs apart by the texel; that they agree with the others is tested where they merge.
        if variant.texel {
            continue;
        }
        same_layout!(
            reflection,
            Cluster {
                receiver,
                vertex_first,
                vertex_count,
                transfer_first,
                radiosity_first,
                entry_first,
                entry_count,
                bounds,
                sharp_count,
                self_first,
            }
        );
        assert_eq!(reflection.strides.get("Cluster"), Some(&(size_of::<Cluster>() as u32)));
        let entity = same_layout!(
            reflection,
            Entity {
                centre,
                alpha_beta,
                gamma,
                blocked_base,
                radiance_base,
                radial,
                emission,
                shift,
                albedo,
                area_x,
                area_y,
                area_terms,
                sharp,
            }
        );
        assert_eq!(entity.len(), 13);
        assert_eq!(reflection.strides.get("Entity"), Some(&(size_of::<Entity>() as u32)));
    }
}

#[test]
fn structs_of_the_gather() {
    for (texel, roomy) in [(false, false), (true, false), (false, true), (true, true)] {
        let reflection = library().shader(&Gather::row(texel, roomy)).unwrap().reflection;
        same_layout!(reflection, Group { first, count, bounds, left });
        assert_eq!(reflection.strides.get("Group"), Some(&(size_of::<Group>() as u32)));
        same_layout!(reflection, Report { longest, most_found, entry_total, left_count });
        // Two quads: centre and radius, axis and cosine.
        assert_eq!(reflection.strides.get("Bounds"), Some(&(size_of::<ClusterBounds>() as u32)));
        assert_eq!(
            [offset_of!(ClusterBounds, radius_m), offset_of!(ClusterBounds, axis), offset_of!(ClusterBounds, cosine)],
            [12, 16, 28]
        );
        assert_eq!(reflection.strides.get("Entity"), Some(&(size_of::<Entity>() as u32)));
    }
}

#[test]
fn jobs_of_captured_faces() {
    for projection in [Projection::Blocked, Projection::Radiance, Projection::Transfer] {
        let reflection = library().shader(&Project::row(4, projection)).unwrap().reflection;
        same_layout!(reflection, Job { normal, slots, target, scale });
        assert_eq!(reflection.strides.get("Job"), Some(&(size_of::<Job>() as u32)));
    }
    let reflection = library().shader(&SelfVisibility::row()).unwrap().reflection;
    same_layout!(reflection, Job { normal, slots, target, scale });
    assert_eq!(reflection.strides.get("Job"), Some(&(size_of::<Job>() as u32)));
}

#[test]
fn faces_that_are_computed() {
    for distance in [false, true] {
        let reflection = library().shader(&Raster::row(distance)).unwrap().reflection;
        same_layout!(reflection, Face { eye, right, down, forward, slot, run_first, run_count, unused });
        assert_eq!(reflection.strides.get("Face"), Some(&(size_of::<Face>() as u32)));
    }
}

#[test]
fn a_moved_field_is_noticed() {
    let mut reflection = library().shader(&Project::row(4, Projection::Blocked)).unwrap().reflection;
    reflection.structs.get_mut("Job").unwrap().swap(2, 3);
    assert!(std::panic::catch_unwind(|| same_layout!(reflection, Job { normal, slots, target, scale })).is_err());
}
