//! Where a field is sampled around its object, and which samples a receiver interpolates.
//!
//! Distances are in units of the bounding-sphere radius r, directions in the object's frame, both taken in the space that
//! [`Fit`] makes of it. A lattice is a product of shells (radii) and directions. Interpolation runs over a *stored* arrangement in which every cube face carries a border
//! of one cell copied from its neighbours (a corner cell is the mean of the three cells that meet there), so that bilinear
//! interpolation needs no branch and is continuous across face edges: both faces see the same two rows of cells there.

use super::Fit;
use crate::error::{Error, Result};
use crate::sh::cube;
use glam::DVec3;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// Cells of a cube face have (almost) equal angles: cell coordinate u = s (c0 + c1 s^2 + c2 s^4) for s in [-1, 1]. This is
/// (4/pi) atan(s) to 4.3e-3, matched in value at 1 and in slope at 0 and 1; a shader evaluates it with three multiply-adds.
pub const CELL_WARP: [f64; 3] = {
    let (slope_0, slope_1) = (4.0 / PI, 2.0 / PI);
    let c2 = (slope_1 - slope_0 - 3.0 * (1.0 - slope_0)) / 2.0;
    [slope_0, 1.0 - slope_0 - c2, c2]
};

/// Most samples that a lattice may have; refused above (a field of 10^7 samples is some 640 MB).
pub const MAX_SAMPLES: u64 = 4_000_000;

/// How the directions of one shell are arranged.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Directions {
    /// `cells` x `cells` on each of six cube faces.
    Cube {
        /// Cells along a face edge.
        cells: u32,
    },
    /// Rings of equal latitude, equal steps of longitude: what student implementations of the method used.
    LatLon {
        /// Rings; ring i lies at polar angle (i + 1/2) pi / latitudes from +y.
        latitudes: u32,
        /// Points on a ring; point j lies at azimuth 2 pi j / longitudes, counted from +x towards +z.
        longitudes: u32,
    },
}

/// How shells are spaced: the coordinate in which their steps are equal.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Spacing {
    /// q = sin(theta / 2), theta being the half-angle under which the bounding sphere is seen: cos theta = c(d) of
    /// [`cap_cosine`], taken at [`Lattice::reach`]. Nearly equal steps of half-angle, dense around d = 1 where the blocked part varies fastest, and two
    /// square roots in a shader.
    Chord,
    /// ln d.
    Log,
    /// d itself, as in the paper.
    Linear,
}

/// Cosine of the half-angle under which the bounding sphere is seen from distance `d` (in r): sqrt(1 - 1/d^2) outside,
/// continued inside as -sqrt(1 - d^2), so that it runs from -1 at the centre through 0 on the sphere to 1 far away.
pub fn cap_cosine(d: f64) -> f64 {
    if d >= 1.0 { (1.0 - d.powi(-2)).sqrt() } else { -(1.0 - d * d).sqrt() }
}

/// 1 - c(d): in proportion to the solid angle of the bounding sphere, without cancellation far away. A sphere's blocked
/// part divided by it is a polynomial of degree l in c for band l (DESIGN's cap formula), which interpolates well.
pub fn cap_height(d: f64) -> f64 {
    let c = cap_cosine(d);
    if d >= 1.0 { d.powi(-2) / (1.0 + c) } else { 1.0 - c }
}

/// Sample points and the rule by which they are interpolated.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Lattice {
    /// Number of shells, at least 1.
    pub shells: u32,
    /// Radius of the innermost shell, in r.
    pub inner: f64,
    /// Radius of the outermost shell, in r; beyond it the field falls off as (outer/d)^2.
    pub outer: f64,
    /// Spacing of shells.
    pub spacing: Spacing,
    /// Directions of every shell.
    pub directions: Directions,
    /// Whether b / (1 - c) is what is stored and interpolated rather than b itself: [`cap_height`] at [`Lattice::reach`].
    pub scaled: bool,
    /// Where it lies around the object; `None` leaves that to the bake, and is round until then.
    pub fit: Option<Fit>,
}

