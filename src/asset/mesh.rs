//! A checked triangle mesh with derived data: bounding sphere, closedness, convexity, flatness and content hash.

use glam::{DVec3, Vec2, Vec3};

use super::{bars, boxes, enclose, outline, topology};
use crate::error::{Error, Result};
use crate::field::cuboid::{Cuboid, PlacedCuboid};
use crate::field::sheet::Rectangle;
use crate::field::sub_light::{LampFace, TUBE};

/// Largest number of triangles of a mesh: 48 MB of indices, and edge tables of about 200 MB while it is checked.
pub const TRIANGLE_LIMIT: usize = 4_000_000;
/// Largest magnitude of a coordinate in metres; beyond it f32 positions resolve no detail below a metre.
pub const COORDINATE_LIMIT_M: f32 = 1e7;
/// Smallest bounding radius in metres; below it, squared lengths in shaders leave the range of f32.
const RADIUS_MINIMUM_M: f32 = 1e-9;
/// A mesh whose area is below this share of its squared radius is a point or a line up to f32 rounding.
const RELATIVE_AREA_MINIMUM: f64 = 1e-10;

/// Triangles with one unit normal per vertex; vertices are split where normals differ. Positions in metres.
///
/// The arrays are public to read. [`Mesh::new`] computes from them what the accessors return, so build a new mesh
/// instead of changing one. Vertices stand in the order of their first use by a triangle; every vertex is used.
#[derive(Clone, Debug, PartialEq)]
pub struct Mesh {
    /// Name for messages: the generator's, or the file's stem.
    pub name: String,
    /// Positions in metres, all finite and within [`COORDINATE_LIMIT_M`].
    pub positions: Vec<Vec3>,
    /// Unit normals, one per position.
    pub normals: Vec<Vec3>,
    /// Linear RGB emission pattern per position, finite and not negative, if the mesh has one.
    pub colors: Option<Vec<Vec3>>,
    /// Texture coordinates per position, v upwards, if the mesh has any.
    pub uvs: Option<Vec<Vec2>>,
    /// Linear RGB factor on the reflectance per position, 0 to 1, if the mesh has any.
    pub tints: Option<Vec<Vec3>>,
    /// Indices into the arrays above, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    centre: Vec3,
    radius_m: f32,
    shape: topology::Topology,
    content_hash: [u8; 32],
    pub(super) panel: Option<LampFace>,
    rectangle: Option<Rectangle>,
    cuboid: Option<Cuboid>,
    boxes: Vec<PlacedCuboid>,
    two_sided: bool,
}

/// What vertices may have besides positions and normals; each array has one element per position, or is left out. Meshes
/// have them under the same names.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Attributes {
    pub colors: Option<Vec<Vec3>>,
    pub uvs: Option<Vec<Vec2>>,
    pub tints: Option<Vec<Vec3>>,
}

impl Attributes {
    fn pick(&self, used: &[u32]) -> Self {
        fn of<T: Copy>(from: &Option<Vec<T>>, used: &[u32]) -> Option<Vec<T>> {
            from.as_ref().map(|all| used.iter().map(|&i| all[i as usize]).collect())
        }
        Attributes { colors: of(&self.colors, used), uvs: of(&self.uvs, used), tints: of(&self.tints, used) }
    }

    /// Which of them there are: colours, texture coordinates and tints.
    pub(crate) fn kinds(&self) -> [bool; 3] {
        [self.colors.is_some(), self.uvs.is_some(), self.tints.is_some()]
    }

    /// Adds those of further vertices, which have the same kinds.
    pub(crate) fn extend(&mut self, more: &Attributes) {
        fn add<T: Copy>(to: &mut Option<Vec<T>>, more: &Option<Vec<T>>) {
            if let Some(more) = more {
                to.get_or_insert_default().extend(more);
            }
        }
        add(&mut self.colors, &more.colors);
        add(&mut self.uvs, &more.uvs);
        add(&mut self.tints, &more.tints);
    }

    /// Adds the attributes of a vertex halfway between two others.
    pub(crate) fn add_middle(&mut self, a: usize, b: usize) {
        for colors in self.colors.iter_mut().chain(&mut self.tints) {
            colors.push(0.5 * (colors[a] + colors[b]));
        }
        if let Some(uvs) = &mut self.uvs {
            uvs.push(0.5 * (uvs[a] + uvs[b]));
        }
    }
}

impl Mesh {
    /// As [`Mesh::with_attributes`], with colours alone.
    pub fn new(
        name: impl Into<String>,
        positions: Vec<Vec3>,
        normals: Vec<Vec3>,
        colors: Option<Vec<Vec3>>,
        triangles: Vec<[u32; 3]>,
    ) -> Result<Self> {
        Self::with_attributes(name, positions, normals, Attributes { colors, ..Attributes::default() }, triangles)
    }

