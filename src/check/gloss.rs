//! "gloss" against its twin in f64, which reads the same transfer.

use super::CheckRow;
use super::merge::{MIXED, options, scene};
use crate::bake::cache::Cache;
use crate::bake::{self, Baker};
use crate::bounce::Bounces;
use crate::error::Result;
use crate::frame::{self, Frame};
use crate::lists::skip::Skip;
use crate::scene::Gloss;

/// Filters of textures have eight bits between two texels, and texels of eleven bits.
const FILTERED: f64 = 0.01;

/// Compares what every vertex of a scene reflects, of the sky and of what stands near: of a mirror, whose pixels look the
/// sky up, and of rougher ones.
pub fn rows(baker: &Baker, add: &mut dyn FnMut(CheckRow)) -> Result<()> {
    let mut scene = scene(MIXED)?;
    let trials = [(0.2, Bounces::None), (1.0, Bounces::None), (0.2, Bounces::One), (0.5, Bounces::One)];
    for (roughness, bounces) in trials {
        for index in 0..scene.data.entities.len() {
            let gloss = Gloss { roughness, metallic: 0.5, f0: 0.04 };
            let data = crate::scene::EntityData { gloss: Some(gloss), ..scene.data.entities[index].clone() };
            scene.set_entity(index, data)?;
        }
        let placements = scene.at(0.0);
        let of_bounces = bake::Options { groups: bounces != Bounces::None, ..options().bake };
        let options = frame::Options { bounces, bake: of_bounces, skip: Skip::without("hidden"), ..options() };
        let mut frame = Frame::new(baker, &Cache::default(), &scene, options, &|_, _, _| ())?;
        frame.render(&placements, Some(1.0))?;
        let mut worst = 0.0_f64;
        let mut most = 0.0_f64;
        for (entity, _) in scene.entities.iter().enumerate().filter(|(_, entity)| entity.receives) {
            let [found, wanted] = frame.reflections_beside_twin(entity, &placements)?;
            for (found, wanted) in found.iter().flatten().zip(wanted.iter().flatten()) {
                worst = worst.max((*found - *wanted).abs().max_element());
                most = most.max(wanted.max_element());
            }
        }
        let worst = if most > 0.0 { worst / most } else { f64::INFINITY };
        let what = format!("roughness {roughness}{}", if bounces == Bounces::None { "" } else { ", one bounce" });
        add(CheckRow::new("gloss", what, "of the brightest", worst, FILTERED));
    }
    Ok(())
}
