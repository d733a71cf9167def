//! Wavefront OBJ.
//!
//! The reader accepts `v x y z [w | r g b]` (colours are linear emission), `vt u [v [w]]`, `vn`, and `f` with any number of
//! corners, as `v`, `v/vt`, `v//vn` or `v/vt/vn`, counted from 1 or from the end (-1). Groups, objects, materials, points
//! and lines are skipped: the file is one mesh. If any corner lacks a normal, all normals are computed; vertices are then
//! smooth where faces share an index. If any lacks texture coordinates, the mesh has none. Faces of more than three
//! corners become fans, so they should be convex.

use std::collections::HashMap;
use std::path::Path;

use glam::{Vec2, Vec3};

use super::mesh::{Attributes, COORDINATE_LIMIT_M, Mesh, TRIANGLE_LIMIT};
use crate::error::{Error, Result};

/// Largest file that is read, in bytes: 256 MiB.
pub const FILE_LIMIT_BYTES: u64 = 256 << 20;

impl Mesh {
    /// Reads a Wavefront OBJ file; see [`super::obj`] for the accepted syntax.
    pub fn load(path: &Path) -> Result<Self> {
        Self::parse(&super::read_file(path, FILE_LIMIT_BYTES)?, path)
    }

    /// Reads OBJ text from memory, for files embedded in the binary; `path` is only for messages and the name.
    pub fn parse(bytes: &[u8], path: &Path) -> Result<Self> {
        let text = super::utf8(path, bytes, FILE_LIMIT_BYTES, "mesh")?;
        let total = |keyword| text.lines().filter(|l| l.split_whitespace().next() == Some(keyword)).count();
        let totals = Totals { positions: total("v"), uvs: total("vt"), normals: total("vn") };
        let mut scan = Scan { totals, ..Default::default() };
        for (index, line) in text.lines().enumerate() {
            scan.line(line).map_err(|what| Error::input_at(path, index + 1, what))?;
        }
        let name = path.file_stem().unwrap_or_default().to_string_lossy();
        scan.into_mesh(&name).map_err(|e| e.context(path.display()))
    }
}

/// Numbers of lines in the whole file, which faces may use before they come.
#[derive(Default)]
struct Totals {
    positions: usize,
    uvs: usize,
    normals: usize,
}

/// What was read so far.
#[derive(Default)]
struct Scan {
    totals: Totals,
    positions: Vec<Vec3>,
    /// One a position, or none at all.
    colors: Vec<Vec3>,
    uvs: Vec<Vec2>,
    normals: Vec<Vec3>,
    triangles: Vec<[Corner; 3]>,
    lacks_uvs: bool,
    lacks_normals: bool,
}

/// Numbers of a corner's position, texture coordinates and normal, counted from 0.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
struct Corner {
    position: u32,
    uv: Option<u32>,
    normal: Option<u32>,
}

impl Scan {
    fn line(&mut self, line: &str) -> std::result::Result<(), String> {
        let mut words = line.split('#').next().unwrap_or_default().split_whitespace();
        match words.next() {
            Some("v") => self.position(&numbers(words)?),
            Some("vt") => self.uv(&numbers(words)?),
            Some("vn") => self.normal(&numbers(words)?),
            Some("f") => self.face(words),
            _ => Ok(()),
        }
    }

    fn position(&mut self, values: &[f32]) -> std::result::Result<(), String> {
        let (xyz, rest) = values.split_at_checked(3).ok_or("a position needs three numbers")?;
        let color = match rest {
            [] => None,
            [w] if *w == 1.0 => None,
            [w] => return Err(format!("weight {w}: only 1 is supported")),
            [r, g, b] if r.min(*g).min(*b) >= 0.0 => Some(Vec3::new(*r, *g, *b)),
            [_, _, _] => return Err("a colour is negative".into()),
            _ => return Err(format!("a position has 3, 4 or 6 numbers, not {}", values.len())),
        };
        if let Some(far) = xyz.iter().find(|c| c.abs() > COORDINATE_LIMIT_M) {
            return Err(format!("coordinate {far} is beyond the limit of {COORDINATE_LIMIT_M:e} m"));
        }
        if color.is_none() != self.colors.is_empty() && !self.positions.is_empty() {
            return Err("some positions have colours and some have none".into());
        }
        self.positions.push(Vec3::from_slice(xyz));
        self.colors.extend(color);
        Ok(())
    }

