//! Wavefront OBJ: a reader, and a writer whose text reads back as the same bits.
//!
//! The reader accepts `v x y z [w | r g b]` (colours are linear emission), `vt u [v [w]]`, `vn`, and `f` with any number of
//! corners, as `v`, `v/vt`, `v//vn` or `v/vt/vn`, counted from 1 or from the end (-1). Groups, objects, materials, points
//! and lines are skipped: the file is one mesh. If any corner lacks a normal, all normals are computed; vertices are then
//! smooth where faces share an index. If any lacks texture coordinates, the mesh has none. Faces of more than three corners become fans, so they
//! should be convex.

use std::collections::HashMap;
use std::fmt::Write as _;
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
        let count = |keyword| text.lines().filter(|l| l.split_whitespace().next() == Some(keyword)).count();
        let mut scan =
            Scan { position_total: count("v"), uv_total: count("vt"), normal_total: count("vn"), ..Default::default() };
        for (index, line) in text.lines().enumerate() {
            scan.line(line).map_err(|what| Error::input_at(path, index + 1, what))?;
        }
        let name = path.file_stem().unwrap_or_default().to_string_lossy();
        scan.into_mesh(&name).map_err(|e| e.context(path.display()))
    }
}

/// What was read so far. Faces may name what follows in later lines, up to the totals.
#[derive(Default)]
struct Scan {
    position_total: usize,
    uv_total: usize,
    normal_total: usize,
    positions: Vec<Vec3>,
    /// One a position, or none.
    colors: Vec<Vec3>,
    uvs: Vec<Vec2>,
    normals: Vec<Vec3>,
    triangles: Vec<[Corner; 3]>,
}

/// Numbers of a corner's position, texture coordinates and normal.
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
        if color.is_some() == self.colors.is_empty() && !self.positions.is_empty() {
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
            let position = index(parts[0], self.positions.len(), self.position_total, "position")?;
            // Without texture coordinates a mesh only loses its texture.
            let uv =
                parts.get(1).and_then(|part| index(part, self.uvs.len(), self.uv_total, "texture coordinate").ok());
            let normal = parts.get(2).map(|part| index(part, self.normals.len(), self.normal_total, "normal"));
            corners.push(Corner { position, uv, normal: normal.transpose()? });
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
        let all = || self.triangles.as_flattened().iter();
        let has_uvs = all().all(|corner| corner.uv.is_some());
        let has_normals = all().all(|corner| corner.normal.is_some());
        let mut used = Vec::new();
        let mut vertices = HashMap::new();
        let mut vertex = |Corner { position, uv, normal }| {
            let corner = Corner { position, uv: uv.filter(|_| has_uvs), normal: normal.filter(|_| has_normals) };
            *vertices.entry(corner).or_insert_with(|| {
                used.push(corner);
                used.len() as u32 - 1
            })
        };
        let triangles = self.triangles.iter().map(|triangle| triangle.map(&mut vertex)).collect();
        let positions = used.iter().map(|corner| self.positions[corner.position as usize]).collect();
        let normals = used.iter().filter_map(|corner| Some(self.normals[corner.normal? as usize])).collect();
        let uvs = used.iter().filter_map(|corner| Some(self.uvs[corner.uv? as usize])).collect();
        let colors = used.iter().map(|corner| self.colors[corner.position as usize]);
        let attributes = Attributes {
            colors: (!self.colors.is_empty()).then(|| colors.collect()),
            uvs: has_uvs.then_some(uvs),
            tints: None,
        };
        Mesh::with_attributes(name, positions, normals, attributes, triangles)
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
    Ok(plain as u32 - 1)
}

/// The mesh as OBJ text, which reads back as the same bits, but for tints, which have no place in it. Equal normals are
/// written once.
pub fn write_obj(mesh: &Mesh) -> String {
    let mut text =
        format!("# {}: {} vertices, {} triangles, metres\n", mesh.name, mesh.positions.len(), mesh.triangles.len());
    // Writing into a string cannot fail. Rust prints the shortest digits that read back as the same f32.
    for (i, p) in mesh.positions.iter().enumerate() {
        let _ = write!(text, "v {} {} {}", p.x, p.y, p.z);
        if let Some(colors) = &mesh.colors {
            let _ = write!(text, " {} {} {}", colors[i].x, colors[i].y, colors[i].z);
        }
        text += "\n";
    }
    let mut numbers = HashMap::new();
    let mut normal_of = Vec::with_capacity(mesh.normals.len());
    for n in &mesh.normals {
        let next = numbers.len() + 1;
        let number = *numbers.entry(n.to_array().map(f32::to_bits)).or_insert(next);
        if number == next {
            let _ = writeln!(text, "vn {} {} {}", n.x, n.y, n.z);
        }
        normal_of.push(number);
    }
    for uv in mesh.uvs.iter().flatten() {
        let _ = writeln!(text, "vt {} {}", uv.x, uv.y);
    }
    for t in &mesh.triangles {
        text += "f";
        for &i in t {
            let uv = if mesh.uvs.is_some() { (i + 1).to_string() } else { String::new() };
            let _ = write!(text, " {}/{uv}/{}", i + 1, normal_of[i as usize]);
        }
        text += "\n";
    }
    text
}
