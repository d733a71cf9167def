//! Wavefront OBJ: a checking reader around `tobj`.
//!
//! The reader accepts `v x y z [w | r g b]` (colours are linear emission), `vt u [v [w]]`, `vn`, and `f` with any
//! number of corners, as `v`, `v/vt`, `v//vn` or `v/vt/vn`, counted from 1 or from the end (-1). Groups, objects,
//! materials, points and lines are skipped: the file is one mesh. If any corner lacks a normal, all normals are
//! computed; vertices are then smooth where faces share an index. If any lacks texture coordinates, the mesh has none.
//! Faces of more than three corners become fans, so they should be convex.
//!
//! `tobj` accepts NaN and indices past the end (some of which it wraps around), panics on faces without corners, and
//! invents missing normals. So every line is checked here first, which also provides the line numbers for messages, and
//! `tobj` receives only checked lines with plain indices.

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

/// State of the reader: counts against which indices are checked, and the checked lines for `tobj`.
#[derive(Default)]
struct Scan {
    checked: String,
    position_total: usize,
    uv_total: usize,
    normal_total: usize,
    position_count: usize,
    uv_count: usize,
    color_count: usize,
    normal_count: usize,
    triangle_count: usize,
    faces: Vec<Vec<Corner>>,
    lacks_uvs: bool,
    lacks_normals: bool,
}

/// Numbers of a corner's position, texture coordinates and normal, counted from 1.
struct Corner {
    position: usize,
    uv: Option<usize>,
    normal: Option<usize>,
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
        let colored = match rest {
            [] => false,
            [w] if *w == 1.0 => false,
            [w] => return Err(format!("weight {w}: only 1 is supported")),
            [r, g, b] if r.min(*g).min(*b) >= 0.0 => true,
            [_, _, _] => return Err("a colour is negative".into()),
            _ => return Err(format!("a position has 3, 4 or 6 numbers, not {}", values.len())),
        };
        if let Some(far) = xyz.iter().find(|c| c.abs() > COORDINATE_LIMIT_M) {
            return Err(format!("coordinate {far} is beyond the limit of {COORDINATE_LIMIT_M:e} m"));
        }
        if colored != (self.color_count > 0) && self.position_count > 0 {
            return Err("some positions have colours and some have none".into());
        }
        self.position_count += 1;
        self.color_count += usize::from(colored);
        self.write("v", if colored { values } else { xyz });
        Ok(())
    }

    fn normal(&mut self, values: &[f32]) -> std::result::Result<(), String> {
        if values.len() != 3 {
            return Err(format!("a normal has 3 numbers, not {}", values.len()));
        }
        self.normal_count += 1;
        self.write("vn", values);
        Ok(())
    }

    fn uv(&mut self, values: &[f32]) -> std::result::Result<(), String> {
        let uv = match values {
            [u] => [*u, 0.0],
            [u, v] | [u, v, _] => [*u, *v],
            _ => return Err(format!("texture coordinates are 1 to 3 numbers, not {}", values.len())),
        };
        self.uv_count += 1;
        self.write("vt", &uv);
        Ok(())
    }

    fn write(&mut self, keyword: &str, values: &[f32]) {
        self.checked += keyword;
        values.iter().for_each(|v| self.checked += &format!(" {v:?}"));
        self.checked += "\n";
    }

    fn face<'a>(&mut self, words: impl Iterator<Item = &'a str>) -> std::result::Result<(), String> {
        let mut corners = Vec::new();
        for word in words {
            let parts: Vec<&str> = word.split('/').collect();
            if parts.len() > 3 {
                return Err(format!("malformed corner {word:?}"));
            }
            let position = index(parts[0], self.position_count, self.position_total, "position")?;
            // Without texture coordinates a mesh only loses its texture.
            let uv = parts.get(1).and_then(|part| index(part, self.uv_count, self.uv_total, "texture coordinate").ok());
            let normal = parts.get(2).map(|part| index(part, self.normal_count, self.normal_total, "normal"));
            let normal = normal.transpose()?;
            self.lacks_uvs |= uv.is_none();
            self.lacks_normals |= normal.is_none();
            corners.push(Corner { position, uv, normal });
        }
        let corner_count = corners.len();
        if corner_count < 3 {
            return Err(format!("a face needs at least three corners, not {corner_count}"));
        }
        self.triangle_count += corner_count - 2;
        if self.triangle_count > TRIANGLE_LIMIT {
            return Err(format!("over the limit of {TRIANGLE_LIMIT} triangles"));
        }
        self.faces.push(corners);
        Ok(())
    }

    fn into_mesh(mut self, name: &str) -> Result<Mesh> {
        if self.triangle_count == 0 {
            return Err(Error::Input("no faces".into()));
        }
        let number = |of: Option<usize>, lacks: bool| of.filter(|_| !lacks).map_or(String::new(), |n| n.to_string());
        for face in &self.faces {
            self.checked += "f";
            for Corner { position, uv, normal } in face {
                // Writing into a string cannot fail.
                let uv = number(*uv, self.lacks_uvs);
                let _ = match number(*normal, self.lacks_normals) {
                    normal if normal.is_empty() => write!(self.checked, " {position}/{uv}"),
                    normal => write!(self.checked, " {position}/{uv}/{normal}"),
                };
            }
            self.checked += "\n";
        }
        let options = tobj::LoadOptions { triangulate: true, ..Default::default() };
        let (models, _) = tobj::load_obj_buf(&mut self.checked.as_bytes(), &options, |_| Ok(Default::default()))
            .map_err(|e| Error::Input(e.to_string()))?;
        let [model] = &models[..] else { return Err(Error::Input(format!("{} objects instead of one", models.len()))) };
        join_indices(name, &model.mesh, !self.lacks_uvs, !self.lacks_normals)
    }
}

