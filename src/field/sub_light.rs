//! A ball, a panel or a tube of light cut into small round lights, so that several occluders and wide lights come out
//! right.
//!
//! One straight edge before a disc is exact only where the occluder's outline is straight over the whole light, and two
//! occluders multiply only where each blocks its share of every part alike. Both get better as the parts get smaller.
//! Parts come in blocks of four at the corners of a square around the block's middle, so that every block keeps its
//! centre of mass. For one straight edge four such parts are as good as a middle and a ring of six: 0.012 of the light
//! in the root mean square. A wide light is four blocks, each a light of half its radius at a corner of the same
//! square. Where the horizon cuts a light, so it cuts each part. Parts of a panel lie on its own face ([`Pattern`]),
//! and each is a round light of its part's solid angle.

use super::silhouette;
use glam::{DQuat, DVec2, DVec3};
use std::f64::consts::PI;

pub const MOST_SINE: f64 = 0.9999;
pub const BLOCK: usize = 4;
/// Sine of the angular radius up to which a light is one block: 12 degrees. Larger lights are four.
pub const LIMIT_SINE: f64 = 0.207_911_690_817_759_34;
/// The same of a light with an outline of its own: 4 degrees.
pub const LIMIT_OUTLINE: f64 = 0.07;
/// A light whose sine lies this much above the limit has four blocks alone; between, one block and four by shares.
pub const BLEND: f64 = 1.25;
/// Distance of the corners of a square from its middle, on a disc of radius 1: with the square of a part's own radius
/// over 2, four parts have the disc's mean square.
pub const CORNER: f64 = 0.612_372_435_695_794_5;

/// Steps to a light nearer than which pixels evaluate it. Between two vertices that see it at that distance its light is
/// off their mean by 6 %.
pub const NEAR_LIGHT_STEPS: f64 = 2.2;

/// Edges that differ by more than this factor make a rectangle a strip, whose parts lie in one row.
pub const STRIP: f64 = 2.5;
/// An edge over the other beyond which a rectangle sends what its parts send: in f32 the edges of a thin one leave little
/// of the closed form.
pub const THIN: f64 = 64.0;

/// The face that shines, in the mesh's own frame: around the origin, at right angles to +y.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LampFace {
    /// A disc of this share of its bounding sphere's disc.
    Disc(f64),
    /// A rectangle, and its edge along z over that along x.
    Rectangle(f64),
    /// A rectangle that shines from both sides.
    Sheet(f64),
    /// A body that is long: the rectangle about its axis that faces whoever sees it.
    Tube {
        /// Which of the mesh's axes it lies along, 0 to 2.
        axis: usize,
        /// Half its width over its length, at most [`TUBE`].
        radius: f64,
        /// 1 for a round one. Of a slat its thickness over its width, negative where it is wide along the second axis after
        /// its own and not along the next.
        thin: f64,
    },
}

/// Radius over length up to which a body is a tube: its ends have an eighth of its surface.
pub const TUBE: f64 = 0.125;

impl LampFace {
    /// Half the face's extent along x and along z, of a tube along and across it, in bounding radii; of a disc the radius
    /// of a circle of equal area.
    pub fn half(self) -> DVec2 {
        match self {
            LampFace::Disc(share) => DVec2::splat(share.sqrt()),
            LampFace::Rectangle(ratio) | LampFace::Sheet(ratio) => DVec2::new(1.0, ratio) / ratio.hypot(1.0),
            LampFace::Tube { radius, thin, .. } => {
                // So much longer, of a round one by its radius, it covers as much as the tube and its ends do on average
                // over all directions.
                let width = 2.0 * radius;
                let ends = width * thin.abs() / (1.0 + thin.abs());
                let thickness = if thin == 1.0 { 0.0 } else { width * thin };
                DVec2::new(1.0 + ends, width) / (1.0 + width * width + thickness * thickness).sqrt()
            }
        }
    }
}

/// Corners of a square on a disc of radius 1.
pub const CORNERS: [DVec2; BLOCK] =
    [DVec2::new(CORNER, 0.0), DVec2::new(0.0, CORNER), DVec2::new(-CORNER, 0.0), DVec2::new(0.0, -CORNER)];

