//! A round light cut into smaller ones, so that several occluders and wide lights come out right.
//!
//! One straight edge before a disc is exact only where the occluder's outline is straight over the whole light, and two occluders
//! multiply only where each blocks its share of every part alike. Both get better as the parts get smaller. Parts come in blocks of
//! four at the corners of a square around the block's middle, so that every block keeps its centre of mass. For one straight edge four
//! such parts are as good as a middle and a ring of six (0.012 of the light in the root mean square, against 0.013). A wide light is
//! four blocks, each a light of half its radius at a corner of the same square (0.011). Where the horizon cuts a light, so it cuts
//! each part.

use glam::{DVec2, DVec3};
use std::f64::consts::PI;

/// Largest sine of a light's angular radius.
pub const MOST_SINE: f64 = 0.9999;
/// Parts of a block.
pub const BLOCK: usize = 4;
/// Sine of the angular radius up to which a light is one block: 12 degrees. Larger lights are four.
pub const LIMIT_SINE: f64 = 0.207_911_690_817_759_34;
/// A light whose sine lies this much above the limit has four blocks alone; between, one block and four by shares.
pub const BLEND: f64 = 1.25;
/// Distance of the corners of a square from its middle, on a disc of radius 1: with the square of a part's own radius over 2, four
/// parts have the disc's mean square.
pub const CORNER: f64 = 0.612_372_435_695_794_5;

/// Corners of a square on a disc of radius 1.
pub const CORNERS: [DVec2; BLOCK] =
    [DVec2::new(CORNER, 0.0), DVec2::new(0.0, CORNER), DVec2::new(-CORNER, 0.0), DVec2::new(0.0, -CORNER)];

/// Four parts of equal area.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Block {
    /// Its middle on a disc of radius 1.
    pub middle: DVec2,
    /// Its radius on that disc; that of its parts is half of it.
    pub radius: f64,
    /// Share of the light in each part.
    pub weight: f64,
}

impl Block {
    /// Places of its parts on the disc.
    pub fn places(&self) -> [DVec2; BLOCK] {
        CORNERS.map(|corner| self.middle + self.radius * corner)
    }
}

/// Share of the four blocks in a light whose angular radius has that sine.
pub fn fine_share(sine: f64) -> f64 {
    ((sine / LIMIT_SINE - 1.0) / (BLEND - 1.0)).clamp(0.0, 1.0)
}

/// A direction that the squares of parts are turned by: at right angles to it and to the light stands their first axis. Only lights in
/// this very direction or opposite to it have neighbours whose squares turn fast.
pub const TURNED_BY: [f64; 3] = [0.36, -0.48, 0.8];

/// A round light as seen from a point.
#[derive(Clone, Copy, Debug)]
pub struct SeenLight {
    /// Unit direction of its centre.
    pub toward: DVec3,
    /// Distance of its centre; infinite for distant light.
    pub distance: f64,
    /// Sine of its angular radius, below 1.
    pub sine: f64,
    /// Share of the four blocks.
    pub fine: f64,
}

/// A part of a light: a small round light.
#[derive(Clone, Copy, Debug)]
pub struct Part {
    /// Unit direction of its middle.
    pub toward: DVec3,
    /// Cosine of the angle between that and the middle of the whole light.
    pub tilt: f64,
    /// Distance of the light's surface in that direction.
    pub distance: f64,
    /// Sine of its angular radius.
    pub sine: f64,
    /// Its share of the light.
    pub weight: f64,
}

impl SeenLight {
    /// The light with centre at `to` from the point and that radius. From within, it fills half of the view.
    pub fn new(to: DVec3, radius: f64) -> Self {
        let distance = to.length();
        let sine = (radius / distance.max(f64::MIN_POSITIVE)).min(MOST_SINE);
        SeenLight { toward: to.normalize_or(DVec3::Y), distance, sine, fine: fine_share(sine) }
    }

