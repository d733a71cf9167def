//! Surfaces: the meshes of a rigid group as they are lit and drawn, with the own visibility of every vertex past the
//! whole group.

use super::cluster_order::{ClusterOrder, cluster_order};
use super::links::{Link, Met, Runs, blend_faint, links, side};
use super::own_visibility::{Counts, Eye, Front, PATTERN, Rays, Seen, Target, directions, see, share_of};
use super::packet::{BlockerHit, BlockerTriangle, Blockers, Mask};
use super::refine::{FLAT, Limits, ON_TRIANGLE, Refined, refine, sides, vertex_count};
use super::triangles::{distinct, weights};
use super::visibility_volume::VolumePlan;
use super::{BakeReport, Options, Progress, TRANSFER_OFFSET, Wanted, bakes_transfer};
use crate::asset::Mesh;
use crate::asset::disc::Disc;
use crate::asset::enclose::{around_boxes, around_spheres};
use crate::asset::generate::Generator;
use crate::asset::grid::Grid;
use crate::asset::mesh::Attributes;
use crate::asset::texture::Texture;
use crate::field::quantity::channel_stride;
use crate::field::self_visibility::{self, BYTES, frame};
use crate::field::sky_view::SkyViews;
use crate::layout::{CLUSTER_VERTICES, MOST_SUNS, pack_suns};
use crate::scene::groups::Groups;
use crate::scene::{Placement, Scene};
use glam::{DMat3, DVec3, Mat3A, Quat, Vec3, Vec3A};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::sync::{Arc, OnceLock};
use std::time::Instant;

/// Counts in every name of the cache: another number where a bake of surfaces computes something else.
const VERSION: u32 = 65;
/// How far towards the middle of its triangles a vertex is seen from, as a share of the way: the light of a crease is
/// that just inside each face. Where meshes are left as they are, so are the places from which they are seen.
const NUDGE: f32 = 0.02;
/// A member that is not convex casts its own sharp shadow on a cluster from this distance on, in its bounding radii;
/// nearer ones are part of the cluster's maps. Convex ones never are: a floor below large walls would take all of them
/// from maps, whose edges are coarse (built-in room, direct light: 0.041 RMS of radiance with them and 0.016 without).
/// Outlines hold within the bounding sphere too, but not where what hides a light is around its receiver: a bulb in its
/// shade errs 0.049 at 1.1 radii and 0.033 at 0.65, books on their shelf 0.0094, 0.0085 and at 0.5 radii 0.0120.
const FAR: f64 = 0.65;
/// So deep within the member's box, in its bounding radii, some vertex of the cluster must be, too. The sphere of a flat
/// or long member reaches far beyond the box, and a floor on which it stands touches that: sun patches on the floor
/// of a house with windows err 0.187 by maps and 0.025 by outlines, the shadow of a bowl on a table 0.062 and 0.024.
const WITHIN: f64 = 0.02;
/// What blocks more than this share of all directions from a member, as a cave does, is part of all of its maps: that is
/// around it, wherever its middle is. So many vertices look, each in so many directions.
const AROUND: f64 = 0.6;
const LOOKS: [usize; 2] = [16, 64];
/// Angular radius below which the shadows of a sun have edges that surfaces follow: 3 degrees.
const CRISP_RAD: f64 = 0.05;
/// Vertices that are closer than this share of a group's extent, and of their mesh's bounding radius, and whose normals lie
/// within 6 degrees share their rays: round edges have several times the vertices that light needs.
const ALIKE: f32 = 0.001;
const ALIKE_MESH: f32 = 0.01;
const ALIKE_COSINE: f32 = 0.9945;
/// Where rays to a sun leave its middle, in its angular radii, along two axes.
const SUN_RAYS: [[f64; 2]; 5] = [[0.0, 0.0], [0.8, 0.0], [0.0, 0.8], [-0.8, 0.0], [0.0, -0.8]];
/// Of the vertices to which surfaces may grow one in so many is added at least, however many there were: a floor below a
/// fine statue is lit at four of its own.
const LEAST_ADDED: usize = 2;
/// A lamp lights a member from close by that is so near its middle, in the member's bounding radii, is no larger than so
/// many of the lamp's, and than this share of the group's.
const LIT_CLOSE: f64 = 1.5;
const LIT_RADII: f64 = 8.0;
const LIT_SHARE: f64 = 0.125;
/// Share of the blocked cosine-weighted hemisphere that shows backs of triangles, from a place inside a solid or below a
/// sheet.
pub(super) const BURIED_BACKS: f64 = 0.5;
/// Share of it that is blocked there at least.
pub(super) const BURIED_BLOCKED: f64 = 0.35;
/// Share of it that is blocked by what is nearer than a share of the edges around, as behind a picture on a wall: it is
/// dark there, and nowhere else on the triangles. In a corner of three walls 0.75 is.
const BURIED_NEAR: f64 = 0.8;
const NEAR: f32 = 0.5;
/// Share that is blocked so at a place that is taken first in its stead.
const OPEN_NEAR: f64 = 0.1;
/// Vertices are of one side if their normals have such a cosine with the mean, and if they lie apart along it by no more
/// than such a share of their extent.
const LEAST_COMMON: f32 = 0.5;
const MOST_HEIGHT: f32 = 0.35;
/// Normals have such a cosine with that of their face where they are about the same: 18 degrees.
const LEAST_ALONG: f32 = 0.95;
/// Share of its height above a vertex that a point keeps above the triangles of a hollow on its way along the surface, and
/// the sine from which on a triangle rises.
const HOLLOW: f32 = 0.5;
const RISES: f32 = 1e-3;
/// Places on the way from a buried vertex to the middle of a triangle where one that is not may be.
const WAYS_OUT: [f32; 5] = [0.06, 0.15, 0.3, 0.5, 0.8];
/// The same on the way to the vertices beside it, where the middles of all its triangles are buried too.
const WAYS_ALONG: [f32; 2] = [0.5, 0.95];
/// Share of its view that lamps take of a vertex close under them.
const UNDER: f64 = 0.5;

/// A place of a surface, in its member's frame.
#[derive(Clone, Copy, Debug)]
pub struct Place {
    pub position: Vec3,
    pub normal: Vec3,
    /// From there to where rays leave.
    pub nudge: Vec3,
    /// Length of the shortest edge around; with 0 nothing is close.
    pub edge: f32,
}

#[derive(Clone)]
pub struct Member {
    pub mesh: Arc<Mesh>,
    pub placement: Placement,
    /// Whether it keeps light back, all of it, but for its holes. One that lets light through stands on lists.
    pub occludes: bool,
    /// Whether it lets light through, of its own too.
    pub transparent: bool,
    /// The texture that makes holes in it.
    pub mask: Option<Arc<Texture>>,
    /// Whether it blocks sharp lights as its boxes, which stand on lists: no map has its shadows.
    pub boxed: bool,
    /// Members that shine block the view of the sky alone: before sharp lights they stand on lists.
    pub emits: bool,
    /// Whether it is a lamp at rest: light that bounces stays behind it, and bounces from it if it receives that.
    pub ends_links: bool,
    pub receives: bool,
    /// Whether its surface may be refined: one at rest, as what moves is many instances of one mesh, and not one to which
    /// a user gave finer faces than its shape needs.
    pub refines: bool,
}

#[derive(Clone, Default)]
pub struct GroupPlan {
    /// The members' entities, of one group of several; every entity with this mesh of a group of one.
    pub entities: Vec<usize>,
    members: Vec<Member>,
    wanted: Wanted,
    /// Whether transfer vectors will be fitted to the sky.
    views_sky: bool,
    bands: usize,
    /// Vertices to which all surfaces of the scene may grow, and whether anything moves in it.
    refinement: Option<(u32, bool)>,
    /// Suns whose shadows have edges, of a group at rest. Surfaces are finer there, for what light bounces off them, and
    /// tell which are hidden, but serve other suns as well.
    suns: Vec<CrispSun>,
    /// Name in the cache; `None` where nothing has to be baked.
    pub key: Option<String>,
    /// The same for all suns.
    name: String,
    /// Where boxes move among the members, world, metres: least and largest corners; `None` for anywhere.
    screens: Vec<Option<[DVec3; 2]>>,
    /// What it blocks where other things move.
    pub volume: Option<VolumePlan>,
}

/// A sun whose shadows have edges.
#[derive(Clone, Copy, Debug)]
pub struct CrispSun {
    /// Unit direction, world.
    pub toward: DVec3,
    pub half_angle_rad: f64,
}

/// The suns of which surfaces tell whether they are hidden, in the order of their bits, and the place of each among all
/// discs of the environment.
pub fn crisp_suns(scene: &Scene) -> impl Iterator<Item = (usize, CrispSun)> {
    let crisp = |(place, disc): (usize, Disc)| {
        let Disc { toward, half_angle_rad, .. } = disc;
        (half_angle_rad < CRISP_RAD).then_some((place, CrispSun { toward, half_angle_rad }))
    };
    scene.environment.discs().into_iter().enumerate().filter_map(crisp).take(MOST_SUNS)
}

/// A surface with its own visibility.
#[derive(Clone)]
pub struct BakedSurface {
    pub mesh: Arc<Mesh>,
    /// Transfer vectors in the mesh's order of vertices, or `None` where the cosine lobe of the normal is exact.
    pub transfer: Option<Arc<Vec<f32>>>,
    /// What every vertex sees of the sky, in the order of clusters; `None` where transfer vectors stay as they are.
    pub sky: Option<Arc<SkyViews>>,
    /// Self-visibility of every vertex, [`BYTES`] each, or `None` where no sharp light is blocked.
    pub self_visibility: Option<Arc<Vec<u8>>>,
    /// For each cluster the members whose shadows of sharp lights its maps have.
    pub near: Vec<Vec<u32>>,
    /// What every vertex sees of its group's fronts, in the order of clusters; `None` where none sees any.
    pub links: Option<Arc<Links>>,
    /// In the mesh's order of vertices [`pack_suns`]; `None` where they tell nothing.
    pub told_suns: Option<Arc<Vec<u32>>>,
    /// In the mesh's order of vertices 1 where lamps take most of the view, and else 0; `None` where they do so nowhere.
    under_lamps: Option<Arc<Vec<u8>>>,
}

