//! Animations as keys of nodes' positions, rotations and scales.
//!
//! All animations of a file run at the same time, and each starts anew when its last key is reached.

use ::gltf::json::accessor::ComponentType;
use ::gltf::json::animation::{Channel as ChannelJson, Interpolation, Property, Sampler};
use ::gltf::json::validation::Checked;
use glam::Vec3;

use super::accessor;
use super::document::Document;
use super::notes::Notes;
use crate::error::Result;
use crate::scene::keys::{Between, KeyValue, Keys};
use crate::scene::values::SCALE_LIMIT;

/// Keys of a node.
#[derive(Clone, Debug, Default)]
pub struct Tracks {
    /// Keys of the translation.
    pub position: Option<Keys<Vec3>>,
    /// Keys of the rotation.
    pub rotation: Option<Keys<[f32; 4]>>,
    /// Keys of the scale, one factor for all axes.
    pub scale: Option<Keys<f32>>,
    /// Keys of the share of each morph target.
    pub weights: Vec<Keys<[f32; 1]>>,
}

/// A channel before its numbers become values.
struct Channel {
    place: String,
    times_s: Vec<f64>,
    numbers: Vec<f32>,
    interpolation: Between,
    period_s: Option<f64>,
}

/// Keys of every node that moves.
pub fn tracks(document: &Document, notes: &mut Notes) -> Result<Vec<Option<Tracks>>> {
    let mut out: Vec<Option<Tracks>> = vec![None; document.root.nodes.len()];
    notes.leave_out_many("channels of animations that move no node", document.nodeless_channels);
    for (index, animation) in document.root.animations.iter().enumerate() {
        let mut channels = Vec::new();
        for (at, channel) in animation.channels.iter().enumerate() {
            let Checked::Valid(property) = channel.target.path else { continue };
            let sampler = &animation.samplers[channel.sampler.value()];
            let times = sampler.input.value();
            let timeless = accessor::is_unfilled(document, times) && document.root.accessors[times].count.0 > 1;
            if timeless || property == Property::Rotation && accessor::is_unfilled(document, sampler.output.value()) {
                notes.leave_out("animations whose times or rotations are all zeros, which are no times or rotations");
                continue;
            }
            let read = read(document, format!("animations[{index}].channels[{at}]"), channel, sampler)?;
            channels.push((channel.target.node.value(), property, read));
        }
        // All channels of an animation start anew together.
        let last = channels.iter().filter_map(|(.., channel)| channel.times_s.last()).copied().fold(0.0, f64::max);
        for (node, property, mut channel) in channels {
            channel.period_s = (last > 1e-6).then_some(last);
            let tracks = out[node].get_or_insert_default();
            match property {
                Property::Translation if tracks.position.is_none() => {
                    tracks.position = Some(channel.keys(document, |n| Vec3::from_slice(n))?);
                }
                Property::Rotation if tracks.rotation.is_none() => {
                    tracks.rotation = Some(channel.keys(document, |n| [n[0], n[1], n[2], n[3]])?);
                }
                Property::MorphTargetWeights if tracks.weights.is_empty() => {
                    tracks.weights = channel.weights(document)?
                }
                Property::Scale if tracks.scale.is_none() => tracks.scale = Some(channel.scales(document, notes)?),
                _ => notes.leave_out("channels of animations that move what an earlier one moves"),
            }
        }
    }
    Ok(out)
}

/// How many morph targets the mesh of a node has.
fn target_count(document: &Document, node: usize) -> usize {
    let mesh = document.root.nodes[node].mesh.map(|mesh| &document.root.meshes[mesh.value()]);
    let targets = mesh.and_then(|mesh| mesh.primitives.first()?.targets.as_ref());
    targets.map_or(0, Vec::len)
}