    /// The light with an outline of its own, which is always four blocks: four parts err by 0.07 of the light of a torus and by 0.10 of
    /// a teapot's, sixteen by 0.02 and 0.04.
    pub fn outlined(to: DVec3, radius: f64) -> Self {
        SeenLight { fine: 1.0, ..Self::new(to, radius) }
    }

    /// Its parts, block by block, and the direction of each block's middle.
    pub fn blocks(&self) -> Vec<(DVec3, [Part; BLOCK])> {
        let across = self.toward.cross(DVec3::from_array(TURNED_BY)).normalize_or(self.toward.any_orthonormal_vector());
        let down = self.toward.cross(across);
        let tilt = |place: DVec2| (1.0 - self.sine * self.sine * place.length_squared()).sqrt();
        let toward = |p: DVec2| tilt(p) * self.toward + self.sine * (p.x * across + p.y * down);
        let part = |block: &Block, place: DVec2| Part {
            toward: toward(place),
            tilt: tilt(place),
            distance: self.distance * (tilt(place) - self.sine * (1.0 - place.length_squared()).sqrt()),
            sine: self.sine * block.radius / 2.0,
            weight: block.weight,
        };
        let block = |block: Block| (toward(block.middle), block.places().map(|place| part(&block, place)));
        blocks(self.fine).into_iter().map(block).collect()
    }

    /// Irradiance of an unoccluded light of radiance 1: its parts' [`Part::cosine`] add up to this.
    pub fn irradiance(&self, normal: DVec3) -> f64 {
        self.blocks().iter().flat_map(|(_, parts)| parts).map(|part| self.share(part, normal)).sum()
    }

    /// Irradiance of one part of a light of radiance 1. On a disc at right angles to the light's middle a direction has the
    /// density 1 / tilt, so that the parts of a light above the horizon add up to exactly pi sin^2 n.w.
    pub fn share(&self, part: &Part, normal: DVec3) -> f64 {
        PI * self.sine * self.sine * part.weight * part.cosine(normal) / part.tilt
    }
}

impl Part {
    /// Mean over the part of the cosine to the normal, zero below the horizon; (c + s)^2 / 4 s where the horizon cuts the part, which
    /// meets the cosine at both ends.
    pub fn cosine(&self, normal: DVec3) -> f64 {
        let cosine = normal.dot(self.toward);
        let cut = (cosine + self.sine).clamp(0.0, 2.0 * self.sine);
        cut * cut / (4.0 * self.sine).max(f64::MIN_POSITIVE) + (cosine - self.sine).max(0.0)
    }

    /// Tangent of its angular radius.
    pub fn tangent(&self) -> f64 {
        self.sine / (1.0 - self.sine * self.sine).sqrt()
    }
}

/// The blocks of a light of which four blocks have that share; their parts' weights add up to 1. While one number of parts fades into the
/// other there are blocks of both, so that nothing jumps as a light comes nearer.
pub fn blocks(fine: f64) -> Vec<Block> {
    let whole = Block { middle: DVec2::ZERO, radius: 1.0, weight: (1.0 - fine) / 4.0 };
    let quarters = CORNERS.map(|middle| Block { middle, radius: 0.5, weight: fine / 16.0 });
    std::iter::once(whole).chain(quarters).filter(|block| block.weight > 0.0).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_lie_on_the_disc_around_its_middle() {
        for (blocks, count) in [(blocks(0.0), 4), (blocks(1.0), 16)] {
            let places: Vec<DVec2> = blocks.iter().flat_map(Block::places).collect();
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
            let blocks = blocks(fine_share(f64::from(i) * 1e-4));
            let of = |radius: f64| blocks.iter().filter(|b| b.radius == radius).map(|b| 4.0 * b.weight).sum::<f64>();
            let now = [of(1.0), of(0.5)];
            assert!((now[0] + now[1] - 1.0).abs() < 1e-12);
            assert!(i == 0 || (now[0] - before[0]).abs() < 2.1e-3, "at sine {}", f64::from(i) * 1e-4);
            before = now;
        }
    }
}