impl Default for Lattice {
    /// 16 shells to 8 r, equal steps of sin(half-angle / 2), 6 x 8 x 8 directions, b / (1 - c) interpolated; fit and first
    /// shell are chosen by the object's shape.
    fn default() -> Self {
        Lattice {
            shells: 16,
            inner: AUTOMATIC,
            outer: 8.0,
            spacing: Spacing::Chord,
            directions: Directions::Cube { cells: 8 },
            scaled: true,
            fit: None,
        }
    }
}

/// Value of [`Lattice::inner`] that leaves the choice to the bake (see [`Lattice::starting_at`]).
pub const AUTOMATIC: f64 = 0.0;
/// First shell of an object that fills its bounding sphere: just off the surface, so that no sample grazes it.
pub const OUTSIDE_INNER: f64 = 1.02;
/// Smallest first shell: for objects with room up to the centre of their sphere.
pub const ROOMY_INNER: f64 = 0.25;

/// Stored samples to interpolate, with weights that are at least 0 and sum to 1.
#[derive(Clone, Copy, Debug)]
pub struct Corners {
    /// Stored indices.
    pub index: [u32; 8],
    /// Weights.
    pub weight: [f64; 8],
}

/// Which samples a lookup takes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Lookup {
    /// The one nearest sample.
    Nearest,
    /// The nearest direction, linear between two shells.
    Radial,
    /// Bilinear in direction, linear between shells.
    #[default]
    Trilinear,
}

impl std::str::FromStr for Lookup {
    type Err = String;
    fn from_str(word: &str) -> std::result::Result<Self, String> {
        match word {
            "nearest" => Ok(Lookup::Nearest),
            "radial" => Ok(Lookup::Radial),
            "trilinear" => Ok(Lookup::Trilinear),
            _ => Err(format!("unknown lookup \"{word}\" (nearest, radial or trilinear)")),
        }
    }
}

/// Cell coordinate in [-1, 1] of face coordinate s in [-1, 1].
pub fn warp(s: f64) -> f64 {
    let q = s * s;
    s * (CELL_WARP[0] + q * (CELL_WARP[1] + q * CELL_WARP[2]))
}

/// Inverse of [`warp`], by Newton's method from the arctangent it stands for.
pub fn unwarp(u: f64) -> f64 {
    let mut s = (u * PI / 4.0).tan();
    for _ in 0..8 {
        let q = s * s;
        let slope = CELL_WARP[0] + q * (3.0 * CELL_WARP[1] + q * 5.0 * CELL_WARP[2]);
        s -= (warp(s) - u) / slope;
    }
    s
}

impl Spacing {
    /// Coordinate in which shells are equally spaced; `Chord` grows inwards.
    pub fn coordinate(self, d: f64) -> f64 {
        match self {
            Spacing::Chord => (cap_height(d) / 2.0).sqrt(),
            Spacing::Log => d.max(1e-30).ln(),
            Spacing::Linear => d,
        }
    }

    fn distance(self, coordinate: f64) -> f64 {
        match self {
            Spacing::Chord => {
                let half_angle = 2.0 * coordinate.clamp(0.0, 1.0).asin();
                if half_angle <= FRAC_PI_2 { 1.0 / half_angle.sin() } else { half_angle.sin() }
            }
            Spacing::Log => coordinate.exp(),
            Spacing::Linear => coordinate,
        }
    }
}

impl Lattice {
    /// Shell coordinate t in [0, shells - 1] is `slope * self.coordinate(d) + offset`, clamped.
    pub fn radial_map(&self) -> (f64, f64) {
        if self.shells == 1 {
            return (0.0, 0.0);
        }
        let (from, to) = (self.coordinate(self.inner), self.coordinate(self.outer));
        let slope = f64::from(self.shells - 1) / (to - from);
        (slope, -slope * from)
    }

    /// Radius of a shell in r; the first is `inner`, the last `outer`.
    pub fn shell(&self, index: u32) -> f64 {
        if self.shells == 1 {
            return self.inner;
        }
        let (slope, offset) = self.radial_map();
        let distance = self.spacing.distance((f64::from(index) - offset) / slope);
        match self.spacing {
            Spacing::Chord => (distance * distance - self.room()).max(0.0).sqrt(),
            Spacing::Log | Spacing::Linear => distance,
        }
    }