    /// Checks and completes a mesh.
    ///
    /// Empty `normals` are computed from the triangles, weighted by angle; given ones are brought to unit length, and
    /// those of zero length replaced by computed ones. Triangles with two equal corners are dropped, which leaves a
    /// closed surface closed; needles and other triangles without area are kept, since dropping them could open it.
    /// Unused vertices are dropped.
    pub fn with_attributes(
        name: impl Into<String>,
        positions: Vec<Vec3>,
        normals: Vec<Vec3>,
        attributes: Attributes,
        triangles: Vec<[u32; 3]>,
    ) -> Result<Self> {
        check_numbers(&positions, &normals, &attributes, &triangles)?;
        let (used, triangles) = compact(&positions, &triangles);
        if triangles.is_empty() {
            return Err(Error::Input("no faces with three different corners".into()));
        }
        let pick = |from: &[Vec3]| used.iter().map(|&i| from[i as usize]).collect::<Vec<_>>();
        let positions = pick(&positions);
        let normals =
            complete_normals(&positions, &triangles, &if normals.is_empty() { normals } else { pick(&normals) });
        let attributes = attributes.pick(&used);

        let (centre, radius_m) = enclose::bounding_sphere(&positions);
        if radius_m < RADIUS_MINIMUM_M {
            return Err(Error::Input(format!("zero radius: all vertices lie within {RADIUS_MINIMUM_M:e} m")));
        }
        let area = area_m2(&positions, &triangles);
        if area < RELATIVE_AREA_MINIMUM * f64::from(radius_m).powi(2) {
            return Err(Error::Input("zero total area: all triangles are points or needles".into()));
        }
        let shape = topology::shape(&positions, &triangles, centre, radius_m);
        let content_hash = hash(&positions, &normals, &attributes, &triangles);
        let Attributes { colors, uvs, tints } = attributes;
        let mut mesh = Self {
            name: name.into(),
            positions,
            normals,
            colors,
            uvs,
            tints,
            triangles,
            centre,
            radius_m,
            shape,
            content_hash,
            panel: None,
            rectangle: None,
            cuboid: None,
            boxes: Vec::new(),
            two_sided: false,
        };
        mesh.rectangle = outline::rectangle(&mesh);
        mesh.cuboid = outline::cuboid(&mesh);
        mesh.boxes = boxes::boxes(&mesh);
        if mesh.boxes.is_empty() {
            mesh.boxes = bars::bars(&mesh);
        }
        if mesh.colors.is_none() {
            mesh.panel = mesh.rectangle.map_or_else(|| mesh.tube(), |rectangle| rectangle.as_lamp());
        }
        Ok(mesh)
    }

    /// Centre and radius in metres of the smallest enclosing sphere (see [`enclose::bounding_sphere`]).
    pub fn bounding_sphere(&self) -> (Vec3, f32) {
        (self.centre, self.radius_m)
    }

    /// Whether the surface, with equal positions welded, is a 2-manifold without boundary, wound consistently and
    /// outwards (positive volume). Only then may back faces be culled.
    pub fn is_closed(&self) -> bool {
        self.shape.closed
    }

    /// Whether the mesh is closed and each of its pieces has positive volume, so that no piece is the wall of a cavity
    /// or inside out. From outside, only front faces are seen.
    pub fn is_solid(&self) -> bool {
        self.shape.solid
    }

    /// Whether the mesh is closed, in one piece, without handles, and bends outwards (or not at all) at every edge.
    pub fn is_convex(&self) -> bool {
        self.shape.convex
    }

    /// Whether all vertices lie in one plane, within 1e-5 of the bounding radius.
    pub fn is_flat(&self) -> bool {
        self.shape.plane.is_some()
    }

    /// Unit normal of the plane of a flat mesh.
    pub(crate) fn plane_normal(&self) -> Option<DVec3> {
        self.shape.plane
    }

    /// Vertices - edges + triangles after welding equal positions: 2 for a sphere, 0 for a torus.
    pub fn euler_characteristic(&self) -> i64 {
        self.shape.euler_characteristic
    }

    /// For each vertex, the distance of the farthest vertex that shares a triangle with it, metres.
    pub fn steps(&self) -> Vec<f32> {
        let mut steps = vec![0.0_f32; self.positions.len()];
        for triangle in &self.triangles {
            for (v, w) in [(0, 1), (1, 2), (2, 0)].map(|(i, j)| (triangle[i] as usize, triangle[j] as usize)) {
                let side = self.positions[v].distance(self.positions[w]);
                steps[v] = steps[v].max(side);
                steps[w] = steps[w].max(side);
            }
        }
        steps
    }

