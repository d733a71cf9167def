//! Names of what the cache keeps: hashes of the mesh's content and of everything else that decides the numbers.

use super::Options;
use super::silhouette::silhouette_header;
use crate::asset::mesh::Mesh;
use crate::field::FieldHeader;
use crate::field::file::VERSION;
use crate::field::silhouette::SilhouetteHeader;
use serde::Serialize;

pub(super) fn key(header: &impl Serialize) -> String {
    let text = serde_json::to_vec(header).expect("headers are plain data");
    blake3::Hasher::new().update(&VERSION.to_le_bytes()).update(&text).finalize().to_hex()[..32].to_owned()
}

/// What decides a field: its header without the mesh's name and without what only the bake finds out.
pub(super) fn identity(header: &FieldHeader) -> FieldHeader {
    FieldHeader { mesh: String::new(), filled_samples: 0, captured_samples: 0, ..header.clone() }
}

/// The name of a field in the cache. Fields with equal content have equal names.
pub fn field_name(header: &FieldHeader) -> String {
    key(&identity(header))
}

/// What decides a silhouette field: its header without the mesh's name.
pub(super) fn silhouette_identity(header: &SilhouetteHeader) -> SilhouetteHeader {
    SilhouetteHeader { mesh: String::new(), ..header.clone() }
}

/// The name of the silhouette field of a mesh in the cache.
pub(super) fn silhouette_name(mesh: &Mesh, options: &Options) -> String {
    key(&silhouette_identity(&silhouette_header(mesh, options.silhouette)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::generate;
    use crate::bake::Wanted;
    use crate::bake::silhouette::SilhouetteOptions;
    use crate::bake::surfaces::GroupPlan;
    use crate::field::{FieldKind, Storage};
    use std::collections::BTreeSet;
    use std::sync::Arc;

    /// Names of occlusion field, radiance field, own visibility and silhouette field.
    fn names(mesh: &Mesh, options: &Options) -> [String; 4] {
        let field = |kind| field_name(&crate::bake::header(mesh, kind, options));
        let own = GroupPlan::alone(&Arc::new(mesh.clone()), options, Wanted::BOTH).key.unwrap();
        [field(FieldKind::Occlusion), field(FieldKind::Radiance), own, silhouette_name(mesh, options)]
    }

    /// Each option that is flipped changes the names of what it decides, and no other names.
    #[test]
    fn every_option_is_part_of_the_names_that_it_decides() {
        // Large enough for levels of detail, which radiance fields of many colours are captured without.
        let mesh = generate::torus_two_colour(1.0, 0.3, 64, 32);
        let base = Options::default();
        // A new option does not compile here until it has a row below.
        let Options { bands, field_bands, storage, lattice, face_px, silhouette, levels, vertices: _, groups: _ } =
            base;
        assert!(field_bands.is_none() && storage == Storage::F16);
        let fields = [true, true, false, false];
        let silhouettes = |silhouette| Options { silhouette, ..base };
        let SilhouetteOptions { cells, map_px, view_px, levels: _ } = silhouette;
        let outlines = [false, false, false, true];
        let flipped: Vec<(&str, Options, [bool; 4])> = vec![
            ("bands", Options { bands: bands + 1, ..base }, [true, true, true, false]),
            ("field_bands", Options { field_bands: Some(bands + 2), ..base }, [true, false, false, false]),
            ("storage", Options { storage: Storage::F32, ..base }, fields),
            ("lattice", Options { lattice: "cube:4x3".parse().unwrap(), ..base }, fields),
            ("face_px", Options { face_px: face_px / 2, ..base }, fields),
            ("cells", silhouettes(SilhouetteOptions { cells: 2 * cells, ..silhouette }), outlines),
            ("map_px", silhouettes(SilhouetteOptions { map_px: 2 * map_px, ..silhouette }), outlines),
            ("levels", Options { levels: !levels, ..base }, [true, false, false, false]),
            ("levels of outlines", silhouettes(SilhouetteOptions { levels: false, ..silhouette }), outlines),
            ("view_px", silhouettes(SilhouetteOptions { view_px: 2 * view_px, ..silhouette }), outlines),
        ];
        assert_ne!(lattice, flipped[3].1.lattice);
        let usual = names(&mesh, &base);
        let mut distinct = BTreeSet::new();
        for (option, options, decides) in flipped {
            let found = names(&mesh, &options);
            for ((name, usual), decides) in found.iter().zip(&usual).zip(decides) {
                assert_eq!(name != usual, decides, "{option}");
                assert!(!decides || distinct.insert(name.clone()), "{option}: the name of another option's change");
            }
        }
    }
}