    /// What is added to squared distances before [`cap_cosine`] is taken, so that it is 0 on the first shell of an object with
    /// room in its sphere: 1 - inner^2, or 0 where the first shell lies outside the sphere. The cosine proper has a kink at
    /// d = 1, where nothing happens to such an object.
    fn room(&self) -> f64 {
        (1.0 - self.inner * self.inner).max(0.0)
    }

    /// The distance whose [`cap_height`] stands for a distance of at least `inner`.
    pub fn reach(&self, d: f64) -> f64 {
        (d * d + self.room()).sqrt()
    }

    /// Coordinate in which shells are equally spaced, of a distance of at least `inner`.
    pub fn coordinate(&self, d: f64) -> f64 {
        self.spacing.coordinate(if self.spacing == Spacing::Chord { self.reach(d) } else { d })
    }

    /// This lattice with its first shell at `inner` (in r), unless it was chosen before.
    pub fn starting_at(mut self, inner: f64) -> Self {
        if self.inner == AUTOMATIC {
            self.inner = inner;
        }
        self
    }

    /// This lattice around an object, unless that was chosen before: the given fit (with a first shell of its own it is round), and
    /// the first shell that `first` finds for the fit in force.
    pub fn fitted(mut self, fit: Fit, first: impl FnOnce(&Fit) -> f64) -> Self {
        let fit = *self.fit.get_or_insert(if self.inner == AUTOMATIC { fit } else { Fit::ROUND });
        if self.inner == AUTOMATIC {
            self.inner = first(&fit);
        }
        self
    }

    /// Where it lies around the object.
    pub fn fit(&self) -> Fit {
        self.fit.unwrap_or(Fit::ROUND)
    }

    /// Distance of a place (object's frame, in r) from the shells' centre in the lattice's space: what all that is said of
    /// distances here is about.
    pub fn distance(&self, position: DVec3) -> f64 {
        self.fit().apply(position).length()
    }

    /// Factor by which the blocked part captured at distance d is multiplied before it is stored.
    pub fn scale(&self, d: f64) -> f64 {
        if self.scaled { 1.0 / cap_height(self.reach(d)) } else { 1.0 }
    }

    /// Factor by which an interpolated value is multiplied at distance d to give the blocked part. Inside the first shell
    /// the first shell holds, beyond the last the value falls off as (outer / d)^2.
    pub fn unscale(&self, d: f64) -> f64 {
        let near = d.clamp(self.inner, self.outer);
        let within = if self.scaled { cap_height(self.reach(near)) } else { 1.0 };
        within * (self.outer / d.max(self.outer)).powi(2)
    }

    /// Directions of one shell.
    pub fn direction_count(&self) -> u32 {
        match self.directions {
            Directions::Cube { cells } => 6 * cells * cells,
            Directions::LatLon { latitudes, longitudes } => latitudes * longitudes,
        }
    }

    /// Samples that are captured.
    pub fn sample_count(&self) -> u32 {
        self.shells * self.direction_count()
    }

    /// Directions of one shell as stored, borders included.
    pub fn stored_direction_count(&self) -> u32 {
        match self.directions {
            Directions::Cube { cells } => 6 * (cells + 2) * (cells + 2),
            Directions::LatLon { .. } => self.direction_count(),
        }
    }

    /// Samples as stored, borders included.
    pub fn stored_count(&self) -> u32 {
        self.shells * self.stored_direction_count()
    }

