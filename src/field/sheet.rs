//! Sheets: flat meshes, which block light from both sides.

/// How near a point of a receiver may lie to a sheet's plane, in bounding radii of the receiver, and still count as
/// beside it at that height: what stands on a floor touches it with heights that are rounding.
pub const CONTACT: f64 = 2e-3;

/// The height of a receiver's point over a sheet's plane as the sheet's shadow takes it: never within `contact`
/// (metres) of the plane. There the point counts as on the side where its receiver's centre lies, so that an object
/// stands on a floor and not in it; of a receiver whose centre lies in the plane too, as on the side that it faces.
/// `facing` is the cosine of its normal and the plane's. What is left undecided counts as above.
pub fn height_over(height: f64, of_centre: f64, facing: f64, contact: f64) -> f64 {
    let side = of_centre + contact * (2.0 * facing + 0.01);
    if height.abs() < contact { contact.copysign(side) } else { height }
}
