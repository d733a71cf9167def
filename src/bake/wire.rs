//! What a bake and its worker processes say to each other: over a pipe, a header in JSON with the bytes that belong to it.
//!
//! ```text
//! 0  u32  header length in bytes, little-endian
//! 4  u64  length of the bytes that follow the header
//! 12 header, then the bytes
//! ```

use super::batches::Reduction;
use crate::asset::Mesh;
use crate::error::{Error, Result};
use crate::field::Shortcuts;
use glam::Vec3;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::io::{self, Read, Write};

/// Longest header that is read.
const HEADER_LIMIT: u32 = 64 << 10;

/// What a bake asks of a worker.
#[derive(Serialize, Deserialize)]
pub(super) enum Request {
    /// What the following samples have in common. The mesh's arrays follow.
    Begin { mesh: MeshShape, reduction: Reduction, face_px: u32, shortcuts: Shortcuts, levels: bool },
    /// Captures of planned targets, which follow.
    Capture,
}

/// What a worker answers.
#[derive(Serialize, Deserialize)]
pub(super) enum Answer {
    /// The first thing that it says.
    Hello(Identity),
    /// It is ready for targets of the mesh.
    Ready,
    /// The reduced samples follow; what they took.
    Samples { capture_ms: f64, project_ms: f64, faces: u32, triangles: u64 },
    /// It failed with this exit code and message.
    Failed { code: u8, message: String },
}

/// What decides which bytes a process makes of the same input.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Identity {
    pub program: String,
    pub device: String,
    pub driver: String,
}

impl Identity {
    /// The identity of this process on a device.
    pub fn own(device: &crate::gpu::Device) -> Self {
        Identity {
            program: super::PROGRAM.into(),
            device: device.info.name.clone(),
            driver: device.info.driver.clone(),
        }
    }
}

impl std::fmt::Display for Identity {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} on {} ({})", self.program, self.device, self.driver)
    }
}

/// The lengths of a mesh's arrays.
#[derive(Serialize, Deserialize)]
pub(super) struct MeshShape {
    name: String,
    vertices: usize,
    colored: bool,
    triangles: usize,
    hash: [u8; 32],
}

impl MeshShape {
    pub fn of(mesh: &Mesh) -> Self {
        MeshShape {
            name: mesh.name.clone(),
            vertices: mesh.positions.len(),
            colored: mesh.colors.is_some(),
            triangles: mesh.triangles.len(),
            hash: mesh.content_hash(),
        }
    }

    /// The arrays of a mesh one after another.
    pub fn arrays(mesh: &Mesh) -> [&[u8]; 4] {
        let colors = mesh.colors.as_deref().unwrap_or_default();
        let of = |vectors| bytemuck::cast_slice::<Vec3, u8>(vectors);
        [of(&mesh.positions), of(&mesh.normals), of(colors), bytemuck::cast_slice(&mesh.triangles)]
    }

    /// The mesh of these arrays.
    ///
    /// # Errors
    /// `Failed` where they are not those of the mesh that was sent.
    pub fn mesh(self, arrays: &[u8]) -> Result<Mesh> {
        let broken = || Error::Failed(format!("mesh {}: it arrived damaged", self.name));
        let lengths = [self.vertices, self.vertices, if self.colored { self.vertices } else { 0 }, self.triangles];
        if arrays.len() != 12 * lengths.iter().sum::<usize>() {
            return Err(broken());
        }
        let mut rest = arrays;
        let [positions, normals, colors, triangles] = lengths.map(|count| {
            let (now, later) = rest.split_at(12 * count);
            rest = later;
            now
        });
        let vectors = bytemuck::pod_collect_to_vec::<u8, Vec3>;
        let colors = self.colored.then(|| vectors(colors));
        let triangles = bytemuck::pod_collect_to_vec::<u8, [u32; 3]>(triangles);
        let mesh = Mesh::new(self.name.clone(), vectors(positions), vectors(normals), colors, triangles)?;
        if mesh.content_hash() == self.hash { Ok(mesh) } else { Err(broken()) }
    }
}

/// Sends a message and the bytes that belong to it.
///
/// # Errors
/// What the pipe returns.
pub(super) fn send(to: &mut impl Write, message: &impl Serialize, bytes: &[&[u8]]) -> io::Result<()> {
    let header = serde_json::to_vec(message).expect("messages are plain data");
    to.write_all(&(header.len() as u32).to_le_bytes())?;
    to.write_all(&bytes.iter().map(|part| part.len() as u64).sum::<u64>().to_le_bytes())?;
    to.write_all(&header)?;
    bytes.iter().try_for_each(|part| to.write_all(part))?;
    to.flush()
}

/// Receives a message and the bytes that belong to it.
///
/// # Errors
/// What the pipe returns; `InvalidData` where it holds something else.
pub(super) fn receive<M: DeserializeOwned>(from: &mut impl Read) -> io::Result<(M, Vec<u8>)> {
    let (mut header, mut length) = ([0; 4], [0; 8]);
    from.read_exact(&mut header)?;
    from.read_exact(&mut length)?;
    let (header, length) = (u32::from_le_bytes(header), u64::from_le_bytes(length));
    if header > HEADER_LIMIT {
        return Err(io::Error::new(io::ErrorKind::InvalidData, format!("a header of {header} bytes")));
    }
    let mut text = vec![0; header as usize];
    from.read_exact(&mut text)?;
    // A length that is wrong takes no more memory than what arrives.
    let mut bytes = Vec::new();
    if from.take(length).read_to_end(&mut bytes)? as u64 != length {
        return Err(io::ErrorKind::UnexpectedEof.into());
    }
    Ok((serde_json::from_slice(&text)?, bytes))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::generate;

    #[test]
    fn messages_and_meshes_arrive_as_they_were_sent() {
        for mesh in [generate::torus(1.0, 0.3, 12, 6), generate::torus_two_colour(1.0, 0.3, 12, 6)] {
            let mut pipe = Vec::new();
            send(&mut pipe, &MeshShape::of(&mesh), &MeshShape::arrays(&mesh)).unwrap();
            let (shape, arrays) = receive::<MeshShape>(&mut pipe.as_slice()).unwrap();
            assert!(shape.mesh(&arrays).unwrap() == mesh);
            let (shape, mut arrays) = receive::<MeshShape>(&mut pipe.as_slice()).unwrap();
            arrays[5] ^= 1;
            assert!(shape.mesh(&arrays).unwrap_err().to_string().contains("damaged"));
        }
    }

    #[test]
    fn what_is_cut_short_or_of_another_program_is_an_error() {
        let mut pipe = Vec::new();
        send(&mut pipe, &Answer::Ready, &[&[1, 2, 3]]).unwrap();
        for length in 0..pipe.len() {
            assert!(receive::<Answer>(&mut &pipe[..length]).is_err(), "{length} bytes");
        }
        assert!(receive::<Answer>(&mut pipe.as_slice()).is_ok());
        assert!(receive::<Answer>(&mut &b"Usage: another program [OPTIONS]"[..]).is_err());
    }
}
