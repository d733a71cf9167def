//! What decides a bake: its options, and the header of the field, which follows from the options and a mesh.
//!
//! `--quality` names them in one word ([`Quality`]); times, bytes and errors are in `docs/measured.md`. More samples do
//! not help small lights in bands: the number of bands limits them.

use super::levels;
use super::silhouette::SilhouetteOptions;
use super::surface::depth_at_origin;
use super::triangles::unit_positions;
use crate::asset::mesh::Mesh;
use crate::asset::topology::volume_m3;
use crate::field::lattice::{OUTSIDE_INNER, ROOMY_INNER};
use crate::field::quantity::{FieldKind, Storage};
use crate::field::{FieldHeader, Fit, Lattice};
use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};

/// Everything besides the mesh that decides a stored number. All of it is part of the name under which the cache keeps
/// a field.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Options {
    /// SH bands of transfers and radiance fields.
    pub bands: usize,
    /// SH bands of occlusion fields; `None` means as many as `bands`.
    pub field_bands: Option<usize>,
    pub storage: Storage,
    /// Sample points. The first shell may be left to the bake.
    pub lattice: Lattice,
    /// Edge of a captured face in texels.
    pub face_px: u32,
    pub silhouette: SilhouetteOptions,
    /// Vertices to which the surfaces of a scene may be refined where light varies; 0 leaves meshes as they are.
    pub vertices: u32,
    /// Whether entities that never move against each other are a group.
    pub groups: bool,
    /// Whether fewer and larger triangles stand for those of a large mesh that are far from the eye (see
    /// [`super::levels`]).
    pub levels: bool,
}

impl Default for Options {
    /// 4 bands, f16, the default lattice, 64 px, meshes as they are, every entity by itself: what the errors of the
    /// method are measured with. On faces of 64 px the coefficients of a binary cap are wrong by
    /// 0.0033 (relative root mean square). With 32 px they are wrong by 0.0093, and with 16 px by 0.028.
    fn default() -> Self {
        Options {
            bands: 4,
            field_bands: None,
            storage: Storage::default(),
            lattice: Lattice::default(),
            face_px: 64,
            silhouette: SilhouetteOptions::default(),
            vertices: 0,
            groups: false,
            levels: true,
        }
    }
}

impl Options {
    pub fn occlusion_bands(&self) -> usize {
        self.field_bands.unwrap_or(self.bands)
    }

    /// The share of a texel by which captures of a mesh without colours may miss it.
    pub(super) fn level_texels(&self, mesh: &Mesh) -> f64 {
        if self.levels { levels::texels(mesh) } else { 0.0 }
    }

    /// SH bands of the kind of field that has the most.
    pub fn most_bands(&self) -> usize {
        self.bands.max(self.occlusion_bands())
    }
}

/// The first shell that an object needs, in the lattice's space. It lies just off an object that fills a ball. If the
/// centre is inside another solid, it lies at the distance of the surface from the centre, since no receiver comes
/// nearer. Otherwise it is [`ROOMY_INNER`].
pub fn first_shell(fit: &Fit, positions: &[Vec3], triangles: &[[u32; 3]]) -> f64 {
    let placed: Vec<Vec3> = positions.iter().map(|p| fit.apply(p.as_dvec3()).as_vec3()).collect();
    let corners: Vec<[DVec3; 3]> = triangles.iter().map(|t| t.map(|i| placed[i as usize].as_dvec3())).collect();
    let Some(nearest) = depth_at_origin(&corners) else { return ROOMY_INNER };
    let farthest = placed.iter().map(|p| f64::from(p.length())).fold(0.0, f64::max);
    // The facets of a tessellated sphere lie a few percent inside the sphere.
    if nearest > 0.93 * farthest { OUTSIDE_INNER * farthest.max(1.0) } else { nearest.max(ROOMY_INNER) }
}

/// A solid counts as a box if it fills at least this share of its bounding box.
const BOXED: f64 = 0.9;

/// Whether samples on the edges of a cube's faces serve a solid. They serve most solids, but none that fills its box.
/// The edges of a box lie where those samples are. A sample below an edge is captured off one of two sides at random,
/// which serves neither side. A cube's field over a floor is wrong by 0.034 with such samples and by 0.023 without
/// (relative root mean square).
fn is_served_by_edges(positions: &[Vec3], triangles: &[[u32; 3]]) -> bool {
    let (low, high) = positions.iter().fold((Vec3::MAX, Vec3::MIN), |(l, h), p| (l.min(*p), h.max(*p)));
    let boxed = (high - low).as_dvec3().element_product();
    volume_m3(positions, triangles, Vec3::ZERO).abs() < BOXED * boxed
}

/// The hash of a mesh's content as headers hold it.
pub fn hash_text(mesh: &Mesh) -> String {
    mesh.content_hash().iter().map(|byte| format!("{byte:02x}")).collect()
}

/// The header of the field that a bake of `mesh` makes. What only the bake finds out is empty or 0.
pub fn header(mesh: &Mesh, kind: FieldKind, options: &Options) -> FieldHeader {
    let (centre, radius_m) = mesh.bounding_sphere();
    let positions = unit_positions(mesh);
    let first = |fit: &Fit| first_shell(fit, &positions, &mesh.triangles);
    let mut lattice = options.lattice.fitted(Fit::new(&positions), first);
    lattice.edges.get_or_insert_with(|| is_served_by_edges(&positions, &mesh.triangles));
    let brightest = mesh.colors.iter().flatten().map(|c| c.max_element()).fold(0.0, f32::max);
    FieldHeader {
        kind,
        bands: if kind == FieldKind::Occlusion { options.occlusion_bands() } else { options.bands },
        storage: options.storage,
        lattice,
        face_px: options.face_px,
        level_texels: if kind == FieldKind::Occlusion { options.level_texels(mesh) } else { 0.0 },
        filled_samples: 0,
        captured_samples: 0,
        centre_m: centre.to_array(),
        radius_m,
        radiance_scale: if kind == FieldKind::Radiance && mesh.colors.is_some() { brightest } else { 1.0 },
        mesh: mesh.name.clone(),
        mesh_hash: hash_text(mesh),
    }
}

/// Lattice, faces and bands in one word.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
pub enum Quality {
    /// A sixth of the time and of the bytes; light in bands has 1.2 to 1.6 times the error: cube:8x5,edges=auto, 32 px,
    /// 3 bands
    Draft,
    /// The default: cube:20x7,edges=auto, 64 px, 4 bands
    #[default]
    Normal,
    /// 4.4 times the time and 3 times the bytes; light in bands has 0.54 to 0.81 of the error:
    /// cube:24x9,edges=auto, 128 px, 5 bands
    High,
}

impl Quality {
    pub fn options(self) -> Options {
        let normal = Options { vertices: 40_000, groups: true, ..Options::default() };
        let lattice = |text: &str| text.parse().expect("a lattice of the table");
        match self {
            Quality::Draft => Options {
                lattice: lattice("cube:8x5,edges=auto"),
                face_px: 32,
                bands: 3,
                silhouette: SilhouetteOptions { cells: 4, ..normal.silhouette },
                vertices: 10_000,
                ..normal
            },
            Quality::Normal => normal,
            Quality::High => Options {
                lattice: lattice("cube:24x9,edges=auto"),
                face_px: 128,
                bands: 5,
                silhouette: SilhouetteOptions { cells: 16, ..normal.silhouette },
                vertices: 200_000,
                ..normal
            },
        }
    }
}