    /// Unit direction of the `index`-th captured sample of a shell, in the lattice's space.
    pub fn direction(&self, index: u32) -> DVec3 {
        match self.directions {
            Directions::Cube { cells } => {
                let (face, cell) = (index / (cells * cells), index % (cells * cells));
                let st = |i: u32| unwarp((f64::from(i) + 0.5) / f64::from(cells) * 2.0 - 1.0);
                cube::direction(face as usize, st(cell % cells), st(cell / cells))
            }
            Directions::LatLon { latitudes, longitudes } => {
                let polar = (f64::from(index / longitudes) + 0.5) * PI / f64::from(latitudes);
                let azimuth = f64::from(index % longitudes) * TAU / f64::from(longitudes);
                DVec3::new(polar.sin() * azimuth.cos(), polar.cos(), polar.sin() * azimuth.sin())
            }
        }
    }

    /// Position of the `index`-th captured sample, in r from the sphere's centre, object's frame; shells come one after another,
    /// innermost first.
    pub fn position(&self, index: u32) -> DVec3 {
        let at = self.shell(index / self.direction_count()) * self.direction(index % self.direction_count());
        self.fit().invert(at)
    }

    /// For every stored direction, the captured directions whose mean it is: one for a cell, one for a border, three for
    /// the corner of a border.
    pub fn sources(&self) -> Vec<Vec<u32>> {
        let Directions::Cube { cells } = self.directions else {
            return (0..self.direction_count()).map(|i| vec![i]).collect();
        };
        let n = i64::from(cells);
        let mut out = Vec::with_capacity(self.stored_direction_count() as usize);
        for face in 0..6 {
            for y in -1..=n {
                for x in -1..=n {
                    let (inside_x, inside_y) = (x.clamp(0, n - 1), y.clamp(0, n - 1));
                    out.push(match (x == inside_x, y == inside_y) {
                        (true, true) => vec![self.cell_index(face, x, y)],
                        (false, false) => vec![
                            self.cell_index(face, inside_x, inside_y),
                            self.neighbour(face, x, inside_y),
                            self.neighbour(face, inside_x, y),
                        ],
                        _ => vec![self.neighbour(face, x, y)],
                    });
                }
            }
        }
        out
    }

    /// The four captured directions around one of a cube lattice.
    pub fn cell_neighbours(&self, direction: u32) -> Vec<u32> {
        let Directions::Cube { cells } = self.directions else { unreachable!("only cubes have cells") };
        let n = i64::from(cells);
        let (face, x, y) = (direction / (cells * cells), direction % cells, direction / cells % cells);
        let (x, y) = (i64::from(x), i64::from(y));
        [(x - 1, y), (x + 1, y), (x, y - 1), (x, y + 1)]
            .map(|(x, y)| {
                let within = (0..n).contains(&x) && (0..n).contains(&y);
                if within { self.cell_index(face, x, y) } else { self.neighbour(face, x, y) }
            })
            .to_vec()
    }

    fn cell_index(&self, face: u32, x: i64, y: i64) -> u32 {
        let Directions::Cube { cells } = self.directions else { unreachable!("only cubes have cells") };
        (face * cells + y as u32) * cells + x as u32
    }

    /// The captured direction that lies one cell beyond the edge of `face`, where exactly one of x and y is outside.
    fn neighbour(&self, face: u32, x: i64, y: i64) -> u32 {
        let Directions::Cube { cells } = self.directions else { unreachable!("only cubes have cells") };
        let n = i64::from(cells);
        // A hair beyond the edge the other face's cell is found by plain projection.
        let st = |i: i64| match i {
            -1 => -1.0 - 1e-6,
            i if i == n => 1.0 + 1e-6,
            i => unwarp((i as f64 + 0.5) / f64::from(cells) * 2.0 - 1.0),
        };
        let (other, s, t) = cube::face_st(cube::direction(face as usize, st(x), st(y)));
        let cell = |s: f64| (((warp(s) + 1.0) / 2.0 * f64::from(cells)).floor() as i64).clamp(0, n - 1);
        self.cell_index(other as u32, cell(s), cell(t))
    }

