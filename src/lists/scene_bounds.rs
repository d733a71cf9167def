//! Bounds of clusters, entities and lights at one time, from which cluster lists are made.

use crate::asset::Mesh;
use crate::field::cuboid::Cuboid;
use crate::field::sheet::Sheet;
use crate::field::silhouette::SilhouetteField;
use crate::field::visibility_volume::SceneVolume;
use crate::lists::skip::Skip;
use crate::lists::tree::Tree;
use crate::scene::Placement;
use crate::scene::groups::Groups;
use glam::{DQuat, DVec3, Vec3, Vec4};
use std::f64::consts::PI;
use std::sync::Arc;

/// Angle by which cones are widened: their cosines are stored in f32, which near 1 tells angles apart by 0.00035 rad
/// only.
pub(super) const CONE_ROUNDING_RAD: f64 = 1e-3;

/// Where a cluster's vertices are and where they face, in its mesh's frame: metres from the bounding sphere's centre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClusterBounds {
    /// Centre of a sphere around the vertices.
    pub centre: Vec3,
    pub radius_m: f32,
    /// Unit axis of a cone around the normals.
    pub axis: Vec3,
    /// Cosine of its half-angle with `CONE_ROUNDING_RAD`; -1 where it bounds nothing.
    pub cosine: f32,
}

impl ClusterBounds {
    /// A sphere around the vertices and a cone around their normals, angle in radians, pi where it bounds nothing.
    pub fn from_parts(centre: DVec3, radius_m: f64, axis: DVec3, spread_rad: f64) -> Self {
        let rounded = centre.as_vec3();
        ClusterBounds {
            centre: rounded,
            // What rounding of the centre, here and where it is turned, may add.
            radius_m: ((radius_m + centre.distance(rounded.as_dvec3()) + 1e-6 * centre.length()) * (1.0 + 1e-6)) as f32,
            axis: axis.as_vec3(),
            cosine: (spread_rad + CONE_ROUNDING_RAD).min(PI).cos() as f32,
        }
    }

    pub fn new(positions: &[Vec3], normals: &[Vec3]) -> Self {
        let spheres = positions.iter().map(|p| (p.as_dvec3(), 0.0));
        let cones = normals.iter().map(|n| (n.as_dvec3(), 0.0));
        Self::around(spheres.collect(), cones.collect())
    }

    pub fn union(parts: &[ClusterBounds]) -> Self {
        let spheres = parts.iter().map(|b| (b.centre.as_dvec3(), f64::from(b.radius_m)));
        let cones = parts.iter().map(|b| (b.axis.as_dvec3(), f64::from(b.cosine).acos()));
        Self::around(spheres.collect(), cones.collect())
    }

    fn around(spheres: Vec<(DVec3, f64)>, cones: Vec<(DVec3, f64)>) -> Self {
        let (low, high) = spheres
            .iter()
            .fold((DVec3::MAX, DVec3::MIN), |(low, high), (centre, _)| (low.min(*centre), high.max(*centre)));
        let centre = (low + high) / 2.0;
        let radius_m = spheres.iter().map(|(c, radius)| c.distance(centre) + radius).fold(0.0, f64::max);
        let axis = cones.iter().map(|(axis, _)| *axis).sum::<DVec3>().normalize_or_zero();
        let widest = cones.iter().map(|(a, spread)| a.angle_between(axis) + spread).fold(0.0, f64::max);
        // No angle to a direction that is none.
        let unknown = axis == DVec3::ZERO || cones.iter().any(|(a, _)| *a == DVec3::ZERO);
        Self::from_parts(centre, radius_m, axis, if unknown { PI } else { widest.min(PI) })
    }
}

/// Before which lights an entity stands.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Occludes {
    #[default]
    Nothing,
    /// Before all but sharp ones: there its boxes stand in its place.
    Soft,
    /// Before sharp ones alone, as a box of an entity.
    Sharp,
    All,
}

impl Occludes {
    pub fn stands_before(self, sharp: bool) -> bool {
        self == Occludes::All || self == if sharp { Occludes::Sharp } else { Occludes::Soft }
    }
}

/// One entity, or one of the boxes of an entity, as the gather sees it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct EntityBounds {
    /// Centre of the bounding sphere in the world, metres.
    pub centre: DVec3,
    pub radius_m: f64,
    /// Share of light that it reflects at most, of any colour.
    pub reflectance: f64,
    pub occludes: Occludes,
    pub emits: bool,
    pub sharp: bool,
    /// Whether it shines through a radiance field of its own rather than through its occlusion field.
    pub coloured: bool,
    /// Largest radiance that it shines with, of any colour.
    pub radiance: f64,
    /// Axis (world) and half-angle of the cone that it shines into, if it is a spot.
    pub facing: Option<(DVec3, f64)>,
    /// The rectangle by which it casts shadows.
    pub sheet: Option<Sheet>,
    /// Bits of the maps of lamps that it stands in, or that it has.
    pub lamp_maps: u32,
}