    pub fn area_m2(&self) -> f64 {
        area_m2(&self.positions, &self.triangles)
    }

    /// A third of the triangles around each vertex, in square metres.
    pub fn vertex_areas_m2(&self) -> Vec<f64> {
        let mut areas = vec![0.0; self.positions.len()];
        for triangle in &self.triangles {
            let third = area_m2(&self.positions, std::slice::from_ref(triangle)) / 3.0;
            triangle.iter().for_each(|&v| areas[v as usize] += third);
        }
        areas
    }

    /// Mean over all directions of the share of its bounding sphere's disc that the mesh covers, if it is a ball:
    /// convex, with every face at least 0.9 r from the centre. Of a convex body that mean is its area over four (Cauchy
    /// 1841).
    pub fn ball_share(&self) -> Option<f64> {
        let radius = f64::from(self.radius_m);
        let depth = |triangle: &[u32; 3]| {
            let [a, b, c] = triangle.map(|v| (self.positions[v as usize] - self.centre).as_dvec3());
            (b - a).cross(c - a).try_normalize().map_or(radius, |normal| normal.dot(a).abs())
        };
        let is_ball = self.is_convex() && radius > 0.0 && self.triangles.iter().all(|t| depth(t) >= 0.9 * radius);
        is_ball.then(|| self.area_m2() / (4.0 * std::f64::consts::PI * radius * radius))
    }

    /// Least and largest corner of the box around it.
    pub fn extent(&self) -> [Vec3; 2] {
        let places = || self.positions.iter().copied();
        [places().fold(Vec3::MAX, Vec3::min), places().fold(Vec3::MIN, Vec3::max)]
    }

    /// The tube that the mesh is, if it is convex and long along one of its axes. One at most twice as wide as thick counts as
    /// the cylinder of its length and area, and a wider one as a slat that fills the box around it to that area.
    fn tube(&self) -> Option<LampFace> {
        let [low, high] = self.extent();
        let size = high - low;
        let axis = size.max_position();
        let [a, b] = [size[(axis + 1) % 3], size[(axis + 2) % 3]];
        let [wide, thick] = [a.max(b), a.min(b)].map(f64::from);
        if !self.is_convex() || self.is_flat() {
            return None;
        }
        let length = f64::from(size[axis]);
        let (radius, thin) = if wide <= 2.0 * thick {
            // 2 pi l^2 (radius + radius^2) is the area of a cylinder of length l.
            let share = self.area_m2() / (std::f64::consts::TAU * length * length);
            (((1.0 + 4.0 * share).sqrt() - 1.0) / 2.0, 1.0)
        } else {
            let whole = 2.0 * (length * (wide + thick) + wide * thick);
            let thin = thick / wide;
            (self.area_m2() / whole * wide / (2.0 * length), if a >= b { thin } else { -thin })
        };
        (0.0 < radius && radius <= TUBE).then_some(LampFace::Tube { axis, radius, thin })
    }

    /// The face that shines: of a body that shines from one side, of a rectangle in one colour at right angles to +y
    /// whose edges run along x and z, or of a tube.
    pub fn panel(&self) -> Option<LampFace> {
        self.panel
    }

    /// The same shape by more vertices, each on a triangle of this mesh.
    pub(crate) fn refined(
        &self,
        positions: Vec<Vec3>,
        normals: Vec<Vec3>,
        attributes: Attributes,
        triangles: Vec<[u32; 3]>,
    ) -> Mesh {
        let content_hash = hash(&positions, &normals, &attributes, &triangles);
        let Attributes { colors, uvs, tints } = attributes;
        Mesh { positions, normals, colors, uvs, tints, triangles, content_hash, ..self.clone() }
    }

    /// The mesh with the backs of its triangles as triangles of their own, which are lit by themselves. It is closed no
    /// more: what is within sees it too.
    pub(crate) fn with_backs(mut self) -> Self {
        if self.is_closed() {
            self = self.opened();
        }
        let count = self.positions.len() as u32;
        self.positions.extend_from_within(..);
        self.normals.extend_from_within(..);
        self.normals[count as usize..].iter_mut().for_each(|normal| *normal = -*normal);
        self.colors.iter_mut().for_each(|colors| colors.extend_from_within(..));
        self.uvs.iter_mut().for_each(|uvs| uvs.extend_from_within(..));
        self.tints.iter_mut().for_each(|tints| tints.extend_from_within(..));
        let backs: Vec<[u32; 3]> = self.triangles.iter().map(|[a, b, c]| [a + count, c + count, b + count]).collect();
        self.triangles.extend(backs);
        self.content_hash = hash(&self.positions, &self.normals, &self.attributes(), &self.triangles);
        self.two_sided = true;
        self
    }