#[derive(Clone, Debug, Default, PartialEq)]
pub struct Links {
    /// How many each vertex has.
    pub counts: Vec<u8>,
    /// Those of one vertex after those of another: the number of a run of the group, and its share.
    pub packed: Vec<u32>,
    /// Mean directions of their rays, world, where boxes move among the group; else empty.
    pub directions: Vec<u32>,
}

impl BakedSurface {
    /// The order of its vertices in clusters.
    pub(crate) fn order(&self) -> ClusterOrder {
        cluster_order(&self.mesh, self.under_lamps.as_ref().map(|under| &under[..]))
    }

    /// A mesh as it is, which sees nothing of itself.
    pub fn plain(mesh: &Arc<Mesh>) -> Self {
        BakedSurface {
            mesh: mesh.clone(),
            transfer: None,
            sky: None,
            self_visibility: None,
            near: Vec::new(),
            links: None,
            told_suns: None,
            under_lamps: None,
        }
    }
}

/// The groups of a scene as they are baked.
#[derive(Clone)]
pub struct SurfacePlan {
    pub groups: Vec<GroupPlan>,
}

impl SurfacePlan {
    pub fn new(scene: &Scene, groups: &Groups, options: &Options, wanted: Wanted) -> Self {
        let moves = (0..scene.data.entities.len()).any(|entity| !scene.is_at_rest(entity));
        let refinement = (options.vertices > 0).then_some((options.vertices, moves));
        let member = |entity: usize, placement: Placement| {
            let of = &scene.entities[entity];
            let mesh = scene.meshes[of.mesh].clone();
            let generator = scene.data.meshes.get(of.mesh).and_then(|data| data.generator.as_ref());
            let generated = generator.is_some_and(Generator::is_tessellated);
            let refines = refinement.is_some() && of.receives && scene.is_at_rest(entity) && !generated;
            let transparent = of.transparent;
            let occludes = of.occludes && !transparent;
            Member {
                mesh,
                placement,
                occludes,
                transparent,
                mask: scene.mask(entity).cloned(),
                boxed: scene.casts_as_boxes(entity),
                emits: of.emits,
                ends_links: scene.is_lamp_at_rest(entity),
                receives: of.receives,
                refines,
            }
        };
        let screens: Vec<_> = scene.screens().into_iter().map(|entity| scene.reach(entity)).collect();
        let suns: Vec<CrispSun> = crisp_suns(scene).map(|(_, sun)| sun).collect();
        let mut plans: Vec<GroupPlan> = Vec::new();
        // The plans of entities alone: those with equal meshes share what is baked.
        let mut alone: HashMap<([u8; 32], [bool; 4], Option<*const Texture>), usize> = HashMap::new();
        for entities in groups.members() {
            let members: Vec<Member> = if let [only] = entities[..] {
                // What an entity blocks of its own view does not depend on its place.
                let member = Member { emits: false, ends_links: false, ..member(only, AT_ORIGIN) };
                let member = Member { occludes: !member.transparent, ..member };
                let kind = [member.receives, member.refines, member.transparent, member.boxed];
                let plan = alone.entry((member.mesh.content_hash(), kind, member.mask.as_ref().map(Arc::as_ptr)));
                if let Entry::Occupied(known) = &plan {
                    plans[*known.get()].entities.push(only);
                    continue;
                }
                plan.or_insert(plans.len());
                vec![member]
            } else {
                entities.iter().map(|&entity| member(entity, scene.data.entities[entity].fixed())).collect()
            };
            let is_resting_group = members.len() > 1 && scene.is_at_rest(entities[0]);
            let screens = if is_resting_group { screens.clone() } else { Vec::new() };
            // Vertices of meshes that are left as they are may lie in the very seam of two walls.
            let suns = if is_resting_group && refinement.is_some() { suns.clone() } else { Vec::new() };
            plans.push(GroupPlan {
                entities,
                members,
                wanted,
                bands: options.bands,
                refinement,
                suns,
                screens,
                ..GroupPlan::default()
            });
        }
        let named = |plan: GroupPlan| {
            // Several entities with one mesh share what is baked, but not which way they stand.
            let has_one_sky = plan.members.len() > 1 || plan.entities.len() == 1;
            let views_sky = wanted.transfer && has_one_sky && scene.is_at_rest(plan.entities[0]);
            let plan = GroupPlan { views_sky, ..plan }.named();
            // Of the sky, and of surfaces that light bounces from.
            let has_use = wanted.transfer || options.groups;
            let moved = has_use.then(|| plan.moved_among(scene)).flatten();
            let volume =
                moved.and_then(|(wanted, radius_m)| VolumePlan::new(&plan.name, wanted, radius_m, options.bands));
            GroupPlan { volume, ..plan }
        };
        SurfacePlan { groups: plans.into_iter().map(named).collect() }
    }

    /// Names of all that is baked, whatever the suns: another scene with these names can do with the same surfaces.
    pub fn keys(&self) -> Vec<(&[usize], [Option<&str>; 2])> {
        let with_keys = self.groups.iter().map(|group| {
            let volume = group.volume.as_ref().map(|volume| &volume.key[..]);
            (&group.entities[..], [group.key.as_ref().map(|_| &group.name[..]), volume])
        });
        with_keys.collect()
    }
}

const AT_ORIGIN: Placement = Placement { position: Vec3::ZERO, rotation: Quat::IDENTITY, scale: 1.0 };

impl GroupPlan {
    /// A mesh that nothing surrounds.
    pub fn alone(mesh: &Arc<Mesh>, options: &Options, wanted: Wanted) -> Self {
        let members = vec![Member {
            mesh: mesh.clone(),
            placement: AT_ORIGIN,
            occludes: true,
            transparent: false,
            mask: None,
            boxed: false,
            emits: false,
            ends_links: false,
            receives: true,
            refines: false,
        }];
        GroupPlan { members, wanted, bands: options.bands, ..GroupPlan::default() }.named()
    }

    fn named(mut self) -> Self {
        let name = self.name();
        self.key = self.needs_bake().then(|| match self.suns.is_empty() {
            true => name.clone(),
            false => blake3::hash(format!("{name} {:?}", self.suns).as_bytes()).to_hex()[..32].to_owned(),
        });
        self.name = name;
        self
    }

    fn needs_bake(&self) -> bool {
        let lit = self.wanted.transfer || self.wanted.self_visibility;
        match &self.members[..] {
            [only] => lit && only.receives && (bakes_transfer(&only.mesh) || only.refines),
            members => lit && members.iter().any(|member| member.receives),
        }
    }

    /// A hash of everything that decides the surfaces but suns.
    fn name(&self) -> String {
        let mut hasher = blake3::Hasher::new();
        let numbers = format!(
            "{VERSION} {} {:?} {:?} {PATTERN} {TRANSFER_OFFSET} {:?}",
            self.bands,
            (self.wanted, self.views_sky),
            self.refinement,
            [self_visibility::RIM, self_visibility::LIMIT_RAD, self_visibility::DISTANCE_STEPS]
        );
        hasher.update(numbers.as_bytes());
        hasher.update(format!("{:?}", self.screens).as_bytes());
        for member in &self.members {
            hasher.update(&member.mesh.content_hash());
            hasher.update(
                format!("{:?}", (member.placement, member.occludes, member.emits, member.receives, member.refines))
                    .as_bytes(),
            );
            hasher.update(&[member.transparent, member.boxed, member.ends_links].map(u8::from));
            if let Some((mask, texels)) = member.mask.as_ref().and_then(|mask| Some((mask, mask.texels.as_ref()?))) {
                hasher.update(format!("{:?}", (mask.wrap, mask.alpha_cutoff, texels.width)).as_bytes());
                hasher.update(texels.rgba.as_flattened());
            }
        }
        hasher.finalize().to_hex()[..32].to_owned()
    }

    /// The box in which lit things move that see several of the members, and the bounding radius of the largest, metres;
    /// `None` where there are none.
    fn moved_among(&self, scene: &Scene) -> Option<([DVec3; 2], f64)> {
        let blocks = self.occluders();
        let rests = self.entities.first().is_some_and(|first| scene.is_at_rest(*first));
        if !rests || self.members.len() == 1 || blocks.iter().filter(|blocks| **blocks).count() < 2 {
            return None;
        }
        // What may be put anywhere is looked for where more than a ground stands.
        let is_flat = |member: &&Member| member.mesh.is_flat();
        let all_flat = self.members.iter().all(|member| is_flat(&member));
        let points = |member: &Member| {
            let place = |p: &Vec3| member.placement.point(p.as_dvec3());
            around_boxes(member.mesh.positions.iter().map(place).map(|place| [place; 2]))
        };
        let solid = || self.members.iter().filter(|member| all_flat || !is_flat(member));
        let whole = || around_boxes(solid().filter_map(points));
        let moves = |entity: &usize| scene.entities[*entity].receives && !scene.is_at_rest(*entity);
        let moving: Vec<usize> = (0..scene.data.entities.len()).filter(moves).collect();
        let radius_m = |entity: &usize| {
            let mesh = &scene.meshes[scene.entities[*entity].mesh];
            f64::from(mesh.bounding_sphere().1) * f64::from(scene.data.entities[*entity].scale)
        };
        let largest_m = moving.iter().map(radius_m).fold(0.0, f64::max);
        let wanted = around_boxes(moving.into_iter().filter_map(|entity| scene.reach(entity).or_else(whole)))?;
        Some((wanted, largest_m))
    }

    /// For each member whether it keeps light back, all of it.
    pub(super) fn occluders(&self) -> Vec<bool> {
        self.members.iter().map(|member| member.occludes).collect()
    }

    /// What people read.
    pub fn title(&self) -> String {
        match &self.members[..] {
            [only] => format!("{} view", only.mesh.name),
            members => format!("view of {} things", members.len()),
        }
    }

