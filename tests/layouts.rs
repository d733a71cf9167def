//! Structs that Rust writes and shaders read: every name and offset as the compiler made it, sizes, and strides of arrays.

mod common;

use bytemuck::Zeroable;
use common::library;
use shadow_fields::bake::project::{Job, Project, Projection};
use shadow_fields::field::{Lattice, Lookup, Storage};
use shadow_fields::gpu::reflect::Reflection;
use shadow_fields::layout::{Entity, Push};
use shadow_fields::render::variant::{Form, VARIANTS};
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

fn merge() -> Vec<Reflection> {
    let form = |variant, lights| Form {
        variant,
        bands: 4,
        storage: Storage::F16,
        lattice: Lattice::default().starting_at(1.02),
        lookup: Lookup::Trilinear,
        lights,
        sky: true,
    };
    let rows = VARIANTS.iter().flat_map(|&variant| [form(variant, 1), form(variant, 4)]);
    rows.map(|form| library().shader(&form.row()).unwrap().reflection).collect()
}

#[test]
fn entities_and_push_constants_of_the_merge() {
    for reflection in merge() {
        let entity = same_layout!(
            reflection,
            Entity {
                centre,
                to_object_x,
                to_object_y,
                to_object_z,
                emission,
                albedo,
                radial,
                blocked_base,
                radiance_base,
                rank,
                spare,
            }
        );
        assert_eq!(entity.len(), 11);
        assert_eq!(reflection.strides.get("Entity"), Some(&(size_of::<Entity>() as u32)));
        same_layout!(
            reflection,
            Push {
                vertex_first,
                vertex_count,
                transfer_first,
                receiver,
                occluder_first,
                occluder_count,
                accumulate,
                spare,
                light,
                digit,
            }
        );
        // The reflected size leaves no room behind the last field, and Rust's adds no padding.
        assert_eq!(reflection.push_bytes as usize, size_of::<Push>());
        assert!(reflection.push_bytes <= 128, "more than every device takes");
    }
}

#[test]
fn jobs_of_the_projection() {
    for projection in [Projection::Blocked, Projection::Radiance, Projection::Transfer] {
        let reflection = library().shader(&Project::row(4, projection)).unwrap().reflection;
        same_layout!(reflection, Job { normal, slots, target, scale });
        assert_eq!(reflection.strides.get("Job"), Some(&(size_of::<Job>() as u32)));
    }
}

#[test]
fn a_moved_field_is_noticed() {
    let mut reflection = library().shader(&Project::row(4, Projection::Blocked)).unwrap().reflection;
    reflection.structs.get_mut("Job").unwrap().swap(2, 3);
    assert!(std::panic::catch_unwind(|| same_layout!(reflection, Job { normal, slots, target, scale })).is_err());
}
