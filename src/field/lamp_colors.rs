//! Colours of a lamp by direction and distance: of one that has several, and of one that shines by its outline.
//!
//! Such a lamp is a sharp light of its mean colour, and each of its parts ([`super::sub_light`]) has a factor on that.
//! The factor is a plane over the disc of the bounding sphere: a value at its middle and a slope, fitted to what shows
//! there. There is a plane for every node of a [`NodeGrid`] and each of [`SHELLS`] distances.
//!
//! Sixteen round parts cover a thin outline badly: those of a ring of 1 m with a tube of 6 cm send 1.26 times its light.
//! So the factor is also the share of the disc that rays find covered over the share that the parts cover. The error of
//! that ring's light falls from 0.33 to 0.064, and that of a ring with a tube of 30 cm from 0.070 to 0.030.

use super::silhouette_nodes::NodeGrid;
use glam::{DVec3, DVec4};

/// Distances: evenly spaced in bounding radii over distance, from 0 in steps of this.
pub const SHELLS: usize = 3;
pub const SHELL_STEP: f64 = 0.4;

/// Of the three channels: slope along the axes of the object's frame, from the disc's middle to its rim, and value in
/// the middle.
pub type ColorPlane = [DVec4; 3];

#[derive(Clone, Debug)]
pub struct LampColors {
    /// Mean over all directions and what is seen in them, of emission 1.
    pub mean: DVec3,
    /// A bound of the radiance of any part, of emission 1.
    pub brightest: f64,
    nodes: NodeGrid,
    /// For each shell and each map of the grid, as its direction sees it and as the opposite direction does.
    planes: [Vec<[ColorPlane; 2]>; SHELLS],
}

impl LampColors {
    pub fn new(mean: DVec3, nodes: NodeGrid, planes: [Vec<[ColorPlane; 2]>; SHELLS]) -> Self {
        let of_plane = |plane: &ColorPlane| -> f64 {
            let channels = plane.iter().zip(mean.to_array());
            channels.map(|(quad, mean)| mean * (quad.w + quad.truncate().length())).fold(0.0, f64::max)
        };
        let brightest = planes.iter().flatten().flatten().map(of_plane).fold(0.0, f64::max);
        LampColors { mean, brightest, nodes, planes }
    }

    /// What `lamp_colors` in `glsl/silhouette_field.glsl` reads: three quads a node, shell by shell.
    pub fn quads(&self) -> Vec<[f32; 4]> {
        let mut quads = Vec::new();
        for planes in &self.planes {
            let node = |&(map, opposite): &(usize, bool)| planes[map][usize::from(opposite)];
            quads.extend(self.nodes.nodes.iter().flat_map(node).map(|quad| quad.as_vec4().to_array()));
        }
        quads
    }

    /// The colours of a light whose centre lies in this direction, by the object's frame, and whose bounding sphere has
    /// an angular radius of this sine.
    pub fn seen(&self, toward: DVec3, sine: f64) -> ColorPlane {
        let at = (sine / SHELL_STEP).min((SHELLS - 1) as f64);
        let shell = (at as usize).min(SHELLS - 2);
        let nearer = at - shell as f64;
        let cell = self.nodes.cell(toward);
        let mut plane = [DVec4::ZERO; 3];
        for ((map, opposite), weight) in cell.nodes.into_iter().zip(self.nodes.weights(&cell, toward)) {
            for (shell, share) in [(shell, 1.0 - nearer), (shell + 1, nearer)] {
                let node = &self.planes[shell][map][usize::from(opposite)];
                plane.iter_mut().zip(node).for_each(|(sum, quad)| *sum += weight * share * *quad);
            }
        }
        plane
    }
}

/// Factor on the mean colour at a place of the disc (object's frame; its rim is 1 from its middle).
pub fn color_at(plane: &ColorPlane, place: DVec3) -> DVec3 {
    DVec3::from_array(plane.map(|quad| quad.dot(place.extend(1.0)).max(0.0)))
}
