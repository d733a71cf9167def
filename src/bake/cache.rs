//! Baked fields and transfers on disk, found again by the content of the mesh and everything else that decides them.

use super::partial::Partial;
use super::{Baker, Progress, Report, TRANSFER_OFFSET};
use crate::asset::mesh::Mesh;
use crate::error::Result;
use crate::field::file::{self, TRANSFER_MAGIC, VERSION};
use crate::field::quantity::channel_stride;
use crate::field::{FieldHeader, ShadowField};
use crate::gpu::Buffer;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// A folder of baked things; without one, everything is baked anew.
#[derive(Clone, Debug, Default)]
pub struct Cache {
    folder: Option<PathBuf>,
}

/// Header of a cached transfer file.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
struct TransferHeader {
    mesh_hash: String,
    bands: usize,
    face_px: u32,
    offset: f32,
    vertex_count: usize,
}

impl TransferHeader {
    fn new(mesh: &Mesh, bands: usize, face_px: u32) -> Self {
        TransferHeader {
            mesh_hash: super::hash_text(mesh),
            bands,
            face_px,
            offset: TRANSFER_OFFSET,
            vertex_count: mesh.positions.len(),
        }
    }
}

fn key(header: &impl Serialize) -> String {
    let text = serde_json::to_vec(header).expect("headers are plain data");
    blake3::Hasher::new().update(&VERSION.to_le_bytes()).update(&text).finalize().to_hex()[..32].to_owned()
}

/// What decides a field: the header without the name for people and without what only the bake finds out.
fn identity(header: &FieldHeader) -> FieldHeader {
    FieldHeader {
        mesh: String::new(),
        filled_samples: 0,
        captured_samples: 0,
        symmetry: String::new(),
        growth: 0.0,
        ..header.clone()
    }
}

/// Name of a field: the same for all that come out the same.
pub fn field_name(header: &FieldHeader) -> String {
    key(&identity(header))
}

impl Cache {
    /// A cache below `folder`, or none.
    pub fn new(folder: Option<&Path>) -> Self {
        Cache { folder: folder.map(|f| f.join("fields")) }
    }

    fn path(&self, key: &str, ending: &str) -> Option<PathBuf> {
        Some(self.folder.as_ref()?.join(format!("{key}.{ending}")))
    }

    /// Whether the field that `header` describes is on disk.
    pub fn has_field(&self, header: &FieldHeader) -> bool {
        self.path(&field_name(header), "sf").is_some_and(|path| path.exists())
    }

    /// Whether the transfer vectors of a mesh are on disk.
    pub fn has_transfer(&self, mesh: &Mesh, bands: usize, face_px: u32) -> bool {
        self.path(&key(&TransferHeader::new(mesh, bands, face_px)), "transfer").is_some_and(|path| path.exists())
    }

    /// Puts the field that `header` describes into `store` at `offset_bytes`: from disk, else baked and kept. Returns the
    /// report of a bake, `None` when it was found.
    ///
    /// # Errors
    /// As [`Baker::field`]. A damaged or unreadable cache file is baked anew.
    pub fn field(
        &self,
        baker: &Baker,
        mesh: &Mesh,
        header: &mut FieldHeader,
        (store, offset_bytes): (&mut Buffer, u64),
        progress: Progress<'_>,
    ) -> Result<Option<Report>> {
        let path = self.path(&field_name(header), "sf");
        if let Some(path) = path.as_ref().filter(|path| path.exists()) {
            match ShadowField::read(path) {
                Ok(found) if identity(&found.header) == identity(header) => {
                    *header = FieldHeader { mesh: header.mesh.clone(), ..found.header };
                    store.fill(offset_bytes, &found.payload)?;
                    return Ok(None);
                }
                Ok(_) => log::warn!("{}: does not fit its name; baking anew", path.display()),
                Err(error) => log::warn!("{error}; baking anew"),
            }
        }
        let partial = Partial::new(path.as_ref().map(|path| path.with_extension("part")));
        let report = baker.field_from(&partial, mesh, header, (store, offset_bytes), progress)?;
        if let Some(path) = path {
            let payload = store.download_range(offset_bytes..offset_bytes + header.payload_bytes())?;
            let field = ShadowField { header: header.clone(), payload };
            if let Err(error) = field.write(&path) {
                log::warn!("{error}; the field was not cached");
            }
        }
        Ok(Some(report))
    }

    /// The transfer vectors of a mesh: from disk, else baked and kept.
    ///
    /// # Errors
    /// As [`Baker::transfer`].
    pub fn transfer(
        &self,
        baker: &Baker,
        mesh: &Mesh,
        bands: usize,
        face_px: u32,
        progress: Progress<'_>,
    ) -> Result<(Vec<f32>, Option<Report>)> {
        let header = TransferHeader::new(mesh, bands, face_px);
        let path = self.path(&key(&header), "transfer");
        if let Some(path) = path.as_ref().filter(|path| path.exists()) {
            match file::read::<TransferHeader>(path, TRANSFER_MAGIC) {
                Ok((found, payload))
                    if found == header && payload.len() == 4 * header.vertex_count * channel_stride(bands) =>
                {
                    let floats = payload.chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().expect("four bytes")));
                    return Ok((floats.collect(), None));
                }
                Ok(_) => log::warn!("{}: does not fit its name; baking anew", path.display()),
                Err(error) => log::warn!("{error}; baking anew"),
            }
        }
        let partial = Partial::new(path.as_ref().map(|path| path.with_extension("transfer-part")));
        let (transfer, report) = baker.transfer_from(&partial, mesh, bands, face_px, progress)?;
        if let Some(path) = path
            && let Err(error) = file::write(&path, TRANSFER_MAGIC, &header, bytemuck::cast_slice(&transfer))
        {
            log::warn!("{error}; the transfer was not cached");
        }
        Ok((transfer, Some(report)))
    }
}
