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
use crate::error::{Error, Result};
use crate::field::lattice::{OUTSIDE_INNER, ROOMY_INNER};
use crate::field::quantity::{FieldKind, Storage};
use crate::field::{FieldHeader, Fit, Lattice};
use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};

/// Everything besides the mesh that decides a stored number. All of it is part of the name under which the cache keeps
/// a field.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Options {
    pub bands: usize,
    pub storage: Storage,
    /// Sample points. The first shell may be left to the bake.
    pub lattice: Lattice,
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
        bands: options.bands,
        storage: options.storage,
        lattice,
        face_px: options.face_px,
        level_texels: if kind == FieldKind::Occlusion && options.levels { levels::texels(mesh) } else { 0.0 },
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

/// What decides a bake: a quality, and what overrides parts of it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "cli", derive(clap::Args), command(next_help_heading = "Baking"))]
pub struct BakeOptions {
    /// How finely fields are sampled and stored
    #[cfg_attr(feature = "cli", arg(long, value_enum, default_value = "normal", value_name = "QUALITY"))]
    pub quality: Quality,
    /// Sample points in place of the quality's: cube:SHELLSxCELLS, with an odd number of cells. Words may follow after
    /// commas: inner=R, outer=R (in bounding radii), edges (samples on the edges of cube faces: finer steps in as many
    /// bytes, not for boxes), edges=auto (the mesh decides). Example: cube:20x7,edges=auto
    #[cfg_attr(feature = "cli", arg(long, value_name = "LATTICE"))]
    pub lattice: Option<Lattice>,
    /// Edge of a captured cube face in texels, in place of the quality's
    #[cfg_attr(feature = "cli", arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(4..=1024)))]
    pub face_px: Option<u32>,
    /// SH bands of light, transfer and what is stored, 2 to 7, in place of the quality's; N bands are N*N coefficients
    #[cfg_attr(feature = "cli", arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..=7)))]
    pub bands: Option<u32>,
    /// Number format of stored coefficients
    #[cfg_attr(feature = "cli", arg(long, value_name = "f16|f32"))]
    pub storage: Option<Storage>,
}

impl From<Quality> for BakeOptions {
    fn from(quality: Quality) -> Self {
        BakeOptions { quality, ..Default::default() }
    }
}

impl BakeOptions {
    /// What the bake does: the quality, and what is said of each part.
    ///
    /// # Errors
    /// `Input` where a number is out of its range.
    pub fn resolve(self) -> Result<Options> {
        let of_quality = self.quality.options();
        if self.bands.is_some_and(|bands| !(2..=7).contains(&bands)) {
            return Err(Error::Input("expected 2 to 7 bands".into()));
        }
        let face_px = self.face_px.unwrap_or(of_quality.face_px);
        if !(4..=1024).contains(&face_px) {
            return Err(Error::Input(format!("expected faces of 4 to 1024 px, got {face_px}")));
        }
        Ok(Options {
            lattice: self.lattice.unwrap_or(of_quality.lattice),
            face_px,
            bands: self.bands.map_or(of_quality.bands, |bands| bands as usize),
            storage: self.storage.unwrap_or(of_quality.storage),
            ..of_quality
        })
    }
}

#[cfg(all(test, feature = "cli"))]
mod tests {
    use super::*;
    use clap::{Parser, ValueEnum};

    #[derive(Parser)]
    struct CommandLine {
        #[command(flatten)]
        bake: BakeOptions,
    }

    fn parsed(words: &[&str]) -> Options {
        CommandLine::try_parse_from([&["line"], words].concat()).unwrap().bake.resolve().unwrap()
    }

    #[test]
    fn every_quality_is_a_row_of_options() {
        assert_eq!(parsed(&[]), Quality::Normal.options());
        let all: Vec<Options> = ["draft", "normal", "high"].map(|word| parsed(&["--quality", word])).to_vec();
        assert_eq!(all, Quality::value_variants().iter().map(|quality| quality.options()).collect::<Vec<_>>());
        assert_eq!(all[1], parsed(&[]), "normal is what there is without the option");
        assert_eq!("cube:20x7,edges=auto".parse(), Ok(Lattice::default()), "as help texts write it");
        for pair in all.windows(2) {
            let samples = pair.iter().map(|o| o.lattice.stored_count()).collect::<Vec<_>>();
            assert!(pair[0].face_px < pair[1].face_px && pair[0].bands < pair[1].bands && samples[0] < samples[1]);
        }
    }

    #[test]
    fn a_single_switch_overrides_the_quality() {
        let high = Quality::High.options();
        for words in [&["--quality", "high", "--bands", "4"], &["--bands", "4", "--quality", "high"]] {
            assert_eq!(parsed(words), Options { bands: 4, ..high });
        }
        let lattice = "cube:9x5".parse().unwrap();
        assert_eq!(
            parsed(&["--quality=draft", "--lattice=cube:9x5", "--face-px=40", "--storage=f32"]),
            Options { lattice, face_px: 40, storage: Storage::F32, ..Quality::Draft.options() }
        );
    }
}