    /// Vertices before they are refined.
    pub fn vertex_count(&self) -> usize {
        self.members.iter().map(|member| member.mesh.positions.len()).sum()
    }

    /// The surfaces of the members as they are, with nothing baked.
    pub fn plain(&self) -> Vec<BakedSurface> {
        self.members.iter().map(|member| BakedSurface::plain(&member.mesh)).collect()
    }

    /// Refines the members and casts their rays. A surface for each member.
    pub fn bake(&self, progress: Progress<'_>) -> (Vec<BakedSurface>, BakeReport) {
        let started = Instant::now();
        let group = Group::new(self);
        let receivers: Vec<usize> = (0..self.members.len()).filter(|&i| self.members[i].receives).collect();
        let refining = receivers.iter().copied().filter(|&i| self.members[i].refines);
        let mut refined: Vec<Refined<'_>> =
            refining.clone().map(|i| Refined::new(&self.members[i].mesh, group.space(i))).collect();
        if let Some(limits) = self.limits(&group, vertex_count(&refined)).filter(|_| !refined.is_empty()) {
            let most = limits.vertices.max(1) as u32;
            let suns: Vec<DVec3> = self.suns.iter().map(|sun| sun.toward).collect();
            refine(&mut refined, &suns, &limits, &|count| progress((count as u32).min(most) / 2, most));
        }
        let mut surfaces = self.plain();
        let mut parents: Vec<Option<Vec<u32>>> = vec![None; surfaces.len()];
        for (member, mut refined) in refining.zip(refined) {
            let own = &self.members[member].mesh;
            if refined.positions.len() != own.positions.len() {
                parents[member] = Some(std::mem::take(&mut refined.parents));
                surfaces[member].mesh = Arc::new(refined.into_mesh(own));
            }
        }
        let spaces: Vec<GroupSpace<'_>> = (0..self.members.len()).map(|member| group.space(member)).collect();
        let of_surface = |(space, BakedSurface { mesh, .. }): (&GroupSpace<'_>, &BakedSurface)| {
            space.nudges(&mesh.positions, &mesh.normals, &mesh.triangles)
        };
        let nudges: Vec<Vec<Vec3>> = spaces.par_iter().zip(&surfaces).map(of_surface).collect();
        let under_lamps = |member: usize| spaces[member].under_lamps(&surfaces[member].mesh, &nudges[member]);
        let under_lamps: Vec<Option<Vec<u8>>> = (0..self.members.len()).into_par_iter().map(under_lamps).collect();
        for (surface, under) in surfaces.iter_mut().zip(under_lamps) {
            surface.under_lamps = under.map(Arc::new);
        }
        let is_mixed_run = |member: usize, vertices: &[u32]| {
            let BakedSurface { mesh, under_lamps, .. } = &surfaces[member];
            let is_under = |v: &u32| under_lamps.as_ref().is_some_and(|under| under[*v as usize] > 0);
            vertices.iter().any(|v| is_under(v) != is_under(&vertices[0]))
                || is_mixed(mesh, vertices)
                || spaces[member].divides(mesh, &nudges[member], vertices)
        };
        let lit = |member: usize| {
            let is_mixed = |run: &[u32]| is_mixed_run(member, run);
            Lit::new(&self.members[member].mesh, &surfaces[member], parents[member].as_deref(), &is_mixed)
        };
        let lit: Vec<Lit> = (0..self.members.len()).into_par_iter().map(lit).collect();
        let mut runs = Runs::new(lit.iter().map(|lit| &lit.order.runs[..]));
        let is_mixed = |(member, first, count): (usize, usize, usize)| {
            is_mixed_run(member, &lit[member].order.vertices[first..first + count])
        };
        let all: Vec<(usize, usize, usize)> = runs.all().collect();
        let is_at_lamp = |&(member, first, count): &(usize, usize, usize)| {
            let vertices = &lit[member].order.vertices[first..first + count];
            let of = &self.members[member];
            let under = surfaces[member].under_lamps.as_ref();
            of.ends_links || under.is_some_and(|under| vertices.iter().any(|v| under[*v as usize] > 0))
        };
        if surfaces.iter().any(|surface| surface.under_lamps.is_some()) {
            runs.at_lamps = all.iter().map(is_at_lamp).collect();
        }
        runs.mixed = all.into_par_iter().map(is_mixed).collect();
        let total: usize = receivers.iter().map(|&member| surfaces[member].mesh.positions.len()).sum();
        let mut done = 0;
        for &member in &receivers {
            let plain = surfaces[member].clone();
            let tell = |vertices: usize| progress((total + done + vertices) as u32 / 2, total.max(1) as u32);
            surfaces[member] = spaces[member].surface(plain, &nudges[member], (&lit, &runs), &tell);
            done += surfaces[member].mesh.positions.len();
        }
        let report = BakeReport { samples: total as u32, total: started.elapsed(), ..Default::default() };
        (surfaces, report)
    }

    /// `start`: vertices of what is refined, as it came.
    fn limits(&self, group: &Group<'_>, start: usize) -> Option<Limits> {
        let (vertices, moves) = self.refinement?;
        let extent = group.extent;
        let area = |((_, radius), Member { mesh, .. }): (&(DVec3, f64), &Member)| {
            mesh.area_m2() * (radius / f64::from(mesh.bounding_sphere().1)).powi(2)
        };
        let flat = group.spheres.iter().zip(&self.members).filter(|(_, of)| of.mesh.is_flat() && of.receives);
        let flat_area: f64 = flat.map(area).sum();
        let flat_edge = (0.02 * extent).max((4.0 * flat_area / f64::from(vertices)).sqrt() as f32);
        Some(Limits {
            vertices: (vertices as usize).max(start + vertices as usize / LEAST_ADDED),
            flat_edge: if moves { flat_edge } else { 0.1 * extent.max(1.0) },
            edge: 0.1 * extent,
            least_edge: 0.004 * extent,
            sun_edge: 0.01 * extent,
        })
    }
}

/// The triangles of a group in a frame in which its bounding sphere is the unit sphere.
pub(super) struct Group<'p> {
    plan: &'p GroupPlan,
    pub blockers: Blockers,
    centre: DVec3,
    radius_m: f64,
    spheres: Vec<(DVec3, f64)>,
    /// Of each member in its own frame, metres.
    boxes: Vec<[DVec3; 2]>,
    /// Its width: what stands on a ground decides what is fine, not the ground.
    extent: f32,
    /// Where lamps light things from close by.
    targets: Vec<Target>,
    /// The plan's screens in this frame.
    screens: Vec<[DVec3; 2]>,
}

impl<'p> Group<'p> {
    pub fn new(plan: &'p GroupPlan) -> Self {
        let world: Vec<(DVec3, f64)> =
            plan.members.iter().map(|member| member.placement.sphere(member.mesh.bounding_sphere())).collect();
        let (centre, radius_m) = around_spheres(&world).unwrap_or((DVec3::ZERO, 1.0));
        let spheres: Vec<(DVec3, f64)> =
            world.iter().map(|(c, radius)| ((*c - centre) / radius_m, radius / radius_m)).collect();
        let to_group =
            |member: &Member, p: Vec3| ((member.placement.point(p.as_dvec3()) - centre) / radius_m).as_vec3();
        let triangles = (0..).zip(&plan.members).flat_map(|(index, member)| {
            let mesh = &member.mesh;
            let positions: Vec<Vec3> = mesh.positions.iter().map(|&p| to_group(member, p)).collect();
            // Those that are distinct stand in the mesh's order.
            let mut all = (0..).zip(&mesh.triangles);
            let triangle = |vertices: &[u32; 3]| {
                let number = all.find(|(_, of)| *of == vertices).map_or(0, |(number, _)| number);
                BlockerTriangle { member: index, number, corners: vertices.map(|v| positions[v as usize]) }
            };
            // Backs lie where their fronts do.
            let sides = if mesh.is_two_sided() { 2 } else { 1 };
            distinct(mesh).iter().take(mesh.triangles.len() / sides).map(triangle).collect::<Vec<_>>()
        });
        let mask = |member: &Member| Mask::new(&member.mesh, member.mask.as_ref()?);
        let backs = |member: &Member| member.mesh.is_two_sided().then(|| member.mesh.triangles.len() as u32 / 2);
        let masks = plan.members.iter().map(mask).collect();
        let blockers = Blockers::new(triangles, masks, plan.members.iter().map(backs).collect());
        let boxes = plan.members.iter().map(|member| member.mesh.extent().map(|corner| corner.as_dvec3())).collect();
        let targets = targets(&plan.members, &spheres);
        let screens =
            plan.screens.iter().flatten().map(|corners| corners.map(|corner| (corner - centre) / radius_m)).collect();
        let solid: Vec<(DVec3, f64)> =
            spheres.iter().zip(&plan.members).filter(|(_, m)| !m.mesh.is_flat()).map(|(s, _)| *s).collect();
        let extent = around_spheres(&solid).map_or(2.0, |(_, radius)| 2.0 * radius) as f32;
        Group { plan, blockers, centre, radius_m, spheres, boxes, extent, targets, screens }
    }

    /// A place of the world in the group's frame.
    pub fn place(&self, world: DVec3) -> Vec3A {
        ((world - self.centre) / self.radius_m).as_vec3a()
    }

    /// A length of the group's frame.
    pub fn metres(&self, length: f32) -> f32 {
        length * self.radius_m as f32
    }

    fn space(&self, member: usize) -> GroupSpace<'_> {
        let blocks: Vec<bool> =
            (0..).zip(&self.plan.members).map(|(i, of)| (i == member && !of.transparent) || of.occludes).collect();
        let others = (0..).zip(&blocks).map(|(i, blocks)| i != member && *blocks).collect();
        let reflects = self.plan.members.iter().zip(&blocks).map(|(of, blocks)| *blocks || of.ends_links).collect();
        GroupSpace { group: self, member, blocks, others, reflects }
    }
}

