//! The exposure of a picture from its own light, by rays from a few of its pixels: no device is needed, and it is the
//! same wherever it is computed.

use super::pixels::Eye;
use super::raycast::RayCast;
use super::{Vertex, World};
use crate::bounce::Bounces;
use crate::scene::Scene;

/// Pixels along the longer side of the picture that is metered.
const SIZE_PX: f64 = 32.0;
/// Rays a pixel and light; each is followed as it bounces, as most of the light in a room does.
const RAYS: u32 = 8;
/// Share of the pixels that are darker than the one that is shown nearly white.
const BRIGHT: f64 = 0.92;
/// Value that it gets, linear.
const NEARLY_WHITE: f64 = 0.8;
/// Value that the pixel in the middle gets at least, as far as it costs no more than [`EXTRA_EV`].
const MIDDLE: f64 = 0.1;
/// Largest further brightening, stops.
const EXTRA_EV: f64 = 2.0;
/// Value that the background gets at most where it fills half of the picture or more: what is dark before it stays so.
const BACKGROUND: f64 = 2.0;
/// Exposures are multiples of this, stops.
const STEP_EV: f64 = 0.25;

/// Gives a scene that states no exposure the one of [`exposure_ev`], or 0 in the dark, and says so.
pub fn settle(scene: &mut Scene, time_s: f64, aspect: f64) -> Option<String> {
    if scene.data.output.exposure_ev.is_some() {
        return None;
    }
    let found = exposure_ev(scene, time_s, aspect);
    scene.data.output.exposure_ev = Some(found.unwrap_or(0.0));
    Some(found.map_or("the picture is black: there is no light to find an exposure from".into(), |ev| {
        format!("exposure_ev is {ev}, from the light of the first picture")
    }))
}

/// The exposure in stops, -32 to 32, that suits the light of what the scene's picture of that width over height shows
/// at `time_s`; `None` where all of that is black. Emission counts only where nothing else is seen.
pub fn exposure_ev(scene: &Scene, time_s: f64, aspect: f64) -> Option<f32> {
    let size = [SIZE_PX * aspect.min(1.0), SIZE_PX / aspect.max(1.0)].map(|px| (px.round() as u32).max(1));
    let world = World::of(scene, &scene.at(time_s));
    let eye = Eye::new(&world, size);
    let seen: Vec<_> =
        (0..size[0] * size[1]).filter_map(|pixel| Some((pixel, eye.seen(pixel, [0.5; 2]).pop()?))).collect();
    let receiving = seen.iter().filter(|(_, seen)| scene.entities[seen.entity].receives);
    let points: Vec<_> =
        receiving.map(|(pixel, seen)| (Vertex { entity: seen.entity, index: *pixel as usize }, seen.view)).collect();
    let cast = RayCast { rays: RAYS, runs: 1, bounces: Bounces::All.most(), ..RayCast::default() };
    let lit = cast.run_at(&world, &points);
    let brightest = |rgb: [f64; 3]| rgb.into_iter().fold(0.0, f64::max);
    let found = of_values(lit.iter().map(|estimate| brightest(estimate.radiosity)).collect())
        .or_else(|| of_values(seen.iter().map(|(_, seen)| brightest(seen.emission.to_array())).collect()))?;
    let background = brightest(scene.environment.mean().to_array());
    let most_ev = if 2 * seen.len() as u32 <= size[0] * size[1] { (BACKGROUND / background).log2() } else { 32.0 };
    Some(found.min(in_steps(most_ev)))
}

/// The exposure that suits radiances: bright ones become nearly white, and where that leaves most of them dark, more of
/// the bright ones become white.
fn of_values(mut values: Vec<f64>) -> Option<f32> {
    values.sort_by(f64::total_cmp);
    let at = |share: f64| values.get((share * values.len() as f64) as usize).copied();
    // Where most is black, what is not decides.
    let bright = at(BRIGHT).filter(|bright| *bright > 0.0).or(values.last().copied()).filter(|bright| *bright > 0.0)?;
    let bright_ev = (NEARLY_WHITE / bright).log2();
    let middle_ev = (MIDDLE / at(0.5)?).log2();
    let ev = middle_ev.clamp(bright_ev, bright_ev + EXTRA_EV);
    Some(in_steps(ev))
}

fn in_steps(ev: f64) -> f32 {
    ((ev / STEP_EV).round() * STEP_EV).clamp(-32.0, 32.0) as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    #[test]
    fn bright_values_become_nearly_white() {
        assert_eq!(of_values(Vec::new()), None);
        assert_eq!(of_values(vec![0.0; 9]), None);
        assert_eq!(of_values(vec![0.8; 100]), Some(0.0), "all alike");
        assert_eq!(of_values(vec![3.2e6; 100]), Some(-22.0));
        assert_eq!(of_values((0..100).map(|i| f64::from(i) / 100.0).collect()), Some(-0.25));
        // One lamp's spot on a dark wall: two stops more than the spot asks for.
        let spot: Vec<f64> = (0..100).map(|i| if i < 80 { 0.001 } else { 0.8 }).collect();
        assert_eq!(of_values(spot), Some(2.0));
        let spark: Vec<f64> = (0..100).map(|i| if i < 99 { 0.0 } else { 0.2 }).collect();
        assert_eq!(of_values(spark), Some(4.0));
    }

    #[test]
    fn pictures_of_any_light_are_neither_black_nor_white() {
        let ev_of = |radiance: f32, size_m: f32, albedo: f32| {
            let text = format!(
                "[camera]\neye = [0, 2, 5]\ntarget = [0, 0, 0]\n[environment]\nuniform = [{radiance}, 0, 0]\n\
                 [[mesh]]\nname = \"floor\"\nplane = {{ size_m = {size_m}, cells = 2 }}\n[[entity]]\nmesh = \"floor\"\n\
                 albedo = [{albedo}, {albedo}, {albedo}]\n"
            );
            let read = |_: &Path| unreachable!("no files");
            exposure_ev(&Scene::parse(&text, Path::new("s.toml"), &read).unwrap(), 0.0, 1.5)
        };
        let ev = |radiance: f32| ev_of(radiance, 9.0, 0.7);
        // A floor of albedo 0.7 in the open.
        assert_eq!(ev(1.0), Some(0.25));
        assert_eq!(ev(1024.0), Some(0.25 - 10.0));
        assert_eq!(ev(0.0), None);
        // A small black thing stays dark, and the sky behind it is not far beyond white.
        assert_eq!(ev_of(8.0, 1.0, 0.001), Some(-2.0));
    }
}
