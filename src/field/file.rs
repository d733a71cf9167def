//! Format of field files: a prologue with magic bytes, version and lengths, a JSON header, a payload, and one hash over
//! all of it. Numbers are little-endian. A file is written under a temporary name and then renamed.
//!
//! ```text
//! 0   8 bytes  magic: what kind of file
//! 8   u32      version
//! 12  u32      header length in bytes
//! 16  u64      payload length in bytes
//! 24  32 bytes BLAKE3 over bytes 0..24, header and payload
//! 56  header, then payload, then the end of the file
//! ```

use super::{FieldHeader, ShadowField};
use crate::error::{Error, Result, one_line};
use crate::files;
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::io::Read;
use std::path::Path;

pub const FIELD_MAGIC: [u8; 8] = *b"SHFIELD\n";
pub const SURFACES_MAGIC: [u8; 8] = *b"SHSURFA\n";
pub const VOLUME_MAGIC: [u8; 8] = *b"SHVOLUM\n";
/// Version that this program writes and reads. It increases whenever the meaning of header or payload changes.
pub const VERSION: u32 = 15;
/// Largest payload that is read: 4 GiB.
pub const PAYLOAD_LIMIT: u64 = 4 << 30;
const PROLOGUE: usize = 56;

fn seal(prologue: &[u8], header: &[u8], payload: &[u8]) -> [u8; 32] {
    let mut hasher = blake3::Hasher::new();
    hasher.update(prologue).update(header).update(payload);
    *hasher.finalize().as_bytes()
}

pub fn write<H: Serialize>(path: &Path, magic: [u8; 8], header: &H, payload: &[u8]) -> Result<()> {
    let header = serde_json::to_vec(header).expect("headers are plain data");
    let mut bytes = magic.to_vec();
    bytes.extend(VERSION.to_le_bytes());
    bytes.extend((header.len() as u32).to_le_bytes());
    bytes.extend((payload.len() as u64).to_le_bytes());
    let hash = seal(&bytes, &header, payload);
    bytes.extend(hash);
    bytes.extend(&header);
    files::replace_parts(path, &[&bytes, payload])
        .map_err(|error| Error::input(path, format!("cannot be written: {error}")))
}

/// Reads what [`write()`] wrote. Lengths are checked against the file's size before memory is allocated for them.
pub fn read<H: DeserializeOwned>(path: &Path, magic: [u8; 8]) -> Result<(H, Vec<u8>)> {
    let unread = |error| Error::input(path, format!("cannot be read: {error}"));
    let file = files::open(path).map_err(unread)?;
    let size = file.metadata().map_err(unread)?.len();
    read_from(file, size, path, magic)
}

/// As [`read`], of the bytes of the file `path`, which are that many.
pub fn read_from<H: DeserializeOwned>(
    mut bytes: impl Read,
    size: u64,
    path: &Path,
    magic: [u8; 8],
) -> Result<(H, Vec<u8>)> {
    let bad = |what: String| Error::input(path, what);
    let mut prologue = [0; PROLOGUE];
    bytes.read_exact(&mut prologue).map_err(|_| bad(format!("{size} bytes are too short for a field file")))?;
    if prologue[..8] != magic {
        return Err(bad("not a field file of this kind (magic bytes differ)".into()));
    }
    let word = |at: usize| u32::from_le_bytes(prologue[at..at + 4].try_into().expect("four bytes"));
    if word(8) != VERSION {
        return Err(bad(format!("version {}, this program reads version {VERSION}", word(8))));
    }
    let header_len = u64::from(word(12));
    let payload_len = u64::from_le_bytes(prologue[16..24].try_into().expect("eight bytes"));
    if payload_len > PAYLOAD_LIMIT {
        return Err(bad(format!("claims a payload of {payload_len} bytes")));
    }
    if PROLOGUE as u64 + header_len + payload_len != size {
        return Err(bad(format!(
            "claims {} bytes but has {size}: cut short or damaged",
            PROLOGUE as u64 + header_len + payload_len
        )));
    }
    let mut header = vec![0; header_len as usize];
    let mut payload = vec![0; payload_len as usize];
    bytes
        .read_exact(&mut header)
        .and_then(|()| bytes.read_exact(&mut payload))
        .map_err(|error| bad(format!("cannot be read: {error}")))?;
    if seal(&prologue[..24], &header, &payload) != prologue[24..] {
        return Err(bad("damaged: the hash over header and payload does not match".into()));
    }
    let header = serde_json::from_slice(&header)
        .map_err(|error| bad(format!("malformed header: {}", one_line(&error.to_string()))))?;
    Ok((header, payload))
}

impl ShadowField {
    pub fn write(&self, path: &Path) -> Result<()> {
        write(path, FIELD_MAGIC, &self.header, &self.payload)
    }

    pub fn read(path: &Path) -> Result<Self> {
        let (header, payload) = read(path, FIELD_MAGIC)?;
        Self::new(header, payload).map_err(|error| Error::input(path, error))
    }

    pub fn new(header: FieldHeader, payload: Vec<u8>) -> Result<Self> {
        header.validate()?;
        if header.payload_bytes() != payload.len() as u64 {
            let claimed = header.payload_bytes();
            let found = payload.len();
            return Err(Error::Input(format!("the header claims {claimed} bytes of samples, {found} are there")));
        }
        Ok(ShadowField { header, payload })
    }
}