/// Spheres around the members that a lamp of the group lights from close by. `spheres` are those of all
/// members.
fn targets(members: &[Member], spheres: &[(DVec3, f64)]) -> Vec<Target> {
    let lamps = || members.iter().zip(spheres).filter(|(member, _)| member.emits).map(|(_, sphere)| sphere);
    let lit = |(centre, radius): &(DVec3, f64)| {
        let is_close = |(lamp, size): &&(DVec3, f64)| {
            lamp.distance(*centre) < LIT_CLOSE * radius && *radius < LIT_RADII * size && *radius < LIT_SHARE
        };
        let fills = |(lamp, size): &(DVec3, f64)| (size / lamp.distance(*centre).max(*size)).powi(2);
        lamps().filter(is_close).map(fills).reduce(f64::max)
    };
    let target = |(member, sphere): (&Member, &(DVec3, f64))| {
        let lit = lit(sphere).filter(|_| member.receives && !member.emits)?;
        Some(Target { centre: sphere.0.as_vec3a(), radius: 1.01 * sphere.1 as f32, lit: lit as f32 })
    };
    members.iter().zip(spheres).filter_map(target).collect()
}

/// A member among its group: sees points of its own frame.
pub(super) struct GroupSpace<'g> {
    group: &'g Group<'g>,
    member: usize,
    /// For each member whether it blocks what this one sees.
    blocks: Vec<bool>,
    /// The same without this one.
    others: Vec<bool>,
    /// For each member whether it blocks or is a lamp.
    reflects: Vec<bool>,
}

/// Where a lamp is: a point for a ball or a cube, a line for a tube, a rectangle for a panel.
pub(super) struct LampBody {
    centre: Vec3,
    from_group: Quat,
    /// Half its extent along its own axes, less half its thickness.
    half: Vec3,
    /// Half of the second largest extent.
    pub width: f32,
}

impl LampBody {
    /// The least distance of a line, from one point to another.
    pub fn distance(&self, from: Vec3, to: Vec3) -> f32 {
        let [from, to] = [from, to].map(|point| self.from_group * (point - self.centre));
        let along = to - from;
        let on_line = |beside: Vec3| {
            let share = (beside - from).dot(along) / along.length_squared().max(f32::MIN_POSITIVE);
            from + share.clamp(0.0, 1.0) * along
        };
        // Alternating projections: each set holds the point that is nearest to the last one of the other.
        let mut nearest = Vec3::ZERO;
        for _ in 0..4 {
            nearest = on_line(nearest).clamp(-self.half, self.half);
        }
        on_line(nearest).distance(nearest)
    }
}