    /// Stored samples around a receiver at `position` (in r, object's frame). Non-negative weights that sum to 1; a
    /// receiver at the very centre takes direction +x.
    pub fn corners(&self, position: DVec3, lookup: Lookup) -> Corners {
        let within = self.fit().apply(position);
        let d = within.length();
        let direction = if d > 0.0 { within / d } else { DVec3::X };
        let (slope, offset) = self.radial_map();
        let last = f64::from(self.shells - 1);
        let mut t = (slope * self.coordinate(d.max(self.inner)) + offset).clamp(0.0, last);
        if lookup == Lookup::Nearest {
            t = t.round();
        }
        let shell = t.floor().min((last - 1.0).max(0.0));
        let radial = t - shell;
        let plane = self.plane(direction, lookup);
        let mut corners = Corners { index: [0; 8], weight: [0.0; 8] };
        for k in 0..8 {
            let (x, y, z) = (k & 1, (k >> 1) & 1, k >> 2);
            let base = (shell as u32 + z as u32).min(self.shells - 1) * self.stored_direction_count();
            let side = |fraction: f64, upper: usize| if upper == 1 { fraction } else { 1.0 - fraction };
            corners.index[k] = base + plane.base + plane.y[y] * plane.columns + plane.x[x];
            corners.weight[k] = side(plane.fraction[0], x) * side(plane.fraction[1], y) * side(radial, z);
        }
        corners
    }

    /// The four cells around a direction within one shell.
    fn plane(&self, direction: DVec3, lookup: Lookup) -> Plane {
        let settle = |x: f64| if lookup == Lookup::Trilinear { x } else { x.round() };
        match self.directions {
            Directions::Cube { cells } => {
                let (face, s, t) = cube::face_st(direction);
                // Border cells shift the index by one, cell centres by a half.
                let place = |s: f64| settle((warp(s) + 1.0) / 2.0 * f64::from(cells) + 0.5);
                let (x, y) = (place(s), place(t));
                // Rounding may land on cells + 1/2 exactly: stay inside the stored rows.
                let low = |x: f64| (x.floor() as u32).min(cells);
                let (x0, y0) = (low(x), low(y));
                Plane {
                    base: face as u32 * (cells + 2) * (cells + 2),
                    columns: cells + 2,
                    x: [x0, x0 + 1],
                    y: [y0, y0 + 1],
                    fraction: [x - f64::from(x0), y - f64::from(y0)],
                }
            }
            Directions::LatLon { latitudes, longitudes } => {
                let polar = direction.y.clamp(-1.0, 1.0).acos() / PI * f64::from(latitudes) - 0.5;
                let azimuth = (direction.z.atan2(direction.x) / TAU).rem_euclid(1.0) * f64::from(longitudes);
                let y = settle(polar.clamp(0.0, f64::from(latitudes - 1)));
                let x = settle(azimuth);
                let (x0, y0) = (x.floor() as u32, (y.floor() as u32).min(latitudes.saturating_sub(2)));
                Plane {
                    base: 0,
                    columns: longitudes,
                    x: [x0 % longitudes, (x0 + 1) % longitudes],
                    y: [y0, (y0 + 1).min(latitudes - 1)],
                    fraction: [x - f64::from(x0), y - f64::from(y0)],
                }
            }
        }
    }

    /// Checks counts and radii.
    ///
    /// # Errors
    /// `Input` when a count is 0, radii are not increasing and finite, or the samples are more than [`MAX_SAMPLES`].
    pub fn validate(&self) -> Result<()> {
        let bad = |what: String| Err(Error::Input(format!("lattice {self}: {what}")));
        let directions = match self.directions {
            Directions::Cube { cells } => u64::from(cells).pow(2).saturating_mul(6),
            Directions::LatLon { latitudes, longitudes } => u64::from(latitudes) * u64::from(longitudes),
        };
        let samples = u64::from(self.shells).saturating_mul(directions);
        if samples == 0 {
            return bad("every count is at least 1".into());
        }
        if samples > MAX_SAMPLES || self.shells > 4096 || directions > MAX_SAMPLES {
            return bad(format!("{samples} samples, at most {MAX_SAMPLES} are allowed"));
        }
        let radii = self.inner.is_finite() && self.outer.is_finite() && self.inner >= 0.0 && self.outer > self.inner;
        if !radii || self.outer > 1e4 {
            return bad(format!("shells from {} to {} r", self.inner, self.outer));
        }
        if !self.fit().is_usable() {
            return bad("its centre or stretch is out of range".into());
        }
        Ok(())
    }
}