/// Middles of four parts of a whole, and how much smaller than the whole they are along the way from one to the next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pattern {
    pub places: [DVec2; BLOCK],
    pub scale: f64,
}

impl Pattern {
    /// The pattern of a disc of radius 1.
    pub const DISC: Pattern = Pattern { places: CORNERS, scale: 0.5 };

    /// The pattern of a square with corners at (1, 1) and (-1, -1) that stands for a rectangle with these half edges:
    /// quarters, or four parts in a row along an edge that is more than [`STRIP`] times the other.
    pub fn rectangle(half: DVec2) -> Pattern {
        let row = |axis: DVec2| Pattern { places: [-0.75, -0.25, 0.25, 0.75].map(|x| x * axis), scale: 0.25 };
        if half.x > STRIP * half.y {
            row(DVec2::X)
        } else if half.y > STRIP * half.x {
            row(DVec2::Y)
        } else {
            let half = [-0.5, 0.5];
            Pattern { places: [0, 1, 2, 3].map(|k| DVec2::new(half[k & 1], half[k >> 1])), scale: 0.5 }
        }
    }
}

/// Four parts of equal area.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Block {
    /// Its middle, 0 to 1 from the light's.
    pub middle: DVec2,
    /// Its size, of the light's.
    pub scale: f64,
    /// Share of the light's area in each part.
    pub area: f64,
    /// Weight of this block beside those of another size, 0 to 1.
    pub weight: f64,
}

impl Block {
    pub fn places(&self, pattern: &Pattern) -> [DVec2; BLOCK] {
        pattern.places.map(|place| self.middle + self.scale * place)
    }
}

/// Share of the four blocks in a light whose angular radius has that sine, beside the sine up to which it has none.
pub fn fine_share(sine: f64, limit: f64) -> f64 {
    ((sine / limit - 1.0) / (BLEND - 1.0)).clamp(0.0, 1.0)
}

/// A direction that the squares of parts are turned by: at right angles to it and to the light stands their first axis.
/// Only lights in this very direction or opposite to it have neighbours whose squares turn fast.
pub const TURNED_BY: [f64; 3] = [0.36, -0.48, 0.8];

#[derive(Clone, Copy, Debug)]
pub struct SeenLight {
    /// Unit direction of its centre.
    pub toward: DVec3,
    /// Distance of its centre; infinite for distant light.
    pub distance: f64,
    /// Sine of the angular radius of its bounding sphere, below 1.
    pub sine: f64,
    /// Share of the four blocks.
    pub fine: f64,
    /// The face that shines, of a light that is no ball.
    panel: Option<SeenPanel>,
    /// Corners of the box around it, from its centre, metres, and how that is turned.
    boxed: Option<([DVec3; 2], DQuat)>,
}

/// A face that shines.
#[derive(Clone, Copy, Debug)]
struct SeenPanel {
    /// Unit normal of the side that shines, or that is seen where both do.
    normal: DVec3,
    /// Vectors from the middle to the middle of an edge, metres.
    half: [DVec3; 2],
    /// Square metres.
    area: f64,
    /// Whether it is a rectangle whose closed form holds in f32.
    is_exact: bool,
    pattern: Pattern,
}

/// A part of a light: a small round light.
#[derive(Clone, Copy, Debug)]
pub struct LightPart {
    /// Unit direction of its middle.
    pub toward: DVec3,
    /// Distance of the light's surface in that direction.
    pub distance: f64,
    /// Sine of its angular radius.
    pub sine: f64,
    /// Irradiance that it sends to a surface that faces it, of radiance 1.
    pub weight: f64,
}

impl SeenLight {
    /// The ball with centre at `to` from the point and that radius. From within, it fills half of the view.
    pub fn new(to: DVec3, radius: f64) -> Self {
        let distance = to.length();
        let sine = (radius / distance.max(f64::MIN_POSITIVE)).min(MOST_SINE);
        SeenLight {
            toward: to.normalize_or(DVec3::Y),
            distance,
            sine,
            fine: fine_share(sine, LIMIT_SINE),
            panel: None,
            boxed: None,
        }
    }