impl GroupSpace<'_> {
    fn own(&self) -> &Member {
        &self.group.plan.members[self.member]
    }

    /// Lengths in the group's frame over lengths in the member's.
    pub fn scale(&self) -> f32 {
        (f64::from(self.own().placement.scale) / self.group.radius_m) as f32
    }

    /// From each vertex towards the middle of its triangles, along the surface; and off the surface by
    /// [`TRANSFER_OFFSET`], as rays of references leave it, or half as far as what stands before it there, as a roof that
    /// ends on a wall, where the vertex is one of several for the sides of what divides its plane. A flat mesh does not
    /// shade itself, and may be a ground that others touch.
    pub fn nudges(&self, positions: &[Vec3], normals: &[Vec3], triangles: &[[u32; 3]]) -> Vec<Vec3> {
        let mut sums = vec![(Vec3::ZERO, 0.0_f32); positions.len()];
        for triangle in triangles {
            let corners = triangle.map(|v| positions[v as usize]);
            let middle = (corners[0] + corners[1] + corners[2]) / 3.0;
            for k in 0..3 {
                let (sum, count) = &mut sums[triangle[k] as usize];
                *sum += middle - corners[k];
                *count += 1.0;
            }
        }
        let (_, radius_m) = self.own().mesh.bounding_sphere();
        let least = 1e-5 / self.scale();
        let inward_share = if self.group.plan.refinement.is_some() { NUDGE } else { 0.0 };
        let off = if self.own().mesh.is_flat() { least } else { least.max(TRANSFER_OFFSET * radius_m) };
        let mut alike = HashMap::new();
        let bits = |position: &Vec3, normal: &Vec3| [*position, *normal].map(|of| of.to_array().map(f32::to_bits));
        for (position, normal) in positions.iter().zip(normals) {
            *alike.entry(bits(position, normal)).or_insert(0) += 1;
        }
        let inward = |((sum, count), normal): (&(Vec3, f32), &Vec3)| {
            let inward = sum / count.max(1.0);
            inward_share * (inward - inward.dot(*normal) * *normal)
        };
        let mut alongs: Vec<Vec3> = sums.iter().zip(normals).map(inward).collect();
        // In a hollow, where a triangle rises above the tangent plane, no farther than to be before that triangle.
        let mut shares: Vec<Option<f32>> = vec![None; positions.len()];
        for triangle in triangles {
            let [a, b, c] = triangle.map(|v| positions[v as usize]);
            let side = (b - a).cross(c - a).normalize_or_zero();
            for v in triangle.map(|v| v as usize) {
                let [below, above] = [-side.dot(alongs[v]), off * side.dot(normals[v])];
                if below > RISES * alongs[v].length() && above > 0.0 {
                    shares[v] = Some(shares[v].unwrap_or(1.0).min(HOLLOW * above / below));
                }
            }
        }
        alongs.iter_mut().zip(&shares).for_each(|(along, share)| *along *= share.unwrap_or(1.0));
        let nudge = |(((along, hollow), normal), position): (((Vec3, Option<f32>), &Vec3), &Vec3)| {
            let foot = *position + along + least * *normal;
            let reach = (off - least) * *normal;
            let is_parted = off > least && hollow.is_none() && alike[&bits(position, normal)] > 1;
            let stands = is_parted.then(|| self.first_between(&self.blocks, foot, foot + reach)).flatten();
            let share = |hit: BlockerHit| 0.5 * hit.distance / self.placed(foot).distance(self.placed(foot + reach));
            along + least * *normal + stands.map_or(1.0, share) * reach
        };
        alongs.into_par_iter().zip(shares).zip(normals).zip(positions).map(nudge).collect()
    }

    /// What is seen of a place.
    pub fn see(&self, place: Place, rays: Rays) -> Seen {
        self.see_with(place, rays, None)
    }

    fn see_with(&self, Place { position, normal, nudge, edge }: Place, rays: Rays, in_map: Option<&[u32]>) -> Seen {
        let group = self.group;
        let eye = Eye {
            origin: self.placed(position + nudge).into(),
            normal,
            near: NEAR * edge * self.scale(),
            rotation: DMat3::from_quat(self.own().placement.turn()),
            radius: group.spheres[self.member].1,
        };
        let counts = Counts {
            blocks: &self.blocks,
            reflects: &self.reflects,
            in_map,
            sky: group.plan.views_sky,
            targets: &group.targets,
            screens: &group.screens,
        };
        let mut seen = see(&group.blockers, &eye, group.plan.bands, rays, counts);
        seen.from = position + nudge;
        let is_covered = self.is_covered(position, normal, nudge);
        if is_covered {
            seen.cover();
        }
        let sees_backs = seen.blocked > BURIED_BLOCKED && seen.behind > BURIED_BACKS * seen.blocked;
        let is_close_behind = seen.near > BURIED_NEAR;
        seen.buried = group.plan.refinement.is_some() && (is_covered || sees_backs || is_close_behind);
        seen
    }

    pub fn transfer(&self, seen: &Seen, normal: Vec3) -> Vec<f32> {
        seen.transfer(self.group.plan.bands, normal)
    }

    /// For each vertex of a cluster the place in it of the first one that stands and faces almost as it does, with nothing
    /// between them: its rays serve both.
    fn seers(&self, mesh: &Mesh, nudges: &[Vec3], cluster: &[u32]) -> Vec<usize> {
        let place = |v: usize| mesh.positions[v] + nudges[v];
        let near = (ALIKE * self.group.extent / self.scale()).min(ALIKE_MESH * mesh.bounding_sphere().1);
        let mut seers: Vec<usize> = Vec::with_capacity(cluster.len());
        for (at, v) in cluster.iter().map(|v| *v as usize).enumerate() {
            let frame_here = frame(mesh.normals[v].as_dvec3());
            let serves = |&other: &usize| {
                let o = cluster[other] as usize;
                let is_near = seers[other] == other && place(o).distance_squared(place(v)) < near * near;
                is_near && mesh.normals[o].dot(mesh.normals[v]) > ALIKE_COSINE && {
                    // A frame of axes jumps somewhere.
                    let turns = frame(mesh.normals[o].as_dvec3()).x_axis.dot(frame_here.x_axis);
                    turns > f64::from(ALIKE_COSINE) && (place(o) == place(v) || !self.is_between(place(o), place(v)))
                }
            };
            let seer = (0..at).find(serves).unwrap_or(at);
            seers.push(seer);
        }
        seers
    }

    /// Whether anything stands between two points of the member's frame.
    pub fn is_between(&self, from: Vec3, to: Vec3) -> bool {
        self.first_between(&self.blocks, from, to).is_some()
    }

    /// Whether anything stands between vertices of the mesh, as a floor below the wall of two rooms, or a slab on its
    /// outside: what lights some of them does not light the others. The mesh itself counts where they lie in one plane.
    fn divides(&self, mesh: &Mesh, nudges: &[Vec3], vertices: &[u32]) -> bool {
        let place = |v: &u32| mesh.positions[*v as usize] + nudges[*v as usize];
        let Some((first, others)) = vertices.split_first() else { return false };
        let normal = |v: &u32| mesh.normals[*v as usize];
        let is_plane = others.iter().all(|v| normal(v).dot(normal(first)) > FLAT);
        let counts = if is_plane { &self.blocks } else { &self.others };
        others.iter().any(|v| self.first_between(counts, place(first), place(v)).is_some())
    }

    /// The group's other members that shine, in its frame.
    pub fn lamps(&self) -> Vec<LampBody> {
        let group = self.group;
        let members = group.plan.members.iter().zip(&group.boxes).enumerate();
        let lamps = members.filter(|(index, (member, _))| *index != self.member && member.emits);
        let body = |(_, (Member { placement, .. }, [low, high])): (usize, (&Member, &[DVec3; 2]))| {
            let scale = f64::from(placement.scale) / group.radius_m;
            let mut half = (0.5 * scale * (*high - *low)).as_vec3();
            let mut sizes = half.to_array();
            sizes.sort_by(f32::total_cmp);
            half -= sizes[0];
            let centre = group.place(placement.point(0.5 * (*low + *high))).into();
            LampBody { centre, from_group: placement.turn().inverse().as_quat(), half, width: sizes[1] }
        };
        lamps.map(body).collect()
    }

    /// A point of the member's frame in the group's.
    pub fn placed(&self, point: Vec3) -> Vec3A {
        self.group.place(self.own().placement.point(point.as_dvec3()))
    }

    /// A bit for each of the group's suns of which a point sees nothing, as it faces away or things stand between, and for
    /// each of which it sees all. Outlines of what surrounds a point, as those of a house, tell this badly near its walls.
    fn seen_suns(&self, point: Vec3, normal: Vec3) -> [u32; 2] {
        let origin = self.placed(point);
        let sees = |sun: &CrispSun| {
            if normal.dot(self.local(sun.toward)) <= 0.0 {
                return [true, false];
            }
            let (x, y) = sun.toward.any_orthonormal_pair();
            let ray = |[a, b]: [f64; 2]| (sun.toward + sun.half_angle_rad * (a * x + b * y)).normalize().as_vec3a();
            let hits = self.group.blockers.first(origin, &Mat3A::IDENTITY, &SUN_RAYS.map(ray), &self.blocks);
            [hits.iter().all(Option::is_some), hits.iter().all(Option::is_none)]
        };
        let mut bits = [0; 2];
        for (number, sun) in self.group.plan.suns.iter().enumerate() {
            let seen = sees(sun);
            (0..2).for_each(|k| bits[k] |= u32::from(seen[k]) << number);
        }
        bits
    }

    /// What every vertex tells of the group's suns, from those that it sees nothing of, and all; `None` where that is
    /// nothing. Those that are hidden all around are so from places all over the triangles.
    fn told_suns(&self, mesh: &Mesh, nudges: &[Vec3], seen: &[[u32; 2]]) -> Option<Vec<u32>> {
        if seen.iter().all(|bits| *bits == [0; 2]) {
            return None;
        }
        let on = |triangle: &[u32; 3]| {
            let hidden_at = |weights: [f32; 3]| {
                let blend = |of: &dyn Fn(usize) -> Vec3| {
                    triangle.iter().zip(weights).map(|(&v, weight)| weight * of(v as usize)).sum::<Vec3>()
                };
                let off = blend(&|v| nudges[v].dot(mesh.normals[v]) * mesh.normals[v]);
                self.seen_suns(blend(&|v| mesh.positions[v]) + off, blend(&|v| mesh.normals[v]))[0]
            };
            let hidden = triangle.iter().fold(0, |all, &v| all | seen[v as usize][0]);
            // Nothing is left to tell of most.
            ON_TRIANGLE.iter().fold(hidden, |all, at| if all == 0 { 0 } else { all & hidden_at(*at) })
        };
        let on_triangles: Vec<u32> = mesh.triangles.par_iter().map(on).collect();
        let mut around: Vec<u32> = seen.iter().map(|[hidden, _]| *hidden).collect();
        for (triangle, hidden) in mesh.triangles.iter().zip(on_triangles) {
            triangle.iter().for_each(|&v| around[v as usize] &= hidden);
        }
        Some(seen.iter().zip(around).map(|([hidden, free], around)| pack_suns(*hidden, around, *free)).collect())
    }

    /// Whether the way from a point of the member's frame towards a sun is free.
    pub fn sees(&self, point: Vec3, sun: DVec3) -> bool {
        let origin = self.placed(point);
        self.group.blockers.first(origin, &Mat3A::IDENTITY, &[sun.as_vec3a()], &self.blocks)[0].is_none()
    }

    /// A direction of the world in the member's frame.
    pub fn local(&self, toward: DVec3) -> Vec3 {
        (self.own().placement.turn().inverse() * toward).as_vec3()
    }

    /// The first of those members that count.
    fn first_between(&self, counts: &[bool], from: Vec3, to: Vec3) -> Option<BlockerHit> {
        let [from, to] = [from, to].map(|point| self.placed(point));
        let toward = (to - from).normalize_or_zero();
        let hits = self.group.blockers.first(from, &Mat3A::IDENTITY, &[toward], counts);
        hits[0].filter(|hit| hit.distance < from.distance(to))
    }

    /// Whether another member lies on a point, as the ground on which it stands: between it and the place from which it is
    /// seen. One that faces the same way, as a rug in its floor's plane, is no ground.
    fn is_covered(&self, position: Vec3, normal: Vec3, nudge: Vec3) -> bool {
        let off = nudge.dot(normal) * normal;
        let cover = || self.first_between(&self.others, position - off, position + off);
        self.group.plan.members.len() > 1 && cover().is_some_and(|hit| !hit.is_behind())
    }

    /// Whether a member casts its shadows by an outline, or in closed form, at every distance.
    fn keeps_outline(&self, member: usize) -> bool {
        let of = &self.group.plan.members[member];
        let has_closed_form = of.boxed || of.mesh.rectangle().is_some() || of.mesh.is_convex();
        !of.occludes || of.emits || (of.mask.is_none() && has_closed_form)
    }

    /// Other members that are around this one, of those that keep no outline.
    fn around(&self, mesh: &Mesh, nudges: &[Vec3]) -> Vec<bool> {
        let group = self.group;
        let toward: Vec<Vec3A> = directions(LOOKS[1]).collect();
        let step = mesh.positions.len().div_ceil(LOOKS[0]);
        let origins: Vec<Vec3A> =
            mesh.positions.iter().zip(nudges).step_by(step).map(|(p, nudge)| self.placed(*p + *nudge)).collect();
        let is_around = |member: usize| {
            let (middle, reach) = group.spheres[member];
            let is_beside = |origin: &Vec3A| origin.as_dvec3().distance(middle) > reach;
            if !self.others[member] || self.keeps_outline(member) || origins.iter().any(is_beside) {
                return false;
            }
            let of = [member as u32];
            let cast = |origin: &Vec3A| group.blockers.first_of(*origin, &Mat3A::IDENTITY, &toward, &of);
            let hits: Vec<Option<BlockerHit>> = origins.iter().flat_map(cast).collect();
            hits.iter().flatten().count() as f64 > AROUND * hits.len() as f64
        };
        (0..self.blocks.len()).into_par_iter().map(is_around).collect()
    }

    /// The members that are so near a cluster, given by its vertices, that its maps have their shadows; `around` are
    /// near all.
    fn near(&self, positions: impl Iterator<Item = Vec3>, around: &[bool]) -> Vec<u32> {
        let group = self.group;
        let place = |p: Vec3| (self.own().placement.point(p.as_dvec3()) - group.centre) / group.radius_m;
        let places: Vec<DVec3> = positions.map(place).collect();
        let is_near = |member: &usize| {
            let (middle, reach) = group.spheres[*member];
            let of = &group.plan.members[*member];
            let [low, high] = group.boxes[*member];
            let is_within = |place: &DVec3| {
                let local = of.placement.local(group.centre + group.radius_m * *place);
                let depth = (local - low).min(high - local).min_element() * f64::from(of.placement.scale);
                depth > WITHIN * reach * group.radius_m
            };
            // Those with holes have no outline that is as good.
            let is_close =
                |place: &DVec3| place.distance(middle) < FAR * reach && (of.mask.is_some() || is_within(place));
            let comes_near = || places.iter().any(is_close);
            (*member == self.member && !of.boxed) || around[*member] || (!self.keeps_outline(*member) && comes_near())
        };
        (0..group.spheres.len()).filter(is_near).map(|member| member as u32).collect()
    }

    /// See [`BakedSurface::under_lamps`].
    fn under_lamps(&self, mesh: &Mesh, nudges: &[Vec3]) -> Option<Vec<u8>> {
        let members = &self.group.plan.members;
        let is_lamp = |member: u32| member as usize != self.member && members[member as usize].ends_links;
        if !self.own().receives || !(0..members.len() as u32).any(is_lamp) {
            return None;
        }
        let turn = DMat3::from_quat(self.own().placement.turn());
        let is_under = |((position, normal), nudge): ((&Vec3, &Vec3), &Vec3)| {
            let to_group = Mat3A::from((turn * frame(normal.as_dvec3())).as_mat3());
            let origin = self.placed(*position + *nudge);
            u8::from(share_of(&self.group.blockers, origin, &to_group, &self.reflects, is_lamp) > UNDER)
        };
        let places = mesh.positions.par_iter().zip(&mesh.normals).zip(nudges);
        let under: Vec<u8> = places.map(is_under).collect();
        under.contains(&1).then_some(under)
    }

    /// The surface with the own visibility of its vertices. `told` hears of the vertices that are done.
    /// The surfaces of all members, and the runs of their vertices, are what its links lead to.
    fn surface(
        &self,
        plain: BakedSurface,
        nudges: &[Vec3],
        (lit, runs): (&[Lit], &Runs),
        told: &dyn Fn(usize),
    ) -> BakedSurface {
        let plan = self.group.plan;
        let BakedSurface { mesh, under_lamps, .. } = plain;
        let order = &lit[self.member].order.vertices;
        // Few meshes have buried vertices, which alone ask for their triangles.
        let around = OnceLock::new();
        let edges = shortest_edges(&mesh.positions, &mesh.triangles);
        let stride = channel_stride(plan.bands);
        let mut transfer = vec![0.0; mesh.positions.len() * stride];
        // Pixels of a grid read no maps: all members cast their own shadows there, whose edges are crisp. One with maps is
        // drawn by its triangles.
        let members_around = if plan.wanted.self_visibility { self.around(&mesh, nudges) } else { Vec::new() };
        let is_grid = || Grid::find(&mesh).is_some();
        let has_maps = plan.wanted.self_visibility && (members_around.contains(&true) || !is_grid());
        let mut maps = vec![0; if has_maps { mesh.positions.len() * BYTES } else { 0 }];
        let mut near = Vec::with_capacity(order.len().div_ceil(CLUSTER_VERTICES as usize));
        let mut suns = vec![[0; 2]; mesh.positions.len()];
        let mut any_blocked = false;
        let mut any_in_map = false;
        let shades_itself = shades_itself(&mesh);
        let is_in_map =
            |member: &u32| self.blocks[*member as usize] && (shades_itself || *member as usize != self.member);
        let mut linked = Links::default();
        let mut sky = SkyViews { of_world: plan.members.len() > 1, ..SkyViews::default() };
        let clusters: Vec<&[u32]> = order.chunks(CLUSTER_VERTICES as usize).collect();
        let mut done = 0;
        for batch in clusters.chunks(16) {
            let look = |cluster: &&[u32]| {
                let places = cluster.iter().map(|&v| mesh.positions[v as usize]);
                let near = if has_maps { self.near(places, &members_around) } else { Vec::new() };
                let in_map: Vec<u32> = near.iter().copied().filter(&is_in_map).collect();
                let vertex = |&v: &u32| {
                    let v = v as usize;
                    let normal = mesh.normals[v];
                    let nudge = nudges[v];
                    let in_map = has_maps.then_some(&in_map[..]);
                    let at = |position| Place { position, normal, nudge, edge: edges[v] };
                    let see = |position| self.see_with(at(position), Rays::Many, in_map);
                    let position = mesh.positions[v];
                    let here = see(position);
                    if !here.buried {
                        return here;
                    }
                    let middle = |triangle: u32| {
                        let corners = mesh.triangles[triangle as usize].iter();
                        corners.map(|&v| mesh.positions[v as usize]).sum::<Vec3>() / 3.0
                    };
                    let all_around = || triangles_around(mesh.positions.len(), &mesh.triangles);
                    let triangles = &around.get_or_init(all_around)[v];
                    let middles = || triangles.iter().map(|&triangle| middle(triangle));
                    let neighbours = || {
                        let corners = triangles.iter().flat_map(|&triangle| mesh.triangles[triangle as usize]);
                        corners.filter(|corner| *corner as usize != v).map(|corner| mesh.positions[corner as usize])
                    };
                    let few = |place: Vec3| self.see(at(place), Rays::Few);
                    let most_near = if here.near > BURIED_NEAR { OPEN_NEAR } else { 1.0 };
                    let mut free = None;
                    for place in WAYS_OUT.iter().flat_map(|way| middles().map(|m| position.lerp(m, *way))) {
                        let seen = few(place);
                        if seen.buried {
                            continue;
                        }
                        if seen.near <= most_near {
                            return see(place);
                        }
                        free.get_or_insert(place);
                    }
                    let along = || {
                        let ways = WAYS_ALONG.iter().flat_map(|way| neighbours().map(|n| position.lerp(n, *way)));
                        let places: Vec<Vec3> = ways.filter(|place| !few(*place).buried).collect();
                        let first = *places.first()?;
                        // On both sides of a wall there is no light that suits both.
                        let is_beside = |place: &Vec3| !self.is_between(first + nudge, *place + nudge);
                        places.iter().all(is_beside).then_some(first)
                    };
                    free.or_else(along).map_or(here, see)
                };
                let linked = |place: usize| {
                    let mut seen = vertex(&cluster[place]);
                    let fronts = std::mem::take(&mut seen.fronts).into_iter();
                    let met = fronts.map(|Front { member, triangle, weights, toward, apart, share, .. }| {
                        let lit = &lit[member as usize];
                        let place = lit.place(triangle, weights);
                        let side = lit.sides[place as usize];
                        Met { member, place, side, toward: toward.into(), share, apart }
                    });
                    (seen, links(met.collect(), runs))
                };
                let seers = self.seers(&mesh, nudges, cluster);
                let place = |at: usize| mesh.positions[cluster[at] as usize] + nudges[cluster[at] as usize];
                let cast = |at: usize| Arc::new(linked(at));
                let each = (0..cluster.len()).into_par_iter().with_max_len(8);
                let first: Vec<Option<Arc<(Seen, Vec<Link>)>>> =
                    each.clone().map(|at| (seers[at] == at).then(|| cast(at))).collect();
                // What lies below something, or was seen from beside it, tells nothing of its neighbours.
                let of_other = |at: usize| {
                    let rays = first[seers[at]].as_ref().filter(|_| seers[at] != at)?;
                    (!rays.0.buried && rays.0.from == place(seers[at])).then(|| rays.clone())
                };
                let every = |at: usize| {
                    let other = of_other(at);
                    let is_served = other.is_some();
                    let rays = other.or_else(|| first[at].clone()).unwrap_or_else(|| cast(at));
                    let from = if is_served { place(at) } else { rays.0.from };
                    let normal = mesh.normals[cluster[at] as usize];
                    // Suns have sharp edges, which each vertex finds by itself.
                    SeenVertex { transfer: self.transfer(&rays.0, normal), suns: self.seen_suns(from, normal), rays }
                };
                let vertices: Vec<SeenVertex> = each.map(every).collect();
                let blended = (!runs.at_lamps.is_empty()).then(|| {
                    let links = vertices.iter().map(|vertex| vertex.rays.1.clone()).collect();
                    let sides: Vec<u8> = cluster.iter().map(|&v| side(mesh.normals[v as usize])).collect();
                    blend_faint(links, &sides, runs)
                });
                (near, vertices, blended)
            };
            let found: Vec<(Vec<u32>, Vec<SeenVertex>, Option<Vec<Vec<Link>>>)> = batch.par_iter().map(look).collect();
            for (cluster, (members, vertices, blended)) in batch.iter().zip(found) {
                for (at, (&v, vertex)) in cluster.iter().zip(vertices).enumerate() {
                    let (seen, own_links) = &*vertex.rays;
                    let links = blended.as_ref().map_or(own_links, |blended| &blended[at]);
                    linked.counts.push(links.len() as u8);
                    linked.packed.extend(links.iter().map(|link| link.packed));
                    if !plan.screens.is_empty() {
                        linked.directions.extend(links.iter().map(|link| link.direction));
                    }
                    sky.push(&seen.sky);
                    suns[v as usize] = vertex.suns;
                    any_blocked |= seen.blocked > 0.0;
                    transfer[v as usize * stride..][..stride].copy_from_slice(&vertex.transfer);
                    if has_maps {
                        maps[v as usize * BYTES..][..BYTES].copy_from_slice(&seen.map);
                    }
                }
                any_in_map |= members.iter().any(is_in_map);
                near.push(members);
                done += cluster.len();
            }
            told(done);
        }
        let told_suns = self.told_suns(&mesh, nudges, &suns).map(Arc::new);
        BakedSurface {
            mesh,
            transfer: (any_blocked && plan.wanted.transfer).then(|| Arc::new(transfer)),
            sky: (any_blocked && plan.views_sky).then(|| Arc::new(sky)),
            self_visibility: (any_blocked && any_in_map && has_maps).then(|| Arc::new(maps)),
            near,
            links: (!linked.packed.is_empty()).then(|| Arc::new(linked)),
            told_suns,
            under_lamps,
        }
    }
}

