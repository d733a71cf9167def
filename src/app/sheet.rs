//! Contact sheets: a grid of unfolded cubes with labels.

use crate::asset::{lettering, picture};
use crate::error::Result;
use std::path::Path;

/// Six faces, +X -X +Y -Y +Z -Z, rows of RGB triples.
pub type Cell = Vec<f32>;

/// Space between cells in pixels.
const GAP: usize = 6;
/// Height of a line of text in pixels.
const TEXT: usize = 12;
/// Width of the labels on the left in pixels.
const MARGIN: usize = 104;
/// Where each face stands in the unfolded cube, in faces from the left and the top.
const PLACES: [(usize, usize); 6] = [(2, 1), (0, 1), (1, 0), (1, 2), (1, 1), (3, 1)];

/// A row of cells with its label on the left, of up to three lines, parted by ", ".
pub struct Row {
    pub label: String,
    pub cells: Vec<Cell>,
    /// The value that is shown as white.
    pub white: f32,
}

struct Canvas {
    width: usize,
    height: usize,
    rgb: Vec<f32>,
}

impl Canvas {
    fn set(&mut self, x: usize, y: usize, rgb: [f32; 3]) {
        if x < self.width && y < self.height {
            self.rgb[3 * (y * self.width + x)..][..3].copy_from_slice(&rgb);
        }
    }

    fn text(&mut self, x: usize, y: usize, text: &str) {
        lettering::write(&mut self.rgb, self.width, (x, y), 1, [0.0; 3], text);
    }
}

/// Writes a sheet: a cell under each column's label in every row.
pub fn write(path: &Path, columns: &[String], rows: &[Row], face_px: usize) -> Result<()> {
    let cell_width = 4 * face_px + GAP;
    let cell_height = 3 * face_px + GAP;
    let width = MARGIN + columns.len() * cell_width;
    let height = TEXT + GAP + rows.len() * cell_height;
    let mut canvas = Canvas { width, height, rgb: vec![0.35; 3 * width * height] };
    for (index, label) in columns.iter().enumerate() {
        canvas.text(MARGIN + index * cell_width, 2, label);
    }
    for (index, Row { label, cells, white }) in rows.iter().enumerate() {
        let top = TEXT + GAP + index * cell_height;
        for (line, words) in label.split(", ").enumerate() {
            canvas.text(GAP, top + face_px / 2 + (TEXT + 2) * line, words);
        }
        for (column, cell) in cells.iter().enumerate() {
            let left = MARGIN + column * cell_width;
            for (texel, rgb) in cell.chunks_exact(3).enumerate() {
                let face = texel / (face_px * face_px);
                let x = texel % face_px;
                let y = texel / face_px % face_px;
                let (right, down) = PLACES[face];
                let value = [rgb[0], rgb[1], rgb[2]].map(|c| c / white);
                canvas.set(left + right * face_px + x, top + down * face_px + y, value);
            }
        }
    }
    picture::write_png(path, width as u32, height as u32, &canvas.rgb, 0.0)
}