    /// The light with an outline of its own, which decides how much of its sixteen parts shines. Four parts err by 0.07 of
    /// the light of a torus and by 0.10 of a teapot's, sixteen by 0.02 and 0.04, without factors ([`super::lamp_colors`]);
    /// so from afar, where it is one block, that is as much as the outline's area ([`super::Area`]).
    pub fn outlined(to: DVec3, radius: f64) -> Self {
        let seen = Self::new(to, radius);
        SeenLight { fine: fine_share(seen.sine, LIMIT_OUTLINE), ..seen }
    }

    /// The same with a box around it, turned by `rotation`: a flat body lies behind most of its bounding sphere.
    pub fn boxed(self, corners: [DVec3; 2], rotation: DQuat) -> Self {
        SeenLight { boxed: Some((corners, rotation)), ..self }
    }

    /// How far its body is in a direction in which its bounding sphere begins there: where the box does, or where a ray
    /// passes that misses it, at the latest where it leaves the sphere. The outline of a lamp under a slab covers parts
    /// whose rays pass between the two.
    fn reach(&self, toward: DVec3, front: f64) -> f64 {
        let Some((corners, rotation)) = self.boxed else { return front };
        let point = rotation.inverse() * (-self.distance * self.toward);
        let [enters, leaves] = silhouette::slabs(corners, point, rotation.inverse() * toward);
        let back = self.distance * (1.0 + self.sine);
        if enters < leaves { enters.max(front) } else { (0.5 * (enters + leaves)).clamp(front, back) }
    }

    /// The face of a panel with that bounding sphere, turned by `rotation`.
    pub fn panel(mut to: DVec3, radius: f64, panel: LampFace, rotation: DQuat) -> Self {
        let mut half = radius * panel.half();
        let is_rectangle = !matches!(panel, LampFace::Disc(_));
        // Along both edges, and off the side that shines.
        let axes = match panel {
            LampFace::Tube { axis, thin, .. } => {
                let along = rotation * DVec3::AXES[axis];
                let mut beside = along.cross(to).normalize_or(along.any_orthonormal_vector());
                if thin != 1.0 {
                    let wide = rotation * DVec3::AXES[(axis + if thin < 0.0 { 2 } else { 1 }) % 3];
                    let flat = along.cross(wide);
                    let sides = half.y * DVec2::new(1.0, thin.abs());
                    let point = -DVec2::new(wide.dot(to), flat.dot(to));
                    let beyond = (along.dot(to).abs() - half.x) / point.length().max(f64::MIN_POSITIVE);
                    let [middle, chord] = slat_chord(sides, point, beyond.clamp(0.0, 1.0));
                    to += middle.x * wide + middle.y * flat;
                    half.y = chord.length();
                    beside = (chord.x * wide + chord.y * flat).normalize_or(wide);
                    beside *= if along.cross(beside).dot(to) > 0.0 { -1.0 } else { 1.0 };
                }
                [along, beside, along.cross(beside)]
            }
            _ => [DVec3::X, DVec3::Z, DVec3::Y].map(|axis| rotation * axis),
        };
        let (area, pattern) = match is_rectangle {
            true => (4.0 * half.x * half.y, Pattern::rectangle(half)),
            false => (PI * half.x * half.y, Pattern::DISC),
        };
        let half = [half.x * axes[0], half.y * axes[1]];
        let front = axes[2];
        let shows_back = matches!(panel, LampFace::Sheet(_)) && front.dot(to) > 0.0;
        let normal = if shows_back { -front } else { front };
        let is_exact =
            is_rectangle && half[0].length() < THIN * half[1].length() && half[1].length() < THIN * half[0].length();
        let seen = SeenPanel { normal, half, area, is_exact, pattern };
        SeenLight { panel: Some(seen), ..Self::new(to, radius) }
    }

    /// Its parts, block by block, and the direction of each block's middle.
    pub fn blocks(&self) -> Vec<(DVec3, [LightPart; BLOCK])> {
        let pattern = self.panel.map_or(Pattern::DISC, |panel| panel.pattern);
        let of = |block: Block| match &self.panel {
            Some(panel) => {
                let part = |place| self.part_of_panel(panel, &block, place);
                (self.place_on(panel, block.middle).normalize_or(self.toward), block.places(&pattern).map(part))
            }
            None => {
                (self.direction(block.middle), block.places(&pattern).map(|place| self.part_of_ball(&block, place)))
            }
        };
        blocks(self.fine, &pattern).into_iter().map(of).collect()
    }