/// What tells the outline of an occluder.
#[derive(Clone)]
pub enum OutlineShape {
    Maps(Arc<SilhouetteField>),
    Cuboid(Cuboid),
}

/// The outline of an occluder at one time.
#[derive(Clone)]
pub struct OutlineView {
    pub shape: OutlineShape,
    /// Rotation from the world to the object.
    pub to_object: DQuat,
    /// Whether no light passes within it.
    pub opaque: bool,
}

/// A closed surface that lets some light through and has a sharp light within, as a globe of glass around its lamp.
#[derive(Clone)]
pub struct Globe {
    pub occluder: u32,
    pub light: u32,
    pub mesh: Arc<Mesh>,
    pub placement: Placement,
}

/// What the lists are made from at one time.
pub struct SceneBounds {
    /// Those of the scene, and then the boxes of some of them.
    pub entities: Vec<EntityBounds>,
    /// Their bounding spheres: centre in the world and radius, metres.
    pub spheres: Vec<Vec4>,
    /// Outlines of those that have one, by entity; empty where no light is sharp.
    pub outlines: Vec<Option<OutlineView>>,
    pub globes: Vec<Globe>,
    pub tree: Tree,
    /// Those that shine, the sharp ones first, each in the order of entities.
    pub lights: Vec<u32>,
    /// Largest radiance of distant light, if there is any.
    pub sky: Option<f64>,
    /// Radiance of the brightest light, distant or not.
    pub brightest: f64,
    pub skip: Skip,
    /// Which entities never move against each other; `None` where each is alone.
    pub groups: Option<Groups>,
    /// What all that rests blocks where other things move.
    pub volume: Option<Arc<SceneVolume>>,
    /// Radiance below which a contribution is left off; 0 leaves nothing off.
    pub eps: f64,
}

impl SceneBounds {
    /// Whether the map of a lamp tells what an occluder hides of it.
    pub fn is_mapped(&self, occluder: u32, lamp: u32) -> bool {
        self.entities[occluder as usize].lamp_maps & self.entities[lamp as usize].lamp_maps != 0
    }

    /// Whether an occluder's outline is that of a box.
    pub fn is_cuboid(&self, entity: usize) -> bool {
        let outline = self.outlines.get(entity).and_then(Option::as_ref);
        outline.is_some_and(|outline| matches!(outline.shape, OutlineShape::Cuboid(_)))
    }

    /// Sorts `entities` for the lists.
    pub fn new(entities: Vec<EntityBounds>, sky: Option<f64>, skip: Skip, eps: f64) -> Self {
        let sphere = |entity: &EntityBounds| entity.centre.as_vec3().extend(entity.radius_m as f32);
        let spheres: Vec<Vec4> = entities.iter().map(sphere).collect();
        let occluders = (0..).zip(&entities).filter(|(_, entity)| entity.occludes != Occludes::Nothing);
        let mut lights: Vec<u32> = (0..).zip(&entities).filter(|(_, entity)| entity.emits).map(|(j, _)| j).collect();
        // The chains of sharp lights come first on every list.
        lights.sort_by_key(|&j| !entities[j as usize].sharp);
        let radiances = lights.iter().map(|&j| entities[j as usize].radiance);
        let brightest = radiances.fold(sky.unwrap_or(0.0), f64::max);
        let tree = Tree::new(occluders.map(|(j, _)| (j, spheres[j as usize])));
        SceneBounds {
            groups: None,
            volume: None,
            outlines: Vec::new(),
            globes: Vec::new(),
            tree,
            lights,
            sky,
            brightest,
            skip,
            eps,
            spheres,
            entities,
        }
    }

    /// Whether lists of the other time hold here too where no entity has changed.
    pub fn is_like(&self, other: &SceneBounds) -> bool {
        self.entities.len() == other.entities.len()
            && (self.sky, self.skip, self.eps) == (other.sky, other.skip, other.eps)
    }

    /// The key by which the occluders of a receiver are ordered, near to far from the centre of its bounding sphere:
    /// products truncated in another order differ (by up to 0.006 over twelve occluders), which would show as seams, so
    /// there is one order for a whole receiver. Equal distances go by index. Sheets come last, for loops of their own.
    /// The bits of a squared distance rise with it, as it is not negative. The f64 twins go by it too.
    pub fn order(&self, receiver: u32, occluder: u32) -> (bool, u32, u32) {
        let [from, to] = [receiver, occluder].map(|i| self.spheres[i as usize].truncate());
        let is_sheet = self.entities[occluder as usize].sheet.is_some();
        (is_sheet, to.distance_squared(from).to_bits(), occluder)
    }
}