    fn normal(&mut self, values: &[f32]) -> std::result::Result<(), String> {
        if values.len() != 3 {
            return Err(format!("a normal has 3 numbers, not {}", values.len()));
        }
        self.normals.push(Vec3::from_slice(values));
        Ok(())
    }

    fn uv(&mut self, values: &[f32]) -> std::result::Result<(), String> {
        self.uvs.push(match values {
            [u] => Vec2::new(*u, 0.0),
            [u, v] | [u, v, _] => Vec2::new(*u, *v),
            _ => return Err(format!("texture coordinates are 1 to 3 numbers, not {}", values.len())),
        });
        Ok(())
    }

    fn face<'a>(&mut self, words: impl Iterator<Item = &'a str>) -> std::result::Result<(), String> {
        let mut corners = Vec::new();
        for word in words {
            let parts: Vec<&str> = word.split('/').collect();
            if parts.len() > 3 {
                return Err(format!("malformed corner {word:?}"));
            }
            let position = index(parts[0], self.positions.len(), self.totals.positions, "position")?;
            // Without texture coordinates a mesh only loses its texture.
            let uv = parts.get(1).and_then(|part| index(part, self.uvs.len(), self.totals.uvs, "texture").ok());
            let normal = parts.get(2).map(|part| index(part, self.normals.len(), self.totals.normals, "normal"));
            let normal = normal.transpose()?;
            self.lacks_uvs |= uv.is_none();
            self.lacks_normals |= normal.is_none();
            corners.push(Corner { position, uv, normal });
        }
        if corners.len() < 3 {
            return Err(format!("a face needs at least three corners, not {}", corners.len()));
        }
        if self.triangles.len() + corners.len() - 2 > TRIANGLE_LIMIT {
            return Err(format!("over the limit of {TRIANGLE_LIMIT} triangles"));
        }
        self.triangles.extend(corners[1..].windows(2).map(|pair| [corners[0], pair[0], pair[1]]));
        Ok(())
    }

    /// Gives every triple of position, texture coordinates and normal in use a vertex of its own.
    fn into_mesh(self, name: &str) -> Result<Mesh> {
        let mut positions = Vec::new();
        let mut normals = Vec::new();
        let mut uvs = Vec::new();
        let mut colors = Vec::new();
        let mut vertices = HashMap::new();
        let mut vertex = |corner: Corner| {
            let uv = corner.uv.filter(|_| !self.lacks_uvs);
            let normal = corner.normal.filter(|_| !self.lacks_normals);
            *vertices.entry(Corner { uv, normal, ..corner }).or_insert_with(|| {
                positions.push(self.positions[corner.position as usize]);
                uvs.extend(uv.map(|uv| self.uvs[uv as usize]));
                normals.extend(normal.map(|normal| self.normals[normal as usize]));
                colors.extend(self.colors.get(corner.position as usize));
                positions.len() as u32 - 1
            })
        };
        let triangles = self.triangles.iter().map(|triangle| triangle.map(&mut vertex)).collect();
        let colors = (!colors.is_empty()).then_some(colors);
        let uvs = (!self.lacks_uvs).then_some(uvs);
        Mesh::with_attributes(name, positions, normals, Attributes { colors, uvs, tints: None }, triangles)
    }
}

/// The numbers of a line, each finite as f32.
fn numbers<'a>(words: impl Iterator<Item = &'a str>) -> std::result::Result<Vec<f32>, String> {
    words
        .map(|word| match word.parse::<f32>() {
            Ok(value) if value.is_finite() => Ok(value),
            Ok(_) => Err(format!("number {word:?} is not finite")),
            Err(_) => Err(format!("malformed number {word:?}")),
        })
        .collect()
}

/// An index counted from 1, or back from the `count` lines so far if negative, as one counted from 0.
fn index(word: &str, count: usize, total: usize, of: &str) -> std::result::Result<u32, String> {
    let value: i64 = word.parse().map_err(|_| format!("malformed {of} index {word:?}"))?;
    let plain = if value < 0 { value.saturating_add(count as i64 + 1) } else { value };
    if plain < 1 || plain > total as i64 {
        return Err(format!("{of} index {value} is out of range: the file has {total} ({count} up to here)"));
    }
    // A file has fewer lines than u32 counts.
    Ok((plain - 1) as u32)
}