/// Whether a mesh may block what its vertices see: what is flat does not, nor what is convex if its normals are about those
/// of its faces.
fn shades_itself(mesh: &Mesh) -> bool {
    let is_bent = |triangle: &[u32; 3]| {
        let [a, b, c] = triangle.map(|v| mesh.positions[v as usize]);
        let side = (b - a).cross(c - a).normalize_or_zero();
        side != Vec3::ZERO && triangle.iter().any(|&v| mesh.normals[v as usize].dot(side) < LEAST_ALONG)
    };
    !mesh.is_flat() && (!mesh.is_convex() || mesh.triangles.iter().any(is_bent))
}

/// What a vertex of a cluster sees.
struct SeenVertex {
    /// Its own rays and links, or those of a vertex that stands and faces as it does.
    rays: Arc<(Seen, Vec<Link>)>,
    transfer: Vec<f32>,
    /// A bit for each sun of which nothing can be seen, and all.
    suns: [u32; 2],
}

/// Whether vertices are of different sides, as of both faces of a wall: their normals differ, or they lie apart along
/// their common normal.
fn is_mixed(mesh: &Mesh, vertices: &[u32]) -> bool {
    let normals = || vertices.iter().map(|&v| mesh.normals[v as usize]);
    let common = normals().sum::<Vec3>().normalize_or_zero();
    let places = || vertices.iter().map(|&v| mesh.positions[v as usize]);
    let low = places().fold(Vec3::INFINITY, Vec3::min);
    let high = places().fold(Vec3::NEG_INFINITY, Vec3::max);
    let heights = || places().map(|place| place.dot(common));
    let height = heights().fold(f32::NEG_INFINITY, f32::max) - heights().fold(f32::INFINITY, f32::min);
    height > MOST_HEIGHT * low.distance(high) || normals().any(|normal| normal.dot(common) < LEAST_COMMON)
}

/// The vertices that are lit on the triangles of a mesh.
struct Lit {
    order: ClusterOrder,
    /// Which way the vertex at each place faces.
    sides: Vec<u8>,
    /// For each triangle of the mesh: the first of its cells, and how many lie along a side of its square.
    grids: Vec<(u32, u32)>,
    /// The place in the order of the vertex that lies nearest to the middle of each cell.
    cells: Vec<u32>,
}