    /// Normal of the side that shines, of a light that is no ball.
    pub fn facing(&self) -> Option<DVec3> {
        self.panel.map(|panel| panel.normal)
    }

    /// Irradiance of an unoccluded light of radiance 1: the sum of its parts, or near a rectangle that is not
    /// thin its closed form.
    pub fn irradiance(&self, normal: DVec3) -> f64 {
        let sum = self.irradiance_by_parts(normal);
        match self.panel.filter(|panel| panel.is_exact && sum > 0.0) {
            Some(SeenPanel { half: [x, z], .. }) => {
                let middle = self.distance * self.toward;
                let corners = [middle - x - z, middle + x - z, middle + x + z, middle - x + z];
                sum + self.fine * (polygon_irradiance(&corners, normal) - sum)
            }
            None => sum,
        }
    }

    fn irradiance_by_parts(&self, normal: DVec3) -> f64 {
        self.blocks().iter().flat_map(|(_, parts)| parts).map(|part| part.share(normal)).sum()
    }

    /// Light where nothing is between, over that of the parts, which are coarse near by.
    pub fn over_parts(&self, normal: DVec3) -> f64 {
        match self.irradiance_by_parts(normal) {
            0.0 => 1.0,
            sum => self.irradiance(normal) / sum,
        }
    }

    /// Cosine of the angle between a ball's middle and a place on its disc.
    fn tilt(&self, place: DVec2) -> f64 {
        (1.0 - self.sine * self.sine * place.length_squared()).sqrt()
    }

    fn direction(&self, place: DVec2) -> DVec3 {
        let across = self.toward.cross(DVec3::from_array(TURNED_BY)).normalize_or(self.toward.any_orthonormal_vector());
        let down = self.toward.cross(across);
        self.tilt(place) * self.toward + self.sine * (place.x * across + place.y * down)
    }

    /// On a disc at right angles to the light's middle a direction has the density 1 / tilt, so that the parts of a
    /// light above the horizon send exactly pi sin^2 n.w.
    fn part_of_ball(&self, block: &Block, place: DVec2) -> LightPart {
        let tilt = self.tilt(place);
        let toward = self.direction(place);
        let front = self.distance * (tilt - self.sine * (1.0 - place.length_squared()).sqrt());
        LightPart {
            toward,
            distance: self.reach(toward, front),
            sine: self.sine * block.area.sqrt(),
            weight: PI * self.sine * self.sine * block.area * block.weight / tilt,
        }
    }

    /// Vector from the point to a place on a panel.
    fn place_on(&self, panel: &SeenPanel, place: DVec2) -> DVec3 {
        self.distance * self.toward + place.x * panel.half[0] + place.y * panel.half[1]
    }

    /// A part of a panel is a round light of the solid angle that a disc of its area has, which is below 2 pi however
    /// near it is.
    fn part_of_panel(&self, panel: &SeenPanel, block: &Block, place: DVec2) -> LightPart {
        let to = self.place_on(panel, place);
        let distance = to.length();
        let toward = to.normalize_or(self.toward);
        let area = panel.area * block.area;
        let whole = area * (-panel.normal.dot(toward)).max(0.0) / (distance * distance + area / PI);
        LightPart { toward, distance, sine: (whole / PI).sqrt().min(MOST_SINE), weight: whole * block.weight }
    }
}

/// The chord of a slat's section, a rectangle with those half sides, that stands for what a point sees of it: between the
/// two corners that are outermost from there. As far as the point lies `beyond` its ends, 0 to 1, it is across the way to
/// the middle and as long as the section is wide from there: then more of those ends is seen. Its middle, and the half of
/// it.
fn slat_chord(sides: DVec2, point: DVec2, beyond: f64) -> [DVec2; 2] {
    let near = sides.copysign(point);
    let is_beside = point.abs().cmpgt(sides);
    let from = DVec2::new(if is_beside.y { -near.x } else { near.x }, near.y);
    let to = DVec2::new(near.x, if is_beside.x { -near.y } else { near.y });
    let chord = 0.5 * (to - from);
    let across = point.normalize_or_zero().perp();
    let across = across * across.abs().dot(sides) * if across.dot(chord) < 0.0 { -1.0 } else { 1.0 };
    [0.5 * (1.0 - beyond) * (from + to), chord.lerp(across, beyond)]
}

