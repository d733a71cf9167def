//! Where a field is sampled around its object, and which samples a receiver interpolates.
//!
//! Distances are in units of the bounding-sphere radius r, and directions are in the object's frame. Both are taken in
//! the space that [`Fit`] makes of that frame. A lattice is a product of shells (radii) and directions. Interpolation
//! runs over a *stored* arrangement in which the first and last samples of every row of a cube's face lie on the face's
//! edges, so that faces meet without a jump.
//!
//! A cell of that arrangement is cut into six tetrahedra about a diagonal (Kuhn 1960), and a lookup interpolates the
//! corners of the one that it falls into: four samples, where interpolation along all three axes takes eight. It costs
//! 6 % of the sampling's error. Diagonals alternate from cell to cell, so that cells that touch are cut alike.

use super::Fit;
pub use super::directions::{CELL_WARP, unwarp, warp};
use crate::error::{Error, Result};
use crate::layout::FIT_BITS;
use glam::DVec3;
use std::f64::consts::FRAC_PI_2;

/// Most samples that a lattice may have. A field of 4 000 000 samples takes about 256 MB with 4 bands in f32.
pub const MAX_SAMPLES: u64 = 4_000_000;

/// Cosine of the half-angle under which the bounding sphere is seen from distance `d` (in r): sqrt(1 - 1/d^2) outside,
/// continued inside as -sqrt(1 - d^2), so that it runs from -1 at the centre through 0 on the sphere to 1 far away.
pub fn cap_cosine(d: f64) -> f64 {
    if d >= 1.0 { (1.0 - d.powi(-2)).sqrt() } else { -(1.0 - d * d).sqrt() }
}

/// 1 - c(d), which is proportional to the solid angle of the bounding sphere. The formula does not cancel far away.
///
/// The blocked part of a sphere has the zonal coefficients of a cap: sqrt(pi) (1 - c) in band 0, and sqrt(pi / (2l +
/// 1)) (P_l-1(c) - P_l+1(c)) in band l, with Legendre polynomials P. The bracket has degree l + 1 and is 0 at c = 1, so
/// band l divided by 1 - c is a polynomial of degree l in c. Such a polynomial interpolates well.
pub fn cap_height(d: f64) -> f64 {
    let c = cap_cosine(d);
    if d >= 1.0 { d.powi(-2) / (1.0 + c) } else { 1.0 - c }
}

/// Sample points and the rule by which they are interpolated.
///
/// Shells have equal steps of q = sin(theta / 2), where theta is the half-angle under which the bounding sphere is seen:
/// cos theta = c(d) of [`cap_cosine`], taken at [`Lattice::reach`]. The steps of half-angle are nearly equal, and shells
/// are dense around d = 1, where the blocked part varies fastest. b / (1 - c) is stored and interpolated.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Lattice {
    pub shells: u32,
    /// Radius of the innermost shell, in r.
    pub inner: f64,
    /// Radius of the outermost shell, in r. Beyond it the field falls off as (outer/d)^2.
    pub outer: f64,
    /// Samples along an edge of a cube's face, less those on the face's edges. It is odd: then diagonals meet where two
    /// faces do.
    pub cells: u32,
    /// Where the lattice lies around the object. `None` leaves that to the bake and counts as round until then.
    pub fit: Option<Fit>,
    /// Whether the samples of a cube's faces reach their edges. If so, each row of a face has cells + 2 samples, and
    /// the first and last lie on edges and are shared with the neighbours. If not, each row has `cells` samples at the
    /// cells' centres, between copies of the neighbours' samples. Both take the same bytes; the first has finer steps.
    /// `None` leaves that to the bake and counts as centres until then.
    pub edges: Option<bool>,
}

impl Default for Lattice {
    /// 20 shells to 8 r in equal steps of sin(half-angle / 2), 6 x 7 x 7 cells of directions, and b / (1 - c) is
    /// interpolated. The object's shape decides the fit, the first shell, and whether samples lie on the faces' edges.
    fn default() -> Self {
        Lattice { shells: 20, inner: AUTOMATIC, outer: 8.0, cells: 7, fit: None, edges: None }
    }
}

/// Value of [`Lattice::inner`] that leaves the choice to the bake (see [`Lattice::fitted`]).
pub const AUTOMATIC: f64 = 0.0;
/// First shell of an object that fills its bounding sphere. It lies just off the surface, so that no sample grazes it.
pub const OUTSIDE_INNER: f64 = 1.02;
/// Smallest first shell, for objects with room up to the centre of their sphere.
pub const ROOMY_INNER: f64 = 0.25;

/// Stored samples to interpolate, with weights that are at least 0 and sum to 1.
#[derive(Clone, Copy, Debug)]
pub struct Corners {
    pub index: [u32; 4],
    pub weight: [f64; 4],
}