impl Lit {
    /// `surface` is the mesh, or finer: then `parents` has the mesh's triangle of each of its own. `is_mixed` tells whether
    /// vertices are of different sides.
    fn new(mesh: &Mesh, surface: &BakedSurface, parents: Option<&[u32]>, is_mixed: &dyn Fn(&[u32]) -> bool) -> Self {
        let order = surface.order();
        let BakedSurface { mesh: surface, under_lamps, .. } = surface;
        let mut places = vec![0; order.vertices.len()];
        order.vertices.iter().zip(0..).for_each(|(&v, place)| places[v as usize] = place);
        let mut mixed = vec![false; places.len()];
        for (_, (_, first, count)) in Runs::new([&order.runs[..]]).of_size(0) {
            mixed[first..first + count].fill(is_mixed(&order.vertices[first..first + count]));
        }
        let mut counts = vec![0_u32; mesh.triangles.len()];
        let parent = |part: usize| parents.map_or(part, |parents| parents[part] as usize);
        (0..surface.triangles.len()).for_each(|part| counts[parent(part)] += 1);
        // Nine cells a part, half of them within the triangle: each corner is nearest to a third of the part.
        let mut end = 0;
        let grid = |&count: &u32| {
            let side = (3.0 * f64::from(count).sqrt()).ceil() as u32;
            let first = end;
            end += side * side;
            (first, side)
        };
        let grids: Vec<(u32, u32)> = counts.iter().map(grid).collect();
        let mut cells = vec![u32::MAX; end as usize];
        for (part, vertices) in surface.triangles.iter().enumerate() {
            let of = mesh.triangles[parent(part)].map(|v| Vec3A::from(mesh.positions[v as usize]));
            let edges = [of[1] - of[0], of[2] - of[0]];
            let (first, side) = grids[parent(part)];
            let positions = vertices.map(|v| Vec3A::from(surface.positions[v as usize]) - of[0]);
            let corners = positions.map(|position| weights(edges, position));
            let step = 1.0 / side as f32;
            let range = |axis: usize| {
                let all = corners.map(|corner| corner[axis] / step - 0.5);
                let low = all.into_iter().fold(f32::INFINITY, f32::min).ceil().max(0.0);
                let high = all.into_iter().fold(0.0, f32::max).floor().min(side as f32 - 1.0);
                low as u32..high as u32 + 1
            };
            for y in range(1) {
                for x in range(0) {
                    let at = [x, y].map(|i| (i as f32 + 0.5) * step);
                    let cell = &mut cells[(first + y * side + x) as usize];
                    if *cell == u32::MAX || is_within(corners, at) {
                        let place = at[0] * edges[0] + at[1] * edges[1];
                        let away = positions.map(|position| position.distance_squared(place));
                        // The light of a run is the mean of its vertices, and that under a lamp would shine out.
                        let is_worse = |i: usize| {
                            let v = vertices[i] as usize;
                            (under_lamps.as_ref().map_or(0, |under| under[v]), mixed[places[v] as usize])
                        };
                        let nearest =
                            (0..3).min_by(|&a, &b| is_worse(a).cmp(&is_worse(b)).then(away[a].total_cmp(&away[b])));
                        *cell = places[vertices[nearest.unwrap_or(0)] as usize];
                    }
                }
            }
        }
        // Cells beyond the long side of a triangle, and those that no part covers.
        for (triangle, &(first, side)) in mesh.triangles.iter().zip(&grids) {
            let any = places[triangle[0] as usize];
            let cells = &mut cells[first as usize..][..(side * side) as usize];
            for i in 0..cells.len() {
                if cells[i] == u32::MAX {
                    cells[i] = if i > 0 { cells[i - 1] } else { any };
                }
            }
        }
        let sides = order.vertices.iter().map(|&v| side(surface.normals[v as usize])).collect();
        Lit { order, sides, grids, cells }
    }

    /// The place in the order of the vertex nearest to a place of a triangle.
    fn place(&self, triangle: u32, weights: [f32; 2]) -> u32 {
        let (first, side) = self.grids[triangle as usize];
        let [x, y] = weights.map(|weight| ((weight * side as f32) as u32).min(side - 1));
        self.cells[(first + y * side + x) as usize]
    }
}

/// Whether a point lies within a triangle of the plane, which may run either way around.
fn is_within([a, b, c]: [[f32; 2]; 3], [x, y]: [f32; 2]) -> bool {
    let side = |p: [f32; 2], q: [f32; 2]| (q[0] - p[0]) * (y - p[1]) - (q[1] - p[1]) * (x - p[0]);
    let sides = [side(a, b), side(b, c), side(c, a)];
    sides.iter().all(|side| *side >= 0.0) || sides.iter().all(|side| *side <= 0.0)
}

/// The length of the shortest edge at every vertex; 0 where it has none.
fn shortest_edges(positions: &[Vec3], triangles: &[[u32; 3]]) -> Vec<f32> {
    let mut shortest = vec![f32::INFINITY; positions.len()];
    for (from, to) in triangles.iter().flat_map(|triangle| sides(*triangle)) {
        let ends = [from, to].map(|v| v as usize);
        let length = positions[ends[0]].distance(positions[ends[1]]);
        ends.iter().for_each(|&v| shortest[v] = shortest[v].min(length));
    }
    shortest.iter().map(|length| if length.is_finite() { *length } else { 0.0 }).collect()
}

/// The triangles around every vertex.
pub(super) fn triangles_around(vertices: usize, triangles: &[[u32; 3]]) -> Vec<Vec<u32>> {
    let mut around = vec![Vec::new(); vertices];
    for (index, triangle) in (0..).zip(triangles) {
        triangle.iter().for_each(|&v| around[v as usize].push(index));
    }
    around
}

/// How a surface is kept in the cache.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
struct StoredSurface {
    vertices: usize,
    triangles: usize,
    /// Whether its geometry follows, as that of a mesh that was refined.
    refined: bool,
    transfer: bool,
    /// Shares of the sky, whose counts for every vertex come before them.
    sky: Option<usize>,
    self_visibility: bool,
    told_suns: bool,
    under_lamps: bool,
    /// Links, whose counts for every vertex come before them; 0 without counts where no vertex has any.
    links: usize,
    /// Clusters with near members, whose counts and numbers end the payload.
    clusters: usize,
}

#[derive(Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct StoredGroup {
    key: String,
    surfaces: Vec<StoredSurface>,
}

/// The unread rest of a payload.
struct Rest<'p>(&'p [u8]);

impl Rest<'_> {
    fn take<T: bytemuck::Pod>(&mut self, count: usize) -> Option<Vec<T>> {
        let (taken, after) = self.0.split_at_checked(count.checked_mul(size_of::<T>())?)?;
        self.0 = after;
        Some(bytemuck::pod_collect_to_vec(taken))
    }

    /// An optional part; `None` where its bytes are missing.
    fn take_if<T: bytemuck::Pod>(&mut self, is_there: bool, count: usize) -> Option<Option<Vec<T>>> {
        if is_there { self.take(count).map(Some) } else { Some(None) }
    }

    /// For each vertex how many things it has, and all of these things, if their number is given.
    fn take_counted<T: bytemuck::Pod>(
        &mut self,
        vertices: usize,
        all: Option<usize>,
    ) -> Option<Option<(Vec<u8>, Vec<T>)>> {
        let Some(all) = all else { return Some(None) };
        let counts: Vec<u8> = self.take(vertices)?;
        let things = self.take(all)?;
        let sum: usize = counts.iter().map(|count| usize::from(*count)).sum();
        (sum == all).then_some(Some((counts, things)))
    }
}

/// The bytes of an optional part.
fn bytes<T: bytemuck::Pod>(of: Option<&Vec<T>>) -> &[u8] {
    of.map(|of| bytemuck::cast_slice(of)).unwrap_or_default()
}

impl GroupPlan {
    pub(super) fn store(&self, surfaces: &[BakedSurface]) -> (StoredGroup, Vec<u8>) {
        let mut payload = Vec::new();
        let mut stored = Vec::new();
        for (member, surface) in self.members.iter().zip(surfaces) {
            let BakedSurface { mesh, transfer, sky, self_visibility, near, links, told_suns, under_lamps } = surface;
            let refined = !Arc::ptr_eq(mesh, &member.mesh);
            if refined {
                payload.extend_from_slice(bytemuck::cast_slice(&mesh.positions));
                payload.extend_from_slice(bytemuck::cast_slice(&mesh.normals));
                payload.extend_from_slice(bytes(mesh.colors.as_ref()));
                payload.extend_from_slice(bytes(mesh.uvs.as_ref()));
                payload.extend_from_slice(bytes(mesh.tints.as_ref()));
                payload.extend_from_slice(bytemuck::cast_slice(&mesh.triangles));
            }
            payload.extend_from_slice(bytes(transfer.as_deref()));
            if let Some(views) = sky {
                payload.extend_from_slice(&views.counts);
                payload.extend_from_slice(views.cells.as_flattened());
            }
            payload.extend_from_slice(bytes(self_visibility.as_deref()));
            payload.extend_from_slice(bytes(told_suns.as_deref()));
            payload.extend_from_slice(bytes(under_lamps.as_deref()));
            if let Some(links) = links {
                payload.extend_from_slice(&links.counts);
                payload.extend_from_slice(bytemuck::cast_slice(&links.packed));
                payload.extend_from_slice(bytemuck::cast_slice(&links.directions));
            }
            stored.push(StoredSurface {
                vertices: mesh.positions.len(),
                triangles: mesh.triangles.len(),
                refined,
                transfer: transfer.is_some(),
                sky: sky.as_ref().map(|views| views.cells.len()),
                self_visibility: self_visibility.is_some(),
                told_suns: told_suns.is_some(),
                under_lamps: under_lamps.is_some(),
                links: links.as_ref().map_or(0, |links| links.packed.len()),
                clusters: near.len(),
            });
            for members in near {
                payload.extend_from_slice(&(members.len() as u32).to_le_bytes());
                payload.extend_from_slice(bytemuck::cast_slice(members));
            }
        }
        (StoredGroup { key: self.key.clone().unwrap_or_default(), surfaces: stored }, payload)
    }