/// Irradiance of a surface at the origin by a convex polygon of radiance 1, of which it sees what is above its horizon:
/// the sum over the edges of half of the angle each fills, times the cosine of its plane's normal to the surface's
/// (Lambert, *Photometria*, 1760).
fn polygon_irradiance(corners: &[DVec3], normal: DVec3) -> f64 {
    let edges = corners.iter().zip(corners.iter().cycle().skip(1));
    let mut above: Vec<DVec3> = Vec::with_capacity(corners.len() + 1);
    for (a, b) in edges {
        let [from, to] = [a, b].map(|corner| corner.dot(normal));
        if from > 0.0 {
            above.push(*a);
        }
        if (from > 0.0) != (to > 0.0) {
            above.push(a.lerp(*b, from / (from - to)));
        }
    }
    let edges = above.iter().zip(above.iter().cycle().skip(1));
    edges.map(|(a, b)| a.angle_between(*b) * a.cross(*b).normalize_or_zero().dot(normal)).sum::<f64>().abs() / 2.0
}

impl LightPart {
    /// Irradiance of a surface with that normal, of radiance 1.
    pub fn share(&self, normal: DVec3) -> f64 {
        self.weight * self.cosine(normal)
    }

    /// Mean over the part of the cosine to the normal, zero below the horizon; (c + s)^2 / 4 s where the horizon cuts
    /// the part, which meets the cosine at both ends.
    pub fn cosine(&self, normal: DVec3) -> f64 {
        let cosine = normal.dot(self.toward);
        let cut = (cosine + self.sine).clamp(0.0, 2.0 * self.sine);
        cut * cut / (4.0 * self.sine).max(f64::MIN_POSITIVE) + (cosine - self.sine).max(0.0)
    }

    pub fn tangent(&self) -> f64 {
        self.sine / (1.0 - self.sine * self.sine).sqrt()
    }
}