    /// The mesh with its backs for fronts.
    pub(crate) fn turned_over(mut self) -> Result<Self> {
        self.normals.iter_mut().for_each(|normal| *normal = -*normal);
        self.triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
        let attributes = self.attributes();
        Self::with_attributes(self.name, self.positions, self.normals, attributes, self.triangles)
    }

    /// Whether the backs of triangles are triangles too. Of a mesh as it was read, they are the second half.
    pub fn is_two_sided(&self) -> bool {
        self.two_sided
    }

    /// The mesh as one that has holes: neither closed nor a rectangle or of boxes.
    pub(super) fn opened(mut self) -> Self {
        self.shape = topology::Topology { closed: false, solid: false, convex: false, ..self.shape };
        self.rectangle = None;
        self.cuboid = None;
        self.boxes.clear();
        self.panel = None;
        self
    }

    pub(crate) fn attributes(&self) -> Attributes {
        Attributes { colors: self.colors.clone(), uvs: self.uvs.clone(), tints: self.tints.clone() }
    }

    /// The rectangle that the mesh covers, if it is flat and does.
    pub fn rectangle(&self) -> Option<Rectangle> {
        self.rectangle
    }

    /// The box that the mesh is, if it is one.
    pub fn cuboid(&self) -> Option<Cuboid> {
        self.cuboid
    }

    /// Boxes that overlap and together are the mesh, if it is a solid with square corners and no box itself, or consists
    /// of thin bars.
    pub fn boxes(&self) -> &[PlacedCuboid] {
        &self.boxes
    }

    /// The same, with the box that it is itself.
    pub(crate) fn as_boxes(&self) -> Vec<PlacedCuboid> {
        let placed =
            |cuboid| PlacedCuboid { centre_m: self.centre.as_dvec3(), radius_m: f64::from(self.radius_m), cuboid };
        self.cuboid.map_or_else(|| self.boxes.clone(), |cuboid| vec![placed(cuboid)])
    }

    /// Whether a point is within the mesh, which is closed.
    pub(crate) fn holds(&self, point: DVec3) -> bool {
        let is_near = point.distance(self.centre.as_dvec3()) < f64::from(self.radius_m);
        is_near && topology::winding(&self.positions, &self.triangles, point).abs() > 0.5
    }

    /// Signed volume in cubic metres, positive for a closed mesh wound outwards; of no meaning for an open one.
    pub fn volume_m3(&self) -> f64 {
        topology::volume_m3(&self.positions, &self.triangles, self.centre)
    }

    /// BLAKE3 of all arrays, not of the name: equal meshes share baked fields.
    pub fn content_hash(&self) -> [u8; 32] {
        self.content_hash
    }
}

/// Refuses arrays of wrong length, indices out of range and numbers that are not finite or too large.
fn check_numbers(positions: &[Vec3], normals: &[Vec3], attributes: &Attributes, triangles: &[[u32; 3]]) -> Result<()> {
    let Attributes { colors, uvs, tints } = attributes;
    let fail = |message: String| Err(Error::Input(message));
    if triangles.is_empty() {
        return fail("no faces".into());
    }
    if triangles.len() > TRIANGLE_LIMIT {
        return fail(format!("{} triangles are over the limit of {TRIANGLE_LIMIT}", triangles.len()));
    }
    if !normals.is_empty() && normals.len() != positions.len() {
        return fail(format!("{} normals for {} positions", normals.len(), positions.len()));
    }
    let counts = [
        ("colours", colors.as_ref().map(Vec::len)),
        ("texture coordinates", uvs.as_ref().map(Vec::len)),
        ("tints", tints.as_ref().map(Vec::len)),
    ];
    for (of, count) in counts {
        if let Some(count) = count.filter(|count| *count != positions.len()) {
            return fail(format!("{count} {of} for {} positions", positions.len()));
        }
    }
    if let Some(bad) = triangles.iter().flatten().find(|&&i| i as usize >= positions.len()) {
        return fail(format!("index {bad} is out of range: there are {} vertices", positions.len()));
    }
    if let Some(p) = positions.iter().find(|p| !p.is_finite() || p.abs().max_element() > COORDINATE_LIMIT_M) {
        return fail(format!("position {p} is not finite or beyond {COORDINATE_LIMIT_M:e} m"));
    }
    if let Some(n) = normals.iter().find(|n| !n.is_finite()) {
        return fail(format!("normal {n} is not finite"));
    }
    if let Some(c) = colors.iter().flatten().find(|c| !c.is_finite() || c.min_element() < 0.0) {
        return fail(format!("colour {c} is negative or not finite"));
    }
    if let Some(uv) = uvs.iter().flatten().find(|uv| !uv.is_finite()) {
        return fail(format!("texture coordinate {uv} is not finite"));
    }
    if let Some(t) = tints.iter().flatten().find(|t| !(t.min_element() >= 0.0 && t.max_element() <= 1.0)) {
        return fail(format!("tint {t} is not within 0 to 1"));
    }
    Ok(())
}

