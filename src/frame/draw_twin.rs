//! The CPU twin of "draw" in f64: a picture of a frame by asking of every sample which triangle lies nearest.

use super::Frame;
use crate::asset::backdrop::Backdrop;
use crate::draw::camera;
use crate::draw::smooth::{self, Smooth, Texel};
use crate::error::Result;
use crate::scene::Placement;
use glam::{DMat3, DVec2, DVec3, DVec4, Vec3};
use rayon::prelude::*;

/// Vulkan's standard places of four samples in a pixel ("Standard sample locations"), and of one.
const FOUR: [DVec2; 4] =
    [DVec2::new(0.375, 0.125), DVec2::new(0.875, 0.375), DVec2::new(0.125, 0.625), DVec2::new(0.625, 0.875)];
const ONE: [DVec2; 1] = [DVec2::new(0.5, 0.5)];

/// A triangle on its way to the screen.
struct ScreenTriangle {
    /// From (x, y, 1) in clip space, before the division, to the corners' weights over w.
    weights: DMat3,
    /// Radiance at the corners: emission and radiosity.
    radiance: [DVec3; 3],
    tag: f32,
    /// The entity, where it is drawn as a grid.
    grid: Option<usize>,
    /// Pixels that it may touch: from and to, in x and y.
    pixels: [[f64; 2]; 2],
}

impl Frame {
    /// Samples a pixel of its pictures.
    pub fn samples(&self) -> u32 {
        self.picture.draw.samples()
    }

    /// The picture that the radiosity on the device should give, rows from the top, and how far each pixel may be off it;
    /// `white` as in [`Frame::render`].
    pub fn twin_picture(&self, placements: &[Placement], white: f32) -> Result<Vec<[DVec3; 2]>> {
        let [width, height] = self.options.size;
        let samples: &[DVec2] = if self.samples() > 1 { &FOUR } else { &ONE };
        let texels = self.twin_texels(placements, white, samples)?;
        if self.picture.draw.smooth.is_none() {
            return Ok(texels.iter().map(|texel| [texel.color, texel.spread]).collect());
        }
        let lines = self.outlines(placements, f64::from(width) / f64::from(height));
        Ok(Smooth::twin(&texels, [width, height], &lines).iter().map(|color| [*color, DVec3::ZERO]).collect())
    }

    /// The texels of that picture before outlines are smoothed, from samples at these places of a pixel, (0, 0) to (1,
    /// 1). Depth and tag are those of the last sample.
    pub fn twin_texels(&self, placements: &[Placement], white: f32, samples: &[DVec2]) -> Result<Vec<Texel>> {
        let [width, height] = self.options.size;
        let triangles = self.triangles(placements)?;
        let camera = &self.scene.data.camera;
        let near_m = camera::near_m(camera);
        let backdrop = Backdrop::new(&self.scene.environment);
        let through = camera::through_pixels(camera, [width, height].map(f64::from));
        let sky = |middle: DVec2| {
            let radiance = backdrop.as_ref().map(|sky| sky.radiance(through(middle.to_array())));
            radiance.map_or(self.sky.background.as_dvec3(), |radiance| shown(radiance, f64::from(white)))
        };
        let shade = |pixel: u32| {
            let corner = DVec2::new(f64::from(pixel % width), f64::from(pixel / width));
            let clip =
                |at: DVec2| DVec3::new(2.0 * at.x / f64::from(width) - 1.0, 2.0 * at.y / f64::from(height) - 1.0, 1.0);
            let near: Vec<&ScreenTriangle> = triangles.iter().filter(|t| t.may_touch(corner)).collect();
            let mut texel = Texel { color: DVec3::ZERO, spread: DVec3::ZERO, depth: 0.0, tag: 1.0 };
            for sample in samples {
                let at = clip(corner + *sample);
                let seen = near.iter().filter_map(|t| Some((t.nearness(at)?, t)));
                let color = match seen.max_by(|a, b| a.0.total_cmp(&b.0)) {
                    // The shader runs once a pixel for all samples that a triangle covers: at the pixel's centre where
                    // these are all, else at any place within the triangle ("centroid" leaves it to the driver).
                    Some((nearness, triangle)) => {
                        (texel.depth, texel.tag) = (near_m * nearness, triangle.tag);
                        // A grid is drawn as one parallelogram, and its shader looks for the triangle.
                        let is_drawn = |t: &ScreenTriangle| match triangle.grid {
                            Some(_) => t.grid == triangle.grid,
                            None => std::ptr::eq(t, *triangle),
                        };
                        let drawn: Vec<&&ScreenTriangle> = near.iter().filter(|t| is_drawn(t)).collect();
                        let is_covered = |at: &DVec3| drawn.iter().any(|t| t.nearness(*at).is_some());
                        let covered: Vec<DVec3> =
                            samples.iter().map(|s| clip(corner + *s)).filter(is_covered).collect();
                        let shaded = |at: DVec3| {
                            let nearest = drawn.iter().max_by(|a, b| a.depth_within(at).total_cmp(&b.depth_within(at)));
                            shown(nearest.map_or(DVec3::ZERO, |t| t.at(at)), f64::from(white))
                        };
                        let whole = covered.len() == samples.len();
                        let at = if whole { clip(corner + DVec2::splat(0.5)) } else { covered[0] };
                        let color = shaded(at);
                        // The two triangles that a grid is drawn as may share any of its pixels.
                        if !whole || triangle.grid.is_some() {
                            let off = |&at: &DVec3| (shaded(at) - color).abs();
                            let farthest = covered.iter().map(off).fold(DVec3::ZERO, DVec3::max);
                            texel.spread += farthest / samples.len() as f64;
                        }
                        color
                    }
                    None => {
                        (texel.depth, texel.tag) = (0.0, 1.0);
                        sky(corner + DVec2::splat(0.5))
                    }
                };
                texel.color += color / samples.len() as f64;
            }
            texel
        };
        Ok((0..width * height).into_par_iter().map(shade).collect())
    }

