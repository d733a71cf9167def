//! Structs that Rust writes and shaders read: every name and offset as the compiler made it, sizes, and strides of
//! arrays.

use crate::common::{gpu, library, usual_permutation};
use ash::vk;
use bytemuck::{Pod, Zeroable};
use shadow_fields::bake::project::{Project, SampleFaces};
use shadow_fields::bake::raster::{Face, Raster};
use shadow_fields::field::FieldKind;
use shadow_fields::gpu::reflect::Reflection;
use shadow_fields::gpu::{Access, Bind, Buffer, Commands, ComputePipeline, TexelView};
// In a shader there is no other entity.
use shadow_fields::gloss::gloss_row;
use shadow_fields::layout::{CLUSTER_FORMAT, Cluster, DeviceEntity as Entity, ENTRY_BITS, GlossEntity};
use shadow_fields::merge::variant::{MergePermutation, Reads, VARIANTS, Variant};
use shadow_fields::shaders::{Library, ShaderPermutation};
use std::mem::offset_of;

/// Compares a struct of the shader with a Rust struct, field by field. The pattern names every field, so one that is
/// missing here does not compile.
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
    let reflection = |variant: &Variant| {
        let row = MergePermutation { variant: *variant, ..usual_permutation() }.row();
        (*variant, library().shader(&row).unwrap().reflection)
    };
    VARIANTS.iter().map(reflection).collect()
}

#[test]
fn glossy_entities() {
    let reflection = library().shader(&gloss_row(false, true)).unwrap().reflection;
    same_layout!(
        reflection,
        GlossEntity {
            row_x,
            row_y,
            row_z,
            albedo,
            roughness,
            eye,
            metallic,
            lights,
            f0,
            sky_scale,
            vertex_first,
            radiosity_first,
            vertex_count,
            mean_energy,
            light_count,
            textured,
            factors,
            glow,
            mirror_plane,
            mirror_place,
            mirror_view,
            probe,
        }
    );
    assert_eq!(reflection.strides.get("GlossEntity"), Some(&(size_of::<GlossEntity>() as u32)));
}

#[test]
fn entities_and_clusters_of_the_merge() {
    for (variant, reflection) in merge() {
        // Variants that read texels are the next test's.
        if variant.reads == Reads::Texels {
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
                unused,
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
                opacity,
                shift,
                albedo,
                scale,
                area_x,
                area_y,
                area_terms,
                silhouette,
                light_kind,
                light_size,
                light_ratio,
                light_ramp,
                half_sides,
            }
        );
        assert_eq!(entity.len(), 20);
        assert_eq!(reflection.strides.get("Entity"), Some(&(size_of::<Entity>() as u32)));
    }
}

/// Two structs whose words are all different, as numbers or as floats.
fn counted<T: Pod>() -> [T; 2] {
    let words: Vec<u32> = (0..2 * size_of::<T>() as u32 / 4).map(|word| 0x4000_0000 + word).collect();
    [0, 1].map(|i| bytemuck::pod_read_unaligned(&bytemuck::cast_slice(&words)[i * size_of::<T>()..][..size_of::<T>()]))
}

/// A shader that reads structs from texels and writes them to blocks, whose layout the test above compares, leaves
/// every word in place.
#[test]
fn entities_and_clusters_read_from_texels() {
    let Some(gpu) = gpu() else { return };
    let folder = tempfile::tempdir().unwrap();
    let text = "#version 460
        #include \"merge_layout.glsl\"
        layout(local_size_x = 2) in;
        #define ENTITY_BINDING 0
        #include \"entities.glsl\"
        #include \"lists.glsl\"
        layout(std430, binding = 3) writeonly buffer EntitiesRead { Entity entities_read[]; };
        layout(std430, binding = 4) writeonly buffer ClustersRead { Cluster clusters_read[]; };
        void main() {
            uint i = gl_GlobalInvocationID.x;
            entities_read[i] = ENTITY(i);
            clusters_read[i] = cluster_at(i);
        }";
    std::fs::write(folder.path().join("structs.comp"), text).unwrap();
    let library = Library { shader_dir: Some(folder.path().to_path_buf()), ..gpu.library.clone() };
    let row = ShaderPermutation::new("structs.comp", 4).define("TEXEL", 1u32).define("UNIFORM", 0u32);
    let shader = library.shader(&row.define("ENTRY_BITS", ENTRY_BITS)).unwrap();
    let pipeline = ComputePipeline::new(&gpu.device, "structs", &shader).unwrap();
    let (entities, clusters) = (counted::<Entity>(), counted::<Cluster>());
    let upload = |bytes: &[u8]| Buffer::with_data(&gpu.device, "structs", bytes).unwrap();
    let written = [upload(bytemuck::bytes_of(&entities)), upload(bytemuck::bytes_of(&clusters))];
    let read = [upload(&[0; 2 * size_of::<Entity>()]), upload(&[0; 2 * size_of::<Cluster>()])];
    let mut commands = Commands::new(&gpu.device, "structs").unwrap();
    let resources = [
        Bind::Texel(TexelView::new(&written[0], vk::Format::R32G32B32A32_SFLOAT).unwrap()),
        Bind::None,
        Bind::Texel(TexelView::new(&written[1], CLUSTER_FORMAT).unwrap()),
        Bind::Buffer(&read[0]),
        Bind::Buffer(&read[1]),
    ];
    commands.dispatch(&pipeline, &resources, &(), [2, 1, 1]).unwrap();
    commands.barrier(Access::ComputeWrite, Access::TransferRead);
    commands.submit().unwrap();
    assert_eq!(read[0].download::<Entity>(2).unwrap(), entities);
    assert_eq!(read[1].download::<Cluster>(2).unwrap(), clusters);
}

#[test]
fn samples_of_captured_faces() {
    for kind in [FieldKind::Occlusion, FieldKind::Radiance] {
        let reflection = library().shader(&Project::row(4, kind)).unwrap().reflection;
        same_layout!(reflection, SampleFaces { slots, scale });
        assert_eq!(reflection.strides.get("SampleFaces"), Some(&(size_of::<SampleFaces>() as u32)));
    }
}

#[test]
fn faces_that_are_computed() {
    let reflection = library().shader(&Raster::row()).unwrap().reflection;
    same_layout!(reflection, Face { eye, right, down, forward, slot, range_first, range_count, unused });
    assert_eq!(reflection.strides.get("Face"), Some(&(size_of::<Face>() as u32)));
}
