//! Sheets: flat meshes, which block light from both sides. Of those that cover a rectangle nothing is baked: what they
//! block is computed from the rectangle, in closed form.

use super::silhouette::{LEAST_PENUMBRA, blocked_share};
use super::sub_light::LampFace;
use crate::sh::polygon::{POLYGON_COEFFICIENTS, polygon};
use glam::{DMat3, DVec2, DVec3, DVec4};

/// How near a point of a receiver may lie to a sheet's plane, in bounding radii of the receiver, and still count as
/// beside it at that height: what stands on a floor touches it with heights that are rounding.
pub const CONTACT: f64 = 2e-3;
/// How far a light must reach beyond a sheet, of the light's bounding radius, before the sheet blocks any of it: a lamp
/// that lies on a ceiling shines.
pub const BEYOND: f64 = 2e-3;

/// The height of a receiver's point over a sheet's plane as the sheet's shadow takes it: never within `contact`
/// (metres) of the plane. There the point counts as on the side where its receiver's centre lies, so that an object
/// stands on a floor and not in it; of a receiver whose centre lies in the plane too, as on the side that it faces.
/// `facing` is the cosine of its normal and the plane's. What is left undecided counts as above.
pub fn height_over(height: f64, of_centre: f64, facing: f64, contact: f64) -> f64 {
    let side = of_centre + contact * (2.0 * facing + 0.01);
    if height.abs() < contact { contact.copysign(side) } else { height }
}

/// A rectangle in the frame of a mesh, about the centre of its bounding sphere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rectangle {
    /// Unit vectors along its sides.
    pub axes: [DVec3; 2],
    pub half_m: [f64; 2],
}

impl Rectangle {
    /// How the mesh's axes are turned against the frame in which a lamp lies: columns for its x, y and z.
    pub fn frame(&self) -> DMat3 {
        let [x, z] = self.axes;
        DMat3::from_cols(x, z.cross(x), z)
    }