    fn triangles(&self, placements: &[Placement]) -> Result<Vec<ScreenTriangle>> {
        let [width, height] = self.options.size.map(f64::from);
        let clip_from_world = camera::clip_from_world(&self.scene.data.camera, width / height);
        let mut out = Vec::new();
        for (index, placement) in placements.iter().enumerate() {
            let entity = &self.scene.entities[index];
            let mesh = self.scene.surface(index);
            let radiosity = self.radiosity(index)?;
            let rotation = placement.turn();
            let grid = self.buffers.surface(index).drawn.grid().map(|_| index);
            let corner = |i: u32| {
                let v = i as usize;
                let world = placement.position.as_dvec3()
                    + rotation * (mesh.positions[v].as_dvec3() * f64::from(placement.scale));
                let pattern = mesh.colors.as_ref().map_or(Vec3::ONE, |colors| colors[v]);
                let emitted = (entity.emission * pattern).as_dvec3();
                (clip_from_world * world.extend(1.0), emitted + Vec3::from_array(radiosity[v]).as_dvec3())
            };
            for triangle in &mesh.triangles {
                let corners = triangle.map(corner);
                let clip = corners.map(|(clip, _)| clip);
                let radiance = corners.map(|(_, radiance)| radiance);
                out.extend(ScreenTriangle::new(clip, radiance, [width, height], smooth::tag(index), grid));
            }
        }
        Ok(out)
    }
}

/// Twin of the tone mapping in the fragment shader.
fn shown(radiance: DVec3, white: f64) -> DVec3 {
    let shown = radiance.max(DVec3::ZERO);
    if shown.max_element() > white { shown * (white / shown.max_element()) } else { shown }
}

impl ScreenTriangle {
    /// `None` for a triangle that is seen from its edge.
    fn new(clip: [DVec4; 3], radiance: [DVec3; 3], size: [f64; 2], tag: f32, grid: Option<usize>) -> Option<Self> {
        let matrix = DMat3::from_cols_array_2d(&clip.map(|c| [c.x, c.y, c.w]));
        let weights = matrix.inverse();
        if !weights.is_finite() || matrix.determinant() == 0.0 {
            return None;
        }
        let in_front = clip.iter().all(|c| c.w > 0.0);
        let range = |axis: usize| {
            // A triangle that reaches behind the eye may be anywhere.
            if !in_front {
                return [0.0, size[axis]];
            }
            let places = clip.map(|c| (c[axis] / c.w + 1.0) / 2.0 * size[axis]);
            [places.iter().copied().fold(f64::MAX, f64::min), places.iter().copied().fold(f64::MIN, f64::max)]
        };
        Some(ScreenTriangle { weights, radiance, tag, grid, pixels: [range(0), range(1)] })
    }

    /// Whether it may cover any of the pixel whose corner is given.
    fn may_touch(&self, corner: DVec2) -> bool {
        (0..2).all(|axis| corner[axis] + 1.0 >= self.pixels[axis][0] && corner[axis] <= self.pixels[axis][1])
    }

    /// One over its distance along the camera's axis at a place on the screen, where it covers it in front of the eye.
    fn nearness(&self, at: DVec3) -> Option<f64> {
        let weights = self.weights * at;
        (weights.min_element() >= 0.0).then(|| weights.element_sum())
    }

    /// The least weight of its corners at a place on the screen: how far within it is, or beyond where negative.
    fn depth_within(&self, at: DVec3) -> f64 {
        let weights = self.weights * at;
        (weights / weights.element_sum()).min_element()
    }

    /// Its radiance at a place on the screen, also beyond its edges.
    fn at(&self, at: DVec3) -> DVec3 {
        let weights = self.weights * at;
        self.radiance.iter().zip(weights.to_array()).map(|(r, w)| *r * w).sum::<DVec3>() / weights.element_sum()
    }
}