    /// What header and payload hold; `None` where they hold something else.
    pub(super) fn restore(&self, header: &StoredGroup, payload: &[u8]) -> Option<Vec<BakedSurface>> {
        if self.key.as_ref() != Some(&header.key) || header.surfaces.len() != self.members.len() {
            return None;
        }
        let mut rest = Rest(payload);
        let mut surfaces = Vec::new();
        for (member, stored) in self.members.iter().zip(&header.surfaces) {
            let mut mesh = member.mesh.clone();
            let vertices = stored.vertices;
            if stored.refined {
                let positions: Vec<Vec3> = rest.take(vertices)?;
                let normals: Vec<Vec3> = rest.take(vertices)?;
                let attributes = Attributes {
                    colors: rest.take_if(mesh.colors.is_some(), vertices)?,
                    uvs: rest.take_if(mesh.uvs.is_some(), vertices)?,
                    tints: rest.take_if(mesh.tints.is_some(), vertices)?,
                };
                let triangles: Vec<[u32; 3]> = rest.take(stored.triangles)?;
                let fits = triangles.iter().flatten().all(|&v| (v as usize) < vertices);
                let is_finite = positions.iter().chain(&normals).all(|v| v.is_finite());
                if !fits || !is_finite {
                    return None;
                }
                mesh = Arc::new(mesh.refined(positions, normals, attributes, triangles));
            } else if vertices != mesh.positions.len() {
                return None;
            }
            let transfer = rest.take_if(stored.transfer, vertices * channel_stride(self.bands))?.map(Arc::new);
            let sky = rest.take_counted(vertices, stored.sky)?;
            let of_world = self.members.len() > 1;
            let sky = sky.map(|(counts, cells)| Arc::new(SkyViews { of_world, counts, cells }));
            let self_visibility = rest.take_if(stored.self_visibility, vertices * BYTES)?.map(Arc::new);
            let told_suns = rest.take_if(stored.told_suns, vertices)?.map(Arc::new);
            let under_lamps = rest.take_if(stored.under_lamps, vertices)?.map(Arc::new);
            let links = rest.take_counted(vertices, (stored.links > 0).then_some(stored.links))?;
            let directions = rest.take(if self.screens.is_empty() { 0 } else { stored.links })?;
            let links = links.map(|(counts, packed)| Arc::new(Links { counts, packed, directions }));
            let mut near = Vec::new();
            for _ in 0..stored.clusters {
                let count = rest.take::<u32>(1)?[0];
                near.push(rest.take(count as usize)?);
            }
            surfaces.push(BakedSurface { mesh, transfer, sky, self_visibility, near, links, told_suns, under_lamps });
        }
        rest.0.is_empty().then_some(surfaces)
    }

    /// Entities of a cluster's near members.
    pub(super) fn entities_of(&self, members: &[u32]) -> Vec<u32> {
        if self.members.len() == 1 {
            return Vec::new();
        }
        members.iter().filter_map(|&member| self.entities.get(member as usize)).map(|&entity| entity as u32).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::generate;

    /// A wall and the flare at its foot, each with its own vertices in the groove, which have one normal: as files have
    /// them whose sides are islands of a texture.
    #[test]
    fn vertices_of_a_groove_are_seen_from_before_both_sides() {
        let corners = [[1.0, 0.0], [0.0, 0.0], [0.0, 0.0], [-1.0, 1.0]];
        let positions: Vec<Vec3> =
            corners.iter().flat_map(|[y, z]| [-1.0, 1.0].map(|x| Vec3::new(x, *y, *z))).collect();
        let sides = [Vec3::Z, Vec3::new(0.0, 1.0, 1.0).normalize()];
        let groove = (sides[0] + sides[1]).normalize();
        let normals = [sides[0], groove, groove, sides[1]].iter().flat_map(|normal| [*normal; 2]).collect();
        let triangles = [0, 4].iter().flat_map(|v| [[*v, v + 2, v + 1], [v + 1, v + 2, v + 3]]).collect();
        let mesh = Arc::new(Mesh::new("groove", positions, normals, None, triangles).unwrap());
        let alone = GroupPlan::alone(&mesh, &Options::default(), Wanted::BOTH);
        let plan = GroupPlan { refinement: Some((1000, false)), ..alone };
        let group = Group::new(&plan);
        let nudges = group.space(0).nudges(&mesh.positions, &mesh.normals, &mesh.triangles);
        let in_groove = mesh.positions.iter().zip(&nudges).filter(|(place, _)| place.y == 0.0 && place.z == 0.0);
        let in_groove: Vec<Vec3> = in_groove.map(|(_, nudge)| *nudge).collect();
        assert_eq!(in_groove.len(), 4);
        for side in sides {
            assert!(in_groove.iter().all(|nudge| nudge.dot(side) > 1e-4), "{in_groove:?} before {side}");
        }
    }

    /// A wall stands between some vertices of a floor that lie a millimetre apart.
    #[test]
    fn close_vertices_share_rays_unless_something_stands_between_them() {
        let floor = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0], [-0.001, 0.0], [0.001, 0.0], [0.0015, 0.001]];
        let floor = floor.map(|[x, z]| Vec3::new(x, 0.0, z)).to_vec();
        let triangles = vec![[0, 3, 4], [4, 3, 6], [3, 2, 6], [2, 1, 5], [6, 2, 5], [1, 0, 5], [0, 4, 5], [4, 6, 5]];
        let floor = Arc::new(Mesh::new("floor", floor, vec![Vec3::Y; 7], None, triangles).unwrap());
        let wall = [[-1.0, 0.0], [1.0, 0.0], [1.0, 1.0], [-1.0, 1.0]].map(|[z, y]| Vec3::new(0.0, y, z)).to_vec();
        let wall = Arc::new(Mesh::new("wall", wall, vec![Vec3::X; 4], None, vec![[0, 1, 2], [0, 2, 3]]).unwrap());
        let mut plan = GroupPlan::alone(&floor, &Options::default(), Wanted::BOTH);
        let stands = Member { mesh: wall, ..plan.members[0].clone() };
        let seers = |plan: &GroupPlan| {
            let group = Group::new(plan);
            let space = group.space(0);
            let nudges = space.nudges(&floor.positions, &floor.normals, &floor.triangles);
            let inner: Vec<u32> = (0..7).filter(|&v| floor.positions[v as usize].length() < 0.1).collect();
            let seers = space.seers(&floor, &nudges, &inner);
            let x = |at: usize| floor.positions[inner[at] as usize].x;
            let mut found: Vec<(f32, f32)> = (0..3).map(|at| (x(at), x(seers[at]))).collect();
            found.sort_by(|a, b| a.0.total_cmp(&b.0));
            found
        };
        let first = seers(&plan)[0].1;
        assert!(seers(&plan).iter().all(|(_, seer)| *seer == first));
        plan.members.push(stands);
        let found = seers(&plan);
        assert_eq!(found[0].1, -0.001);
        assert!(found[1].1 > 0.0 && found[1].1 == found[2].1, "{found:?}");
    }

    /// A board lies close above a floor, as a picture hangs on a wall: below its rim a vertex is dark, but its triangles,
    /// which reach from there into the open, are not. Below a board on legs they are.
    #[test]
    fn vertices_close_behind_something_are_seen_from_beside_it() {
        let floor = Arc::new(generate::plane(4.0, 8));
        let corners = [[-0.6, -0.6], [0.6, -0.6], [0.6, 0.6], [-0.6, 0.6]];
        let corners = corners.map(|[x, z]| Vec3::new(x, 0.0, z)).to_vec();
        let board = Mesh::new("board", corners, vec![Vec3::NEG_Y; 4], None, vec![[0, 1, 2], [0, 2, 3]]).unwrap();
        let board = Arc::new(board);
        let light_below = |height: f32| {
            let alone = GroupPlan::alone(&floor, &Options::default(), Wanted::BOTH);
            let mut plan = GroupPlan { refinement: Some((1000, false)), ..alone };
            let floor_member = Member { refines: false, ..plan.members[0].clone() };
            let placement = Placement { position: height * Vec3::Y, ..AT_ORIGIN };
            plan.members = vec![floor_member.clone(), Member { mesh: board.clone(), placement, ..floor_member }];
            let surface = &plan.bake(&|_, _| ()).0[0];
            let transfer = surface.transfer.as_ref().unwrap();
            let at = |x: f32, z: f32| {
                let at = surface.mesh.positions.iter().position(|place| *place == Vec3::new(x, 0.0, z)).unwrap();
                transfer[at * channel_stride(plan.bands)] / (std::f32::consts::PI.sqrt() / 2.0)
            };
            [at(0.0, 0.0), at(0.5, 0.0)]
        };
        let close = light_below(0.03);
        assert!(close[0] < 0.1 && close[1] > 0.9, "{close:?}");
        let on_legs = light_below(0.3);
        assert!(on_legs[0] < 0.3 && on_legs[1] < 0.8, "{on_legs:?}");
    }

    #[test]
    fn corners_of_a_room_are_not_buried() {
        let cube = generate::cuboid(Vec3::ONE, 4);
        let triangles = cube.triangles.iter().map(|[a, b, c]| [*a, *c, *b]).collect();
        let normals = cube.normals.iter().map(|normal| -*normal).collect();
        let room = Arc::new(Mesh::new("room", cube.positions.clone(), normals, None, triangles).unwrap());
        let alone = GroupPlan::alone(&room, &Options::default(), Wanted::BOTH);
        let plan = GroupPlan { refinement: Some((1000, false)), ..alone };
        let group = Group::new(&plan);
        let space = group.space(0);
        let nudges = space.nudges(&room.positions, &room.normals, &room.triangles);
        let mut most_near = 0.0_f64;
        for (v, edge) in shortest_edges(&room.positions, &room.triangles).into_iter().enumerate() {
            let place = Place { position: room.positions[v], normal: room.normals[v], nudge: nudges[v], edge };
            let seen = space.see(place, Rays::Few);
            assert!(!seen.buried, "{place:?} {} near", seen.near);
            most_near = most_near.max(seen.near);
        }
        assert!(most_near > 0.6, "a corner has walls close by: {most_near}");
    }
}
