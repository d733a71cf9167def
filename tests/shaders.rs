//! Every shader that the program compiles does compile, and the SPIR-V is valid by the judgement of spirv-val.

mod common;

use ash::vk;
use common::{library, skip};
use rayon::prelude::*;
use shadow_fields::bake::assemble::Assemble;
use shadow_fields::bake::capture::Capture;
use shadow_fields::bake::project::Project;
use shadow_fields::bake::raster::Raster;
use shadow_fields::bake::silhouette::SilhouetteOptions;
use shadow_fields::bounce::boxes::hidden_row;
use shadow_fields::bounce::movers::{distant_row, movers_row, outgoing_row};
use shadow_fields::bounce::{bounce_row, means_row, relax_row};
use shadow_fields::draw::grid::DrawGrid;
use shadow_fields::draw::mirror::Mirrored;
use shadow_fields::draw::pixel_light::{LightImages, Receiver, Step};
use shadow_fields::draw::smooth::Smooth;
use shadow_fields::draw::sun_map::SunMaps;
use shadow_fields::draw::triangles::{Detail, DrawTriangles, Form, Look};
use shadow_fields::field::{FieldKind, Lattice, Storage};
use shadow_fields::gloss::gloss_row;
use shadow_fields::gpu::Shader;
use shadow_fields::gpu::reflect::Reflection;
use shadow_fields::lists::skip::Skip;
use shadow_fields::merge::variant::{MergePermutation, Reads, VARIANTS, Variant};
use shadow_fields::shaders::{FILES, ShaderPermutation};
use shadow_fields::sharp::SharpPermutation;
use std::collections::{BTreeSet, HashSet};
use std::process::Command;

const BANDS: std::ops::RangeInclusive<usize> = 2..=7;
const KINDS: [FieldKind; 2] = [FieldKind::Occlusion, FieldKind::Radiance];

fn baking() -> Vec<ShaderPermutation> {
    let project = BANDS.flat_map(|bands| KINDS.map(|kind| Project::row(bands, kind)));
    let assemble = [Storage::F16, Storage::F32].map(Assemble::row);
    let capture = KINDS.into_iter().flat_map(Capture::rows);
    project.chain([Raster::row()]).chain(assemble).chain(capture).collect()
}

fn bouncing() -> Vec<ShaderPermutation> {
    let rows = |texels| {
        [
            means_row(texels, false),
            means_row(texels, true),
            relax_row(texels, false),
            relax_row(texels, true),
            bounce_row(texels, false, true),
            bounce_row(texels, true, false),
            bounce_row(texels, true, true),
            gloss_row(texels, true),
            gloss_row(texels, false),
        ]
    };
    let usual = usual_permutation();
    let of_movers = |variant: &Variant| {
        let merge = MergePermutation { variant: *variant, ..usual };
        [
            outgoing_row(&merge),
            distant_row(&merge),
            hidden_row(&merge, false),
            hidden_row(&merge, true),
            movers_row(&merge, false),
            movers_row(&merge, true),
        ]
    };
    let few = MergePermutation { bands: 2, ..usual };
    let movers = VARIANTS.iter().flat_map(of_movers).chain([movers_row(&few, true)]);
    [false, true].into_iter().flat_map(rows).chain(movers).collect()
}

/// A way of the pass of sharp lights: each of six bits switches several of its parts.
fn sharp_way(bits: u32) -> SharpPermutation {
    let on = |bit: u32| bits >> bit & 1 == 1;
    SharpPermutation {
        reads: [Reads::Storage, Reads::StorageUniform, Reads::Texels][bits as usize % 3],
        entity_limit: 48,
        silhouette: SilhouetteOptions::default(),
        outlines: on(2),
        panels: on(3),
        halves: on(2) != on(3),
        boxes: on(2) != on(4),
        colors: on(1) != on(3),
        sheets: on(1),
        cuboids: on(1) != on(2),
        globes: on(3),
        sun_maps: on(1) != on(4),
        lamp_maps: on(0) != on(4),
        gloss: on(0),
        many_shown: on(0) && on(1),
        lamps: on(0),
        self_shadows: on(4),
        edges: on(0) == on(2),
        rolled: on(5),
    }
}

fn sharp() -> Vec<ShaderPermutation> {
    (0..64).map(|bits| sharp_way(bits).row()).collect()
}

fn drawing() -> Vec<ShaderPermutation> {
    // Without lights of any form but balls, and with all of them.
    let sharp = [0, 0b10_0110].map(|bits| {
        let all = bits > 0;
        let way = SharpPermutation { reads: Reads::Texels, panels: all, cuboids: all, globes: all, ..sharp_way(bits) };
        SharpPermutation { gloss: all, many_shown: all, lamps: false, self_shadows: true, edges: true, ..way }
    });
    let ways = [None, Some(&sharp[0]), Some(&sharp[1])];
    let glossy = ways.into_iter().flat_map(|highlights| {
        let rows = [
            (Detail::Rough, Mirrored::Nothing),
            (Detail::Mirror, Mirrored::Planes),
            (Detail::Mirror, Mirrored::PlanesAndProbes),
            (Detail::Textured, Mirrored::PlanesAndProbes),
        ];
        rows.map(|(detail, mirrored)| Look::Glossy { highlights, detail, mirrored })
    });
    let looks: Vec<Look<'_>> = [Look::Plain, Look::Painted].into_iter().chain(glossy).collect();
    let triangles = looks.iter().flat_map(|&look| {
        // Alone, and of four samples a pixel.
        let of = |samples: u32| {
            [Form::Vertices, Form::Pixels, Form::Over].map(|form| DrawTriangles::rows(samples, look, form)).concat()
        };
        [of(1), of(4)].concat()
    });
    let mut rows: Vec<ShaderPermutation> = triangles.collect();
    rows.extend([false, true].into_iter().flat_map(DrawGrid::rows));
    rows.extend([false, true].into_iter().flat_map(SunMaps::rows));
    rows.extend(Receiver::ALL.iter().flat_map(|receiver| LightImages::rows(*receiver)));
    rows.extend([Step::Coarse, Step::Fine].map(LightImages::select_row));
    rows.extend(sharp.iter().map(LightImages::evaluate_row));
    rows.push(Smooth::fragment());
    let plain =
        ["overlay.vert", "overlay.frag", "show.vert", "show.frag", "sky.frag", "smooth.vert", "mirror_far.frag"];
    rows.extend(plain.map(|file| ShaderPermutation::new(file, 4)));
    rows
}