    /// The rectangle as a lamp, if it lies in the frame of lamps.
    pub fn as_lamp(&self) -> Option<LampFace> {
        let edges = DVec2::from_array(self.half_m);
        let along = |axis: DVec3| self.axes[0].dot(axis).abs() > 1.0 - 1e-9 && self.axes[1].y.abs() < 1e-5;
        if along(DVec3::X) {
            Some(LampFace::Sheet(edges.y / edges.x))
        } else if along(DVec3::Z) {
            Some(LampFace::Sheet(edges.x / edges.y))
        } else {
            None
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sheet {
    pub centre: DVec3,
    pub rectangle: Rectangle,
}

/// A receiver's point from which a sheet is seen.
#[derive(Clone, Copy, Debug)]
pub struct SheetEye {
    pub position: DVec3,
    pub normal: DVec3,
    pub receiver: (DVec3, f64),
}

/// A sheet as a point sees it: the twin of `Sheet` in `glsl/sheet.glsl`.
#[derive(Clone, Copy, Debug)]
pub struct SheetView {
    /// Along the rectangle's sides, and from the point to its plane.
    axes: [DVec3; 3],
    /// Of its sides from the point along the first two axes: low and high, metres.
    ends: [[f64; 2]; 2],
    /// Of the point over the plane, metres, positive.
    height: f64,
}

impl Sheet {
    /// The side of its plane that counts as above.
    pub fn up(&self) -> DVec3 {
        self.rectangle.axes[0].cross(self.rectangle.axes[1])
    }

    pub fn corners(&self) -> [DVec3; 4] {
        let Rectangle { axes: [x, y], half_m: [a, b] } = self.rectangle;
        [(-a, -b), (a, -b), (a, b), (-a, b)].map(|(s, t)| self.centre + s * x + t * y)
    }

    pub fn seen(&self, eye: &SheetEye) -> SheetView {
        let Rectangle { axes: [x, y], half_m } = self.rectangle;
        let up = self.up();
        let to = self.centre - eye.position;
        let of_centre = up.dot(eye.receiver.0 - self.centre);
        let height = height_over(-up.dot(to), of_centre, up.dot(eye.normal), CONTACT * eye.receiver.1);
        let ends = |axis: DVec3, half: f64| [axis.dot(to) - half, axis.dot(to) + half];
        SheetView {
            axes: [x, y, if height < 0.0 { up } else { -up }],
            ends: [ends(x, half_m[0]), ends(y, half_m[1])],
            height: height.abs(),
        }
    }
}

impl SheetView {
    pub fn corners(&self) -> [DVec3; 4] {
        let [x, y, z] = self.axes;
        let [[x0, x1], [y0, y1]] = self.ends;
        [(x0, y0), (x1, y0), (x1, y1), (x0, y1)].map(|(s, t)| s * x + t * y + self.height * z)
    }

    /// Distance of its nearest point, metres.
    pub fn nearest_m(&self) -> f64 {
        let [x, y] = self.ends.map(|[low, high]| 0.0_f64.clamp(low, high));
        DVec3::new(x, y, self.height).length()
    }

    pub fn blocked(&self) -> [f64; POLYGON_COEFFICIENTS] {
        polygon(&self.corners())
    }

    /// How far a place lies beyond its plane, metres. `to` is the place from the point.
    pub fn beyond_m(&self, to: DVec3) -> f64 {
        self.axes[2].dot(to) - self.height
    }

    /// Sines of the angles of a direction over the planes through the point and the four sides, low and high along the
    /// first axis and along the second; positive where the sheet lies.
    pub fn inside(&self, direction: DVec3) -> DVec4 {
        let [x, y, z] = self.axes.map(|axis| axis.dot(direction));
        let [[x0, x1], [y0, y1]] = self.ends;
        let sine = |across: f64, end: f64| (self.height * across - end * z) / self.height.hypot(end);
        DVec4::new(sine(x, x0), -sine(x, x1), sine(y, y0), -sine(y, y1))
    }

    /// What it blocks of a small round light: the light's middle lies in that unit direction, `distance` metres away,
    /// `sine` is that of its angular radius, and `slope` the sine of the angle between the light's surface and the
    /// sheet. `least_m` is the least that the light reaches beyond the sheet.
    pub fn shadow(&self, direction: DVec3, distance: f64, sine: f64, slope: f64, least_m: f64) -> SheetShadow {
        let beyond = self.axes[2].dot(direction) * distance - self.height;
        let counts = ((beyond - least_m) / (distance * sine * slope).max(least_m)).clamp(0.0, 1.0);
        let inside = self.inside(direction).to_array();
        let share = inside.map(|inside| blocked_share(inside / sine.max(LEAST_PENUMBRA)));
        // Cosines of the angles between those planes: the edges' share together depends on them.
        let [[x0, x1], [y0, y1]] = self.ends;
        let tilt = |low: f64, high: f64| {
            -(self.height * self.height + low * high) / (self.height.hypot(low) * self.height.hypot(high))
        };
        let [x, y] = [both(share[0], share[1], tilt(x0, x1)), both(share[2], share[3], tilt(y0, y1))];
        // Of each pair the side that is nearer to the light.
        let side = |low: f64, high: f64, [low_end, high_end]: [f64; 2]| {
            let end = if low < high { -low_end } else { high_end };
            end / self.height.hypot(end)
        };
        let cosine = side(share[0], share[1], self.ends[0]) * side(share[2], share[3], self.ends[1]);
        let nearest = (1..4).fold(0, |nearest, i| if inside[i] < inside[nearest] { i } else { nearest });
        let end = self.ends[nearest / 2][nearest % 2];
        let inward = if nearest % 2 == 0 { 1.0 } else { -1.0 };
        let normal = self.height * self.axes[nearest / 2] - end * self.axes[2];
        SheetShadow { free: 1.0 - counts * both(x, y, cosine), edge: inward / self.height.hypot(end) * normal }
    }

    /// Sine of the angle between its plane and a surface at right angles to a unit vector.
    pub fn slope(&self, normal: DVec3) -> f64 {
        let cosine = self.axes[2].dot(normal);
        (1.0 - cosine * cosine).max(0.0).sqrt()
    }
}

/// What sheets leave of a small round light.
#[derive(Clone, Copy, Debug)]
pub struct SheetShadow {
    pub free: f64,
    /// Unit normal, towards what is blocked, of the plane through the point and the side that runs nearest to the light.
    edge: DVec3,
}

impl SheetShadow {
    pub const NONE: SheetShadow = SheetShadow { free: 1.0, edge: DVec3::ZERO };

    /// Two sheets that meet in an edge, as the walls of a room, leave nothing free between them: their edges' normals
    /// are opposite there. The edge of the result is that which divides the light more evenly.
    pub fn behind(self, other: SheetShadow) -> SheetShadow {
        let divides = |shadow: &SheetShadow| (shadow.free - 0.5).abs();
        let edge = if divides(&other) < divides(&self) { other.edge } else { self.edge };
        SheetShadow { free: both(self.free, other.free, self.edge.dot(other.edge)), edge }
    }
}

/// Share of a disc that lies on the inner side of two edges, from the shares inside of each: exact where the edges are
/// parallel, in the same sense (cosine 1 of their normals) or opposite senses (-1), and where they cross at right angles
/// in its middle.
pub(super) fn both(a: f64, b: f64, cosine: f64) -> f64 {
    let end = if cosine < 0.0 { (a + b - 1.0).max(0.0) } else { a.min(b) };
    a * b + cosine.abs() * (end - a * b)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The wall and the ceiling of a room, and a light of 3 degrees behind the edge in which they meet.
    #[test]
    fn sheets_that_meet_leave_nothing_between_them() {
        let sheet = |centre: [f64; 3], axes: [DVec3; 2]| Sheet {
            centre: centre.into(),
            rectangle: Rectangle { axes, half_m: [2.0, 2.0] },
        };
        let ceiling = sheet([0.0, 4.0, 0.0], [DVec3::X, DVec3::Z]);
        let wall = sheet([2.0, 2.0, 0.0], [DVec3::Y, DVec3::Z]);
        let eye = SheetEye {
            position: DVec3::new(-1.0, 0.5, 0.3),
            normal: DVec3::Y,
            receiver: (DVec3::new(0.0, 0.3, 0.0), 1.0),
        };
        for across in [-0.03, -0.01, 0.0, 0.004, 0.02] {
            let toward = (DVec3::new(2.0 + across, 4.0, -0.5) - eye.position).normalize();
            let [a, b] = [ceiling, wall].map(|sheet| sheet.seen(&eye).shadow(toward, 1e3, 0.026, 0.5, 0.0));
            assert!(a.free * b.free > 0.1, "{} {}", a.free, b.free);
            let free = SheetShadow::NONE.behind(a).behind(b).free;
            assert!(free < 0.02, "{across}: {free}");
        }
    }
}
