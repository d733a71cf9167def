//! Skins and morph targets: the shape that a mesh has at a time.

use ::gltf::json::mesh::{Primitive, Semantic};
use glam::{DAffine3, DMat4, DVec3, Vec3};

use super::Stage;
use super::accessor;
use super::document::Document;
use super::shape::Attributed;
use crate::error::Result;

/// Largest number of sets of four joints that a vertex follows.
const JOINT_SETS: u32 = 8;

/// The pose of a node's mesh.
#[derive(Clone, Debug, Default)]
pub struct Pose {
    /// From the space of the mesh to the world, by each joint; empty without a skin.
    pub joints: Vec<DAffine3>,
    /// The share of each morph target.
    weights: Vec<f64>,
}

/// Whether a node's mesh has a pose: a skin, or morph targets that count at some time.
pub fn is_posed(document: &Document, stage: &Stage, node: usize) -> bool {
    let tracks = stage.tracks[node].as_ref();
    let json = &document.root.nodes[node];
    let Some(mesh) = json.mesh else { return false };
    let weights = json.weights.as_ref().or(document.root.meshes[mesh.value()].weights.as_ref());
    let morphs = weights.is_some_and(|weights| weights.iter().any(|weight| *weight != 0.0));
    json.skin.is_some() || morphs || tracks.is_some_and(|tracks| !tracks.weights.is_empty())
}

impl Pose {
    /// The pose of a node at a time.
    pub fn at(document: &Document, stage: &Stage, node: usize, time_s: f64) -> Result<Self> {
        let json = &document.root.nodes[node];
        let mesh = json.mesh.map(|mesh| &document.root.meshes[mesh.value()]);
        let stored = json.weights.as_ref().or(mesh.and_then(|mesh| mesh.weights.as_ref()));
        let weights: Vec<f64> = match stage.tracks[node].as_ref().filter(|tracks| !tracks.weights.is_empty()) {
            Some(tracks) => tracks.weights.iter().map(|keys| keys.at(time_s).x).collect(),
            None => stored.into_iter().flatten().copied().map(f64::from).collect(),
        };
        if weights.iter().any(|weight| !weight.is_finite()) {
            return Err(document.fail(format!("nodes[{node}].weights"), "a weight is not finite"));
        }
        let Some(skin) = json.skin.map(|skin| skin.value()) else { return Ok(Pose { joints: Vec::new(), weights }) };
        let json = &document.root.skins[skin];
        let place = format!("skins[{skin}]");
        let inverse: Vec<DAffine3> = match json.inverse_bind_matrices {
            Some(index) => accessor::numbers(document, index.value(), &[16])?
                .chunks_exact(16)
                .map(|m| DAffine3::from_mat4(DMat4::from_cols_array(&std::array::from_fn(|i| f64::from(m[i])))))
                .collect(),
            None => vec![DAffine3::IDENTITY; json.joints.len()],
        };
        if inverse.len() < json.joints.len() {
            let what = format!("{} joints have {} matrices", json.joints.len(), inverse.len());
            return Err(document.fail(place, what));
        }
        let joint = |(joint, inverse): (&_, DAffine3)| {
            let node = ::gltf::json::Index::value(joint);
            let stand = stage.stands.iter().find(|stand| stand.node == node);
            let stand = stand.ok_or_else(|| document.fail(&place, format!("joint {node} is not in the scene")))?;
            Ok(stand.at(time_s) * inverse)
        };
        let joints = json.joints.iter().zip(inverse).map(joint).collect::<Result<_>>()?;
        Ok(Pose { joints, weights })
    }

    /// Moves vertices, one for each element of the accessors, and their normals, if there are any.
    pub fn bend(
        &self,
        document: &Document,
        primitive: &Primitive,
        attributed: &Attributed,
        positions: &mut [Vec3],
        mut normals: Option<&mut [Vec3]>,
    ) -> Result<()> {
        for (weight, target) in self.weights.iter().zip(primitive.targets.iter().flatten()) {
            let moves = |accessor: Option<_>, out: &mut [Vec3]| {
                let Some(index) = accessor.map(|index: ::gltf::json::Index<_>| index.value()) else { return Ok(()) };
                let by = accessor::triples(document, index)?;
                if by.len() != out.len() {
                    return Err(document.fail(&attributed.place, "a morph target has another number of vertices"));
                }
                out.iter_mut().zip(by).for_each(|(out, by)| *out += *weight as f32 * by);
                Ok(())
            };
            moves(target.positions, positions)?;
            if let Some(normals) = normals.as_deref_mut() {
                moves(target.normals, normals)?;
            }
        }
        if self.joints.is_empty() {
            return Ok(());
        }
        let followed = self.followed(document, attributed, positions.len())?;
        let mut moved = vec![DAffine3::ZERO; positions.len()];
        for (vertex, joint, share) in followed {
            let by = self.joints[joint];
            moved[vertex].matrix3 += by.matrix3 * share;
            moved[vertex].translation += by.translation * share;
        }
        for (position, moved) in positions.iter_mut().zip(&moved) {
            *position = moved.transform_point3(position.as_dvec3()).as_vec3();
        }
        for (normal, moved) in normals.into_iter().flatten().zip(&moved) {
            let upright = moved.matrix3.inverse().transpose();
            *normal = (upright * normal.as_dvec3()).try_normalize().unwrap_or(DVec3::ZERO).as_vec3();
        }
        Ok(())
    }

    /// Vertex, joint and share of all that follow; the shares of a vertex are 1 in sum.
    fn followed(&self, document: &Document, of: &Attributed, count: usize) -> Result<Vec<(usize, usize, f64)>> {
        let mut followed = Vec::new();
        let mut sums = vec![0.0; count];
        for set in 0..JOINT_SETS {
            let Some(joints) = of.numbers(document, &Semantic::Joints(set), 4, count)? else { break };
            let Some(shares) = of.numbers(document, &Semantic::Weights(set), 4, count)? else { break };
            for (i, (joint, share)) in joints.into_iter().zip(shares).enumerate().filter(|(_, (_, share))| *share > 0.0)
            {
                if joint as usize >= self.joints.len() {
                    let what = format!("joint {joint} is out of range: there are {}", self.joints.len());
                    return Err(document.fail(&of.place, what));
                }
                sums[i / 4] += f64::from(share);
                followed.push((i / 4, joint as usize, f64::from(share)));
            }
        }
        followed.iter_mut().for_each(|(vertex, _, share)| *share /= sums[*vertex]);
        // Vertices that follow no joint go with the first.
        followed.extend(sums.iter().enumerate().filter(|(_, sum)| **sum == 0.0).map(|(vertex, _)| (vertex, 0, 1.0)));
        Ok(followed)
    }
}