impl Corners {
    /// The corners of the tetrahedron around a place in a block of samples whose first has the number `first`: along each
    /// axis the coordinate, how many cells there are, and how far apart the numbers of neighbours are.
    pub fn new(mut first: u32, axes: [(f64, u32, u32); 3]) -> Self {
        let mut steps = axes.map(|(at, cells, stride)| {
            let low = (at.floor() as u32).min(cells - 1);
            let within = at - f64::from(low);
            // Counted from the sample of even number.
            first += (low + low % 2) * stride;
            let stride = i64::from(stride);
            if low.is_multiple_of(2) { (within, stride) } else { (1.0 - within, -stride) }
        });
        steps.sort_by(|(a, _), (b, _)| b.total_cmp(a));
        let [(most, by_most), (middle, by_middle), (least, by_least)] = steps;
        let second = i64::from(first) + by_most;
        let third = second + by_middle;
        Corners {
            index: [first, second as u32, third as u32, (third + by_least) as u32],
            weight: [1.0 - most, most - middle, middle - least, least],
        }
    }
}

/// Inverse of [`Lattice::coordinate`], as [`Lattice::reach`] has distances.
fn chord_distance(coordinate: f64) -> f64 {
    let half_angle = 2.0 * coordinate.clamp(0.0, 1.0).asin();
    if half_angle <= FRAC_PI_2 { 1.0 / half_angle.sin() } else { half_angle.sin() }
}

impl Lattice {
    /// Shell coordinate t in [0, shells - 1] is `slope * self.coordinate(d) + offset`, clamped.
    pub fn radial_map(&self) -> (f64, f64) {
        if self.shells == 1 {
            return (0.0, 0.0);
        }
        let from = self.coordinate(self.inner);
        let to = self.coordinate(self.outer);
        let slope = f64::from(self.shells - 1) / (to - from);
        (slope, -slope * from)
    }

    /// Radius of a shell in r; the first is `inner`, the last `outer`.
    pub fn shell(&self, index: u32) -> f64 {
        if self.shells == 1 {
            return self.inner;
        }
        let (slope, offset) = self.radial_map();
        let distance = chord_distance((f64::from(index) - offset) / slope);
        (distance * distance - self.room()).max(0.0).sqrt()
    }

    /// Added to squared distances before [`cap_cosine`] is taken: 1 - inner^2, or 0 where the first shell lies
    /// outside the sphere. It makes the cosine 0 on the first shell of an object with room in its sphere. The cosine
    /// itself has a kink at d = 1, where the field of such an object has none.
    fn room(&self) -> f64 {
        (1.0 - self.inner * self.inner).max(0.0)
    }

    /// The distance whose [`cap_height`] stands for a distance of at least `inner`.
    pub fn reach(&self, d: f64) -> f64 {
        (d * d + self.room()).sqrt()
    }

    /// Coordinate in which shells are equally spaced, of a distance of at least `inner`; it grows inwards.
    pub fn coordinate(&self, d: f64) -> f64 {
        (cap_height(self.reach(d)) / 2.0).sqrt()
    }

    /// This lattice around an object. A fit and a first shell that were chosen before stay. Otherwise the lattice takes
    /// the given fit, and the first shell that `first` finds for the fit in force. A lattice with a first shell but no
    /// fit is round.
    pub fn fitted(mut self, fit: Fit, first: impl FnOnce(&Fit) -> f64) -> Self {
        let fit = *self.fit.get_or_insert(if self.inner == AUTOMATIC { fit } else { Fit::ROUND });
        if self.inner == AUTOMATIC {
            self.inner = first(&fit);
        }
        self
    }

    pub fn fit(&self) -> Fit {
        self.fit.unwrap_or(Fit::ROUND)
    }

    /// The lattice as a shader reads it: [`Fit::packed`], where the bit above the factors says whether samples lie on
    /// edges.
    pub fn packed(&self) -> [f32; 4] {
        let [x, y, z, factors] = self.fit().packed();
        [x, y, z, factors + if self.has_edges() { (1_u32 << FIT_BITS) as f32 } else { 0.0 }]
    }

    /// Distance of a place (object's frame, in r) from the shells' centre, in the lattice's space. All distances of
    /// this module are of this kind.
    pub fn distance(&self, position: DVec3) -> f64 {
        self.fit().apply(position).length()
    }

    /// Factor by which the blocked part captured at distance d is multiplied before it is stored.
    pub fn scale(&self, d: f64) -> f64 {
        1.0 / cap_height(self.reach(d))
    }

    /// Factor by which an interpolated value is multiplied at distance d to give the blocked part. Inside the first
    /// shell the first shell holds, beyond the last the value falls off as (outer / d)^2.
    pub fn unscale(&self, d: f64) -> f64 {
        let near = d.clamp(self.inner, self.outer);
        cap_height(self.reach(near)) * (self.outer / d.max(self.outer)).powi(2)
    }