/// Gives every triple of position, texture coordinates and normal in use a vertex of its own.
fn join_indices(name: &str, from: &tobj::Mesh, has_uvs: bool, has_normals: bool) -> Result<Mesh> {
    let triple = |values: &[f32], i: u32| Vec3::from_slice(&values[3 * i as usize..]);
    let mut positions = Vec::new();
    let mut normals = Vec::new();
    let mut uvs = Vec::new();
    let mut colors = Vec::new();
    let mut vertices = HashMap::new();
    let mut corners = Vec::with_capacity(from.indices.len());
    for (k, &position) in from.indices.iter().enumerate() {
        let uv = if has_uvs { from.texcoord_indices[k] } else { 0 };
        let normal = if has_normals { from.normal_indices[k] } else { 0 };
        corners.push(*vertices.entry((position, uv, normal)).or_insert_with(|| {
            positions.push(triple(&from.positions, position));
            if has_uvs {
                uvs.push(Vec2::from_slice(&from.texcoords[2 * uv as usize..]));
            }
            if has_normals {
                normals.push(triple(&from.normals, normal));
            }
            if !from.vertex_color.is_empty() {
                colors.push(triple(&from.vertex_color, position));
            }
            positions.len() as u32 - 1
        }));
    }
    let triangles = corners.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect();
    let colors = (!colors.is_empty()).then_some(colors);
    let attributes = Attributes { colors, uvs: has_uvs.then_some(uvs), tints: None };
    Mesh::with_attributes(name, positions, normals, attributes, triangles)
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

/// An index counted from 1, or back from the `count` lines so far if negative, as one counted from 1.
fn index(word: &str, count: usize, total: usize, of: &str) -> std::result::Result<usize, String> {
    let value: i64 = word.parse().map_err(|_| format!("malformed {of} index {word:?}"))?;
    let plain = if value < 0 { value.saturating_add(count as i64 + 1) } else { value };
    if plain < 1 || plain > total as i64 {
        return Err(format!("{of} index {value} is out of range: the file has {total} ({count} up to here)"));
    }
    Ok(plain as usize)
}
