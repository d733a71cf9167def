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

/// Writes a sheet: `per_column` cells under each column's label, a row label of up to three lines, parted by ", ", on
/// the left. Values up to a row's white are shown.
pub fn write(
    path: &Path,
    columns: &[String],
    per_column: usize,
    rows: &[(String, Vec<Cell>)],
    face_px: usize,
    whites: &[f32],
) -> Result<()> {
    let cell_width = 4 * face_px + GAP;
    let cell_height = 3 * face_px + GAP;
    let width = MARGIN + columns.len() * per_column * cell_width;
    let height = TEXT + GAP + rows.len() * cell_height;
    let mut canvas = Canvas { width, height, rgb: vec![0.35; 3 * width * height] };
    for (index, label) in columns.iter().enumerate() {
        canvas.text(MARGIN + index * per_column * cell_width, 2, label);
    }
    for (row, ((label, cells), white)) in rows.iter().zip(whites).enumerate() {
        let top = TEXT + GAP + row * cell_height;
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