    pub fn sample_count(&self) -> u32 {
        self.shells * self.direction_count()
    }

    pub fn stored_count(&self) -> u32 {
        self.shells * self.stored_direction_count()
    }

    /// Position of the `index`-th captured sample, in r from the sphere's centre, object's frame; shells come one after
    /// another, innermost first.
    pub fn position(&self, index: u32) -> DVec3 {
        let at = self.shell(index / self.direction_count()) * self.direction(index % self.direction_count());
        self.fit().invert(at)
    }

    /// Stored samples around a receiver at `position` (in r, object's frame). The weights are at least 0 and sum to 1.
    /// A receiver at the very centre takes direction +x.
    pub fn corners(&self, position: DVec3) -> Corners {
        let within = self.fit().apply(position);
        let d = within.length();
        let direction = if d > 0.0 { within / d } else { DVec3::X };
        let (slope, offset) = self.radial_map();
        let last = f64::from(self.shells - 1);
        let t = (slope * self.coordinate(d.max(self.inner)) + offset).clamp(0.0, last);
        let (face, [x, y]) = self.place(direction);
        let columns = self.cells + 2;
        // The shell beyond the only one weighs nothing.
        let shell_stride = if self.shells > 1 { self.stored_direction_count() } else { 0 };
        let axes = [(x, columns - 1, 1), (y, columns - 1, columns), (t, (self.shells - 1).max(1), shell_stride)];
        Corners::new(face * columns * columns, axes)
    }

    /// Checks counts and radii, and that what is stored goes with the spacing.
    pub fn validate(&self) -> Result<()> {
        let bad = |what: String| Err(Error::Input(format!("lattice {self}: {what}")));
        let cells = u64::from(self.cells);
        if cells.is_multiple_of(2) {
            return bad("the number of cells must be odd".into());
        }
        let columns = if self.has_edges() { cells + 2 } else { cells };
        let directions = columns.pow(2).saturating_mul(6);
        let samples = u64::from(self.shells).saturating_mul(directions);
        if samples == 0 {
            return bad("every count is at least 1".into());
        }
        if samples > MAX_SAMPLES || self.shells > 4096 || directions > MAX_SAMPLES {
            return bad(format!("{samples} samples, at most {MAX_SAMPLES} are allowed"));
        }
        // The bake chooses none nearer.
        let inner = if self.inner == AUTOMATIC { ROOMY_INNER } else { self.inner };
        let radii = inner.is_finite() && self.outer.is_finite() && inner >= 0.0 && self.outer > inner;
        if !radii || self.outer > 1e4 {
            return bad(format!("shells from {inner} to {} r", self.outer));
        }
        if !self.fit().is_usable() {
            return bad("its centre or stretch is out of range".into());
        }
        Ok(())
    }
}

impl std::fmt::Display for Lattice {
    /// Writes the text that parsing accepts, and the fit to an object, which a bake chooses.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "cube:{}x{}", self.shells, self.cells)?;
        if self.inner != AUTOMATIC {
            write!(f, ",inner={}", self.inner)?;
        }
        write!(f, ",outer={}", self.outer)?;
        match self.edges {
            Some(true) => write!(f, ",edges")?,
            Some(false) => {}
            None => write!(f, ",edges=auto")?,
        }
        let words = |of: [f64; 3]| of.map(|x| x.to_string()).join(":");
        match self.fit {
            Some(fit) => write!(f, ",centre={},stretch={}", words(fit.centre), words(fit.stretch)),
            None => Ok(()),
        }
    }
}

impl std::str::FromStr for Lattice {
    type Err = String;

    /// `cube:SHELLSxCELLS`, then any of `,inner=R` `,outer=R` `,edges` `,edges=auto`.
    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let explain = || {
            format!(
                "cannot read lattice \"{text}\": expected cube:20x7, then any of ,inner=R ,outer=R ,edges ,edges=auto"
            )
        };
        let mut words = text.split(',');
        let counts = words.next().and_then(|word| word.strip_prefix("cube:")).and_then(|counts| counts.split_once('x'));
        let count = |text: &str| text.parse::<u32>().map_err(|_| explain());
        let (shells, cells) = counts.ok_or_else(explain)?;
        let mut lattice =
            Lattice { shells: count(shells)?, cells: count(cells)?, edges: Some(false), ..Lattice::default() };
        for word in words {
            match word.split_once('=') {
                Some(("edges", "auto")) => lattice.edges = None,
                Some(("inner", radius)) => lattice.inner = radius.parse().map_err(|_| explain())?,
                Some(("outer", radius)) => lattice.outer = radius.parse().map_err(|_| explain())?,
                None if word == "edges" => lattice.edges = Some(true),
                _ => return Err(explain()),
            }
        }
        lattice.validate().map_err(|error| error.to_string())?;
        Ok(lattice)
    }
}