fn measuring() -> Vec<ShaderPermutation> {
    let rate = |kind: u32| {
        let row = ShaderPermutation::new("ceiling.comp", 4).define("KIND", kind);
        row.define("READS", 16_u32).define("ROUNDS", 16_u32).define("MASK", 1023_u32)
    };
    (0..4).map(rate).collect()
}

/// The merge of usual scenes.
fn usual_permutation() -> MergePermutation {
    MergePermutation {
        variant: VARIANTS[0],
        bands: 4,
        storage: Storage::F16,
        lattice: Lattice { inner: 1.02, ..Lattice::default() },
        skip: Skip::ALL,
        lights: true,
        sheets: true,
        volume: false,
        gloss: false,
        entity_limit: 48,
    }
}

/// A usual permutation, everything that differs from it in one choice, and a few far from it.
fn merging() -> Vec<ShaderPermutation> {
    let usual = usual_permutation();
    let mut permutations = vec![usual];
    let skips = ["none", "horizon", "cones", "caps"].map(|skip| skip.parse().unwrap());
    permutations.extend(skips.map(|skip| MergePermutation { skip, ..usual }));
    // Seven bands take 33 s to optimise, six 5 s, four 0.6 s: seven are left out.
    permutations.extend((2..=6).map(|bands| MergePermutation { bands, ..usual }));
    for &variant in VARIANTS {
        permutations.extend([Storage::F16, Storage::F32].map(|storage| MergePermutation { variant, storage, ..usual }));
        permutations.push(MergePermutation { variant, storage: Storage::F32, bands: 3, skip: Skip::NONE, ..usual });
    }
    permutations.push(MergePermutation { lattice: "cube:1x1,inner=1.02".parse().unwrap(), ..usual });
    permutations.push(MergePermutation { lights: false, ..usual });
    permutations.push(MergePermutation { sheets: false, ..usual });
    permutations.push(MergePermutation { volume: true, ..usual });
    permutations.push(MergePermutation { gloss: true, ..usual });
    let variant = Variant::named("texel-shifted").unwrap();
    permutations.push(MergePermutation { variant, lattice: "cube:8x3".parse().unwrap(), ..usual });
    permutations.iter().map(MergePermutation::row).collect()
}

/// Asserts that a shader asks for no more than all devices of Vulkan 1.3 have, but for storage buffers and images.
fn assert_served(shader: &Shader) {
    let Reflection { push_bytes, shared_bytes, local_size, bindings, .. } = &shader.reflection;
    let invocations: u32 = local_size.iter().product();
    assert!(*push_bytes <= 128 && *shared_bytes <= 16_384 && invocations <= 128, "{}", shader.name);
    let uniform = bindings.iter().filter(|binding| binding.kind == vk::DescriptorType::UNIFORM_BUFFER).count();
    assert!(uniform <= 12 && bindings.len() <= 128, "{}", shader.name);
}

#[test]
fn shaders_are_valid_and_every_entry_point_is_among_them() {
    let validator = || Command::new("spirv-val");
    let has_validator = validator().arg("--version").output().is_ok_and(|output| output.status.success());
    if !has_validator {
        skip("spirv-val is not on the path (Debian's package is spirv-tools)");
    }
    let rows = [merging(), drawing(), sharp(), bouncing(), baking(), measuring()].into_iter().flatten();
    let rows: HashSet<ShaderPermutation> = rows.collect();
    rows.par_iter().for_each(|row| {
        let shader = library().shader(row).unwrap_or_else(|error| panic!("{row:?}: {error}"));
        assert_served(&shader);
        if has_validator {
            let file = tempfile::NamedTempFile::new().unwrap();
            std::fs::write(file.path(), bytemuck::cast_slice(&shader.spirv)).unwrap();
            let output = validator().args(["--target-env", "vulkan1.3"]).arg(file.path()).output().unwrap();
            assert!(output.status.success(), "{row:?}: {output:?}");
        }
    });
    let compiled: BTreeSet<&str> = rows.iter().map(|row| row.file).collect();
    let there: BTreeSet<&str> = FILES.iter().map(|(name, _)| *name).filter(|name| !name.ends_with(".glsl")).collect();
    assert_eq!(compiled, there);
    common::report(&format!("{} rows", rows.len()));
}

#[test]
fn other_endings_and_missing_files_are_refused() {
    for file in ["field.glsl", "absent.comp"] {
        let error = library().shader(&ShaderPermutation::new(file, 4)).unwrap_err();
        assert!(error.to_string().contains(file), "{error}");
    }
}