/// Reads the numbers of a channel.
fn read(document: &Document, place: String, channel: &ChannelJson, sampler: &Sampler) -> Result<Channel> {
    let (element, width) = match channel.target.path {
        Checked::Valid(Property::Rotation) => (4, 4),
        Checked::Valid(Property::MorphTargetWeights) => (1, target_count(document, channel.target.node.value()).max(1)),
        _ => (3, 3),
    };
    let input = &document.root.accessors[sampler.input.value()];
    if !matches!(&input.component_type, Checked::Valid(component) if component.0 == ComponentType::F32) {
        return Err(document.fail(place, "its times are not f32"));
    }
    let times_s = accessor::numbers(document, sampler.input.value(), &[1])?;
    let numbers = accessor::numbers(document, sampler.output.value(), &[element])?;
    let interpolation = match sampler.interpolation {
        Checked::Valid(Interpolation::Step) => Between::Step,
        Checked::Valid(Interpolation::CubicSpline) => Between::Cubic,
        _ => Between::Linear,
    };
    let parts = if interpolation == Between::Cubic { 3 } else { 1 };
    if numbers.len() != parts * width * times_s.len() {
        let what = format!("{} times have {} values, not {parts} each", times_s.len(), numbers.len() / width);
        return Err(document.fail(place, what));
    }
    let times_s = times_s.into_iter().map(f64::from).collect();
    Ok(Channel { place, times_s, numbers, interpolation, period_s: None })
}

impl Channel {
    /// The channel as checked keys.
    fn keys<V: KeyValue>(self, document: &Document, value: impl Fn(&[f32]) -> V) -> Result<Keys<V>> {
        let is_cubic = self.interpolation == Between::Cubic;
        let parts = if is_cubic { 3 } else { 1 };
        let width = self.numbers.len() / parts / self.times_s.len().max(1);
        let every =
            |first: usize| self.numbers.chunks_exact(width).skip(first).step_by(parts).map(&value).collect::<Vec<V>>();
        let keys = Keys {
            values: every(usize::from(is_cubic)),
            in_slopes: if is_cubic { every(0) } else { Vec::new() },
            out_slopes: if is_cubic { every(2) } else { Vec::new() },
            times_s: self.times_s,
            interpolation: self.interpolation,
            period_s: self.period_s,
        };
        keys.check().map_err(|what| document.fail(self.place, what))?;
        Ok(keys)
    }

    /// Keys of the share of each morph target.
    fn weights(self, document: &Document) -> Result<Vec<Keys<[f32; 1]>>> {
        let parts = if self.interpolation == Between::Cubic { 3 } else { 1 };
        let count = self.numbers.len() / parts / self.times_s.len().max(1);
        let of = |target: usize| Channel {
            place: self.place.clone(),
            times_s: self.times_s.clone(),
            numbers: self.numbers.iter().skip(target).step_by(count).copied().collect(),
            ..self
        };
        (0..count).map(|target| of(target).keys(document, |n| [n[0]])).collect()
    }

    /// One scale for three, which is noted where they differ.
    fn scales(self, document: &Document, notes: &mut Notes) -> Result<Keys<f32>> {
        let is_cubic = self.interpolation == Between::Cubic;
        let values = || self.numbers.chunks_exact(3).enumerate().filter(|(i, _)| !is_cubic || i % 3 == 1);
        let uneven = |[x, y, z]: [f32; 3]| (x - y).abs().max((x - z).abs()) > 1e-4 * x.abs().max(y.abs());
        if values().any(|(_, s)| uneven([s[0], s[1], s[2]])) {
            notes.leave_out("animations of uneven scales (one scale of the same volume stands for them)");
        }
        if values().any(|(_, s)| s.iter().any(|x| *x < 1.0 / SCALE_LIMIT)) {
            notes.leave_out("animations of scales that reach 0 or mirror (they end at 1e-7)");
        }
        let one = |s: &[f32]| if uneven([s[0], s[1], s[2]]) { (s[0] * s[1] * s[2]).abs().cbrt() } else { s[0] };
        let numbers = self.numbers.chunks_exact(3).enumerate().map(|(i, s)| match is_cubic && i % 3 != 1 {
            true => (s[0] + s[1] + s[2]) / 3.0,
            false => one(s).max(1.0 / SCALE_LIMIT),
        });
        let numbers = numbers.collect();
        Channel { numbers, ..self }.keys(document, |n| n[0])
    }
}