/// The blocks of a light of which four blocks have that share; areas of their parts times weights add up to 1. While
/// one number of parts fades into the other there are blocks of both, so that nothing jumps as a light comes nearer.
pub fn blocks(fine: f64, pattern: &Pattern) -> Vec<Block> {
    let whole = Block { middle: DVec2::ZERO, scale: 1.0, area: 0.25, weight: 1.0 - fine };
    let quarters = pattern.places.map(|middle| Block { middle, scale: pattern.scale, area: 0.0625, weight: fine });
    std::iter::once(whole).chain(quarters).filter(|block| block.weight > 0.0).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    #[test]
    fn parts_lie_on_the_disc_around_its_middle() {
        for (blocks, count) in [(blocks(0.0, &Pattern::DISC), 4), (blocks(1.0, &Pattern::DISC), 16)] {
            let places: Vec<DVec2> = blocks.iter().flat_map(|block| block.places(&Pattern::DISC)).collect();
            assert_eq!(places.len(), count);
            let mean = places.iter().sum::<DVec2>() / count as f64;
            assert!(mean.length() < 1e-12, "{count}: {mean}");
            // The mean square of a disc is 1/2; a part adds that of its own disc.
            let spread = places.iter().map(|p| p.length_squared()).sum::<f64>() / count as f64 + 0.5 / count as f64;
            assert!((spread - 0.5).abs() < 1e-9, "{count}: {spread}");
        }
    }

    /// Above the horizon the parts add up to the closed form of a sphere; across it they rise steadily from zero.
    #[test]
    fn a_sphere_light_sends_what_the_closed_form_says() {
        for sine in [1e-4_f64, 0.05, 0.22, 0.5, 0.9] {
            let mut before = 0.0;
            for i in 0..=200 {
                let elevation = -1.55 + 3.1 / 200.0 * f64::from(i);
                let light = SeenLight::new(2.0 / sine * DVec3::new(elevation.cos(), elevation.sin(), 0.0), 2.0);
                let found = light.irradiance(DVec3::Y);
                let whole = PI * sine * sine * elevation.sin();
                // Parts are discs that reach a little over the whole's rim.
                if elevation.sin() > 1.2 * sine {
                    assert!((found - whole).abs() < 1e-9 * sine, "{sine} {elevation}: {found} {whole}");
                }
                assert!(found >= before - 1e-12, "{sine} {elevation}");
                before = if elevation < 0.0 { found } else { 0.0 };
            }
        }
    }

    #[test]
    fn weights_add_up_and_change_without_a_step() {
        let mut before = [0.0; 2];
        for i in 0..=10_000 {
            let blocks = blocks(fine_share(f64::from(i) * 1e-4, LIMIT_SINE), &Pattern::DISC);
            let of =
                |scale: f64| blocks.iter().filter(|b| b.scale == scale).map(|b| 4.0 * b.area * b.weight).sum::<f64>();
            let now = [of(1.0), of(0.5)];
            assert!((now[0] + now[1] - 1.0).abs() < 1e-12);
            assert!(i == 0 || (now[0] - before[0]).abs() < 2.1e-3, "at sine {}", f64::from(i) * 1e-4);
            before = now;
        }
    }

    /// Against the sum over the patches of a box ten times as long as wide and five times as wide as thick.
    #[test]
    fn a_slat_sends_what_its_surface_sends() {
        let size = DVec3::new(0.1, 0.02, 1.0);
        let slat = LampFace::Tube { axis: 2, radius: 0.05, thin: 0.2 };
        for (to, normal) in [
            (DVec3::new(0.1, 1.0, 0.1), DVec3::Y),
            (DVec3::new(1.0, 0.1, 0.3), DVec3::X),
            (DVec3::new(0.8, 0.8, 1.5), DVec3::new(0.6, 0.8, 0.0)),
            (DVec3::new(0.0, 0.5, 0.4), DVec3::Y),
            // Close above its wide side, and beside an edge of it.
            (DVec3::new(0.01, 0.03, 0.1), DVec3::Y),
            (DVec3::new(0.06, 0.03, 0.0), DVec3::Y),
            (DVec3::new(0.07, 0.0, 0.2), DVec3::X),
        ] {
            let light = SeenLight::panel(to, 0.5 * size.length(), slat, DQuat::IDENTITY);
            let mut sum = 0.0;
            const STEPS: u32 = 100;
            for (axis, side) in (0..3).flat_map(|axis| [(axis, 0.5), (axis, -0.5)]) {
                let [u, v] = [1, 2].map(|step| (axis + step) % 3);
                for (i, j) in (0..STEPS).flat_map(|i| (0..STEPS).map(move |j| (i, j))) {
                    let share = |k: u32| (f64::from(k) + 0.5) / f64::from(STEPS) - 0.5;
                    let place = side * size * DVec3::AXES[axis]
                        + size * (share(i) * DVec3::AXES[u] + share(j) * DVec3::AXES[v]);
                    let to = to + place;
                    let outward = 2.0 * side * DVec3::AXES[axis];
                    let facing = (-outward.dot(to)).max(0.0) * normal.dot(to).max(0.0);
                    sum += facing * size[u] * size[v] / f64::from(STEPS * STEPS) / to.length_squared().powi(2);
                }
            }
            let found = light.irradiance(normal);
            assert!((found / sum - 1.0).abs() < 0.06, "{to}: {found} of {sum}");
        }
    }

    /// Against the sum over the patches of a cylinder and its two ends.
    #[test]
    fn a_tube_sends_what_its_surface_sends() {
        for (radius, limit) in [(0.125, 0.06), (0.02, 0.02)] {
            let tube = LampFace::Tube { axis: 2, radius, thin: 1.0 };
            for (to, normal) in [
                (DVec3::new(0.3, 1.0, 0.1), DVec3::Y),
                (DVec3::new(0.3, 3.0, 1.5), DVec3::Y),
                (DVec3::new(0.0, 0.5, 0.4), DVec3::new(0.6, 0.8, 0.0)),
            ] {
                let light = SeenLight::panel(to, f64::hypot(0.5, radius), tube, DQuat::IDENTITY);
                let mut sum = 0.0;
                let mut add = |place: DVec3, outward: DVec3, area: f64| {
                    let to = to + place;
                    let facing = (-outward.dot(to)).max(0.0) * normal.dot(to).max(0.0);
                    sum += facing * area / to.length_squared().powi(2);
                };
                for (i, j) in (0..400).flat_map(|i| (0..64).map(move |j| (i, j))) {
                    let (sin, cos) = (TAU * f64::from(j) / 64.0).sin_cos();
                    let outward = DVec3::new(cos, sin, 0.0);
                    let along = (f64::from(i) + 0.5) / 400.0;
                    add(radius * outward + (along - 0.5) * DVec3::Z, outward, TAU * radius / 25_600.0);
                    for end in [DVec3::Z, DVec3::NEG_Z] {
                        let area = PI * radius * radius * 2.0 * along / 25_600.0;
                        add(radius * along * outward + 0.5 * end, end, area);
                    }
                }
                let error = light.irradiance(normal) / sum - 1.0;
                assert!(error.abs() < limit, "{radius} at {to}: {error}");
            }
        }
    }

    #[test]
    fn a_panel_sends_what_the_closed_form_says() {
        for [x, z] in [[0.5, 0.5], [0.4, 0.3], [2.0, 0.05], [0.05, 2.0]] {
            let turned = DQuat::from_rotation_x(3.0);
            for (distance, side, limit) in [(6.0, 0.0, 0.002), (3.0, 1.5, 0.005), (1.5, 0.5, 0.012), (0.8, 0.2, 0.03)] {
                let to = DVec3::new(side, distance, 0.2);
                let panel = LampFace::Rectangle(z / x);
                let light = SeenLight::panel(to, f64::hypot(x, z), panel, turned);
                let corner = |(i, j): (f64, f64)| to + turned * DVec3::new(i * x, 0.0, j * z);
                let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(corner);
                let found = light.irradiance_by_parts(DVec3::Y);
                let exact = polygon_irradiance(&corners, DVec3::Y);
                assert!(
                    (light.irradiance(DVec3::Y) - exact).abs() <= (1.0 - light.fine + 1e-9) * (found - exact).abs()
                );
                let error = found / exact - 1.0;
                assert!(error.abs() < limit, "{x} x {z} at {to}: {found} {exact} {error}");
                let behind = SeenLight::panel(to, f64::hypot(x, z), panel, DQuat::IDENTITY);
                assert_eq!(behind.irradiance(DVec3::Y), 0.0);
                for turned in [turned, DQuat::from_rotation_x(PI) * turned] {
                    let sheet = SeenLight::panel(to, f64::hypot(x, z), LampFace::Sheet(z / x), turned);
                    let other = SeenLight::panel(to, f64::hypot(x, z), panel, turned).irradiance(DVec3::Y);
                    assert!(sheet.irradiance(DVec3::Y) > 0.0 && [0.0, sheet.irradiance(DVec3::Y)].contains(&other));
                }
            }
        }
        // Near by, slanted, and cut by the horizon: against the sum over small patches.
        for (distance, slant) in [(1.5, 0.0), (0.1, 0.0), (0.1, 0.7), (0.4, 1.4), (0.4, -1.9)] {
            let normal = DQuat::from_rotation_z(slant) * DVec3::Y;
            let light = SeenLight::panel(
                DVec3::new(0.3, distance, 0.1),
                f64::hypot(0.4, 0.3),
                LampFace::Sheet(0.75),
                DQuat::IDENTITY,
            );
            let along = |i: i32| (f64::from(i) + 0.5) / 400.0 - 0.5;
            let patch = |(i, j): (i32, i32)| {
                let to = DVec3::new(0.3 + 0.8 * along(i), distance, 0.1 + 0.6 * along(j));
                normal.dot(to).max(0.0) * to.y / to.length_squared().powi(2) * (0.8 * 0.6 / 160_000.0)
            };
            let sum: f64 = (0..160_000).map(|k| patch((k % 400, k / 400))).sum();
            assert!((light.irradiance(normal) / sum - 1.0).abs() < 1e-3, "{distance} {slant}: {light:?} {sum}");
        }
        // A disc that faces the surface on its axis: pi r^2 / (d^2 + r^2).
        for (distance, limit) in [(8.0, 1e-3), (2.0, 5e-3), (0.5, 0.03)] {
            let turned = DQuat::from_rotation_z(PI);
            let light = SeenLight::panel(distance * DVec3::Y, 0.5, LampFace::Disc(1.0), turned);
            let found = light.irradiance(DVec3::Y);
            let exact = PI * 0.25 / (distance * distance + 0.25);
            assert!((found / exact - 1.0).abs() < limit, "{distance}: {found} {exact}");
        }
    }
}