/// Four cells of a shell and the place between them.
struct Plane {
    base: u32,
    columns: u32,
    x: [u32; 2],
    y: [u32; 2],
    fraction: [f64; 2],
}

impl std::fmt::Display for Lattice {
    /// In the words that the parser takes.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.directions {
            Directions::Cube { cells } => write!(f, "cube:{}x{cells}", self.shells)?,
            Directions::LatLon { latitudes, longitudes } => {
                write!(f, "latlon:{}x{latitudes}x{longitudes}", self.shells)?;
            }
        }
        let spacing = match self.spacing {
            Spacing::Chord => "chord",
            Spacing::Log => "log",
            Spacing::Linear => "linear",
        };
        let stored = if self.scaled { "scaled" } else { "raw" };
        write!(f, ",{spacing},{stored}")?;
        if self.inner != AUTOMATIC {
            write!(f, ",inner={}", self.inner)?;
        }
        write!(f, ",outer={}", self.outer)?;
        let words = |of: [f64; 3]| of.map(|x| x.to_string()).join(":");
        match self.fit {
            Some(fit) if fit == Fit::ROUND => write!(f, ",round"),
            Some(fit) => write!(f, ",centre={},stretch={}", words(fit.centre), words(fit.stretch)),
            None => Ok(()),
        }
    }
}

impl std::str::FromStr for Lattice {
    type Err = String;

    /// `cube:SHELLSxCELLS` or `latlon:SHELLSxLATITUDESxLONGITUDES`, then any of `,chord` `,log` `,linear` `,scaled`
    /// `,raw` `,inner=R` `,outer=R` `,round`, or `,centre=X:Y:Z` and `,stretch=X:Y:Z`.
    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let explain = || {
            format!(
                "cannot read lattice \"{text}\" (cube:16x8 or latlon:8x4x4, then optionally ,chord|log|linear \
                 ,scaled|raw ,inner=R ,outer=R ,round)"
            )
        };
        let mut words = text.split(',');
        let (kind, counts) = words.next().and_then(|w| w.split_once(':')).ok_or_else(explain)?;
        let counts: Vec<u32> =
            counts.split('x').map(str::parse).collect::<std::result::Result<_, _>>().map_err(|_| explain())?;
        let mut lattice = Lattice::default();
        (lattice.shells, lattice.directions) = match (kind, &counts[..]) {
            ("cube", &[shells, cells]) => (shells, Directions::Cube { cells }),
            ("latlon", &[shells, latitudes, longitudes]) => (shells, Directions::LatLon { latitudes, longitudes }),
            _ => return Err(explain()),
        };
        for word in words {
            match word.split_once('=') {
                Some(("inner", radius)) => lattice.inner = radius.parse().map_err(|_| explain())?,
                Some(("outer", radius)) => lattice.outer = radius.parse().map_err(|_| explain())?,
                Some(("centre", words)) => {
                    lattice.fit.get_or_insert(Fit::ROUND).centre = triple(words).ok_or_else(explain)?;
                }
                Some(("stretch", words)) => {
                    lattice.fit.get_or_insert(Fit::ROUND).stretch = triple(words).ok_or_else(explain)?;
                }
                _ => match word {
                    "chord" => lattice.spacing = Spacing::Chord,
                    "log" => lattice.spacing = Spacing::Log,
                    "linear" => lattice.spacing = Spacing::Linear,
                    "scaled" => lattice.scaled = true,
                    "raw" => lattice.scaled = false,
                    "round" => lattice.fit = Some(Fit::ROUND),
                    _ => return Err(explain()),
                },
            }
        }
        lattice.validate().map_err(|error| error.to_string())?;
        Ok(lattice)
    }
}

/// Three numbers with colons between.
fn triple(words: &str) -> Option<[f64; 3]> {
    let numbers: Vec<f64> = words.split(':').map(|w| w.parse().ok()).collect::<Option<_>>()?;
    numbers.try_into().ok()
}