/// Drops triangles with two equal corners and renumbers vertices by first use: (old index of every new vertex,
/// triangles).
fn compact(positions: &[Vec3], triangles: &[[u32; 3]]) -> (Vec<u32>, Vec<[u32; 3]>) {
    let mut new_index = vec![u32::MAX; positions.len()];
    let mut used = Vec::new();
    let kept = triangles
        .iter()
        .filter(|t| {
            let [a, b, c] = t.map(|i| positions[i as usize]);
            a != b && b != c && c != a
        })
        .map(|t| {
            t.map(|old| {
                let new = &mut new_index[old as usize];
                if *new == u32::MAX {
                    *new = used.len() as u32;
                    used.push(old);
                }
                *new
            })
        })
        .collect();
    (used, kept)
}

/// Unit normals: the given ones normalised; where there is none, the angle-weighted mean of the triangles around the
/// vertex (Thuermer and Wuethrich 1998), which does not depend on how a face is cut; +y where even that vanishes.
fn complete_normals(positions: &[Vec3], triangles: &[[u32; 3]], given: &[Vec3]) -> Vec<Vec3> {
    let mut sums = vec![DVec3::ZERO; positions.len()];
    if given.is_empty() || given.iter().any(|n| n.as_dvec3().try_normalize().is_none()) {
        for t in triangles {
            let p = t.map(|i| positions[i as usize].as_dvec3());
            let Some(face) = (p[1] - p[0]).cross(p[2] - p[0]).try_normalize() else { continue };
            for k in 0..3 {
                sums[t[k] as usize] += face * (p[(k + 1) % 3] - p[k]).angle_between(p[(k + 2) % 3] - p[k]);
            }
        }
    }
    let unit = |i: usize| {
        let file = given
            .get(i)
            .and_then(|n| if is_unit(*n) { Some(*n) } else { n.as_dvec3().try_normalize().map(|n| n.as_vec3()) });
        file.or_else(|| sums[i].try_normalize().map(|n| n.as_vec3())).unwrap_or(Vec3::Y)
    };
    (0..positions.len()).map(unit).collect()
}

/// Whether a normal has unit length up to f32 rounding; such a normal is kept to the bit, so that files read back
/// unchanged.
fn is_unit(normal: Vec3) -> bool {
    (normal.as_dvec3().length_squared() - 1.0).abs() < 5e-7
}

pub(crate) fn area_m2(positions: &[Vec3], triangles: &[[u32; 3]]) -> f64 {
    triangles.iter().map(|triangle| 0.5 * twice_area_m2(positions, triangle).length()).sum()
}

/// Twice the area of a triangle, along its normal.
pub(crate) fn twice_area_m2(positions: &[Vec3], triangle: &[u32; 3]) -> DVec3 {
    let [a, b, c] = triangle.map(|v| positions[v as usize].as_dvec3());
    (b - a).cross(c - a)
}

fn hash(positions: &[Vec3], normals: &[Vec3], attributes: &Attributes, triangles: &[[u32; 3]]) -> [u8; 32] {
    let Attributes { colors, uvs, tints } = attributes;
    let mut hasher = blake3::Hasher::new();
    for count in [positions.len(), colors.as_ref().map_or(0, Vec::len), triangles.len()] {
        hasher.update(&(count as u64).to_le_bytes());
    }
    // Host byte order: every platform that this crate builds for is little endian.
    hasher.update(bytemuck::cast_slice(positions)).update(bytemuck::cast_slice(normals));
    hasher.update(bytemuck::cast_slice(colors.as_deref().unwrap_or_default())).update(bytemuck::cast_slice(triangles));
    if let Some(uvs) = uvs {
        hasher.update(b"uvs").update(bytemuck::cast_slice(uvs));
    }
    if let Some(tints) = tints {
        hasher.update(b"tints").update(bytemuck::cast_slice(tints));
    }
    *hasher.finalize().as_bytes()
}
