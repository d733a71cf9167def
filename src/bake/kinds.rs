//! The kinds of things that are baked of a mesh, and what each of them takes.

use super::batches::{CaptureCost, estimated_seconds};
use super::{Options, bakes_transfer, levels};
use crate::asset::Mesh;
use crate::field::FieldKind;
use crate::field::quantity::channel_stride;
use crate::field::self_visibility::BYTES;
use crate::field::silhouette_nodes::NodeGrid;
use serde::{Deserialize, Serialize};

/// Faces that the eye of a sample or a vertex sees the mesh in, on average: 24 025 for 5 028 samples of the teapot.
const FACES: f64 = 4.8;
/// Share of a lattice's samples that are captured: the others are turned by a symmetry or see nothing.
const CAPTURED_SHARE: f64 = 0.75;

/// A kind of thing that is baked of a mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// Occlusion field.
    Shadow,
    /// Radiance field.
    Light,
    /// Silhouette field.
    Silhouette,
    /// Transfer vector and self-visibility of every vertex.
    Vertices,
}

impl Kind {
    /// Everything that a scene may need of a mesh.
    pub fn of(mesh: &Mesh) -> Vec<Self> {
        let mut kinds = vec![Kind::Shadow];
        kinds.extend(mesh.colors.is_some().then_some(Kind::Light));
        kinds.push(Kind::Silhouette);
        if bakes_transfer(mesh) {
            kinds.push(Kind::Vertices);
        }
        kinds
    }

    /// Whether a bake of this kind can be cut into parts. A silhouette field stays whole, because it takes a small share of all bakes of a
    /// mesh.
    pub fn is_cut(self) -> bool {
        self != Kind::Silhouette
    }

    /// The kind of its field, for those that have one.
    pub(super) fn field(self) -> FieldKind {
        if self == Kind::Light { FieldKind::Radiance } else { FieldKind::Occlusion }
    }

    /// Estimated seconds of a bake on two cores of a software device.
    pub fn seconds(self, mesh: &Mesh, options: &Options) -> f64 {
        let eyes = match self {
            Kind::Shadow | Kind::Light => CAPTURED_SHARE * f64::from(options.lattice.starting_at(1.0).sample_count()),
            Kind::Silhouette => {
                let levels = levels::are_used(mesh, options.silhouette.levels);
                let maps = NodeGrid::map_count(options.silhouette.cells) as u64;
                return estimated_seconds(CaptureCost::DRAWN, (mesh, levels), maps, 0, 1);
            }
            Kind::Vertices => mesh.positions.len() as f64,
        };
        let levels = self != Kind::Light && levels::are_used(mesh, options.levels);
        let cost = if self == Kind::Light { CaptureCost::DRAWN } else { CaptureCost::COMPUTED };
        estimated_seconds(cost, (mesh, levels), eyes as u64, (FACES * eyes) as u64, options.face_px)
    }

    /// Bytes of what it stores, about.
    pub fn bytes(self, mesh: &Mesh, options: &Options) -> u64 {
        let vertices = mesh.positions.len() as u64;
        match self {
            Kind::Shadow | Kind::Light => {
                let channels = if self == Kind::Light { 3 } else { 1 };
                let stride = 4 * channel_stride(options.most_bands()) as u64 * channels;
                u64::from(options.lattice.starting_at(1.0).sample_count()) * stride
            }
            Kind::Silhouette => {
                let map = 16 + 2 * u64::from(options.silhouette.map_px).pow(2);
                map * NodeGrid::map_count(options.silhouette.cells) as u64
            }
            Kind::Vertices => vertices * (BYTES + 4 * channel_stride(options.bands)) as u64,
        }
    }

    /// Its word, as plans have it.
    pub fn name(self) -> &'static str {
        match self {
            Kind::Shadow => "shadow",
            Kind::Light => "light",
            Kind::Silhouette => "silhouette",
            Kind::Vertices => "vertices",
        }
    }
}
