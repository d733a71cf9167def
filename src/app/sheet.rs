//! Contact sheets: rows of tiles of one size, under labels.

use crate::asset::{lettering, picture};
use crate::error::Result;
use std::path::Path;

/// Space around tiles and labels, pixels.
const GAP: usize = 4;
/// What is seen between tiles, linear.
const BETWEEN: f32 = 0.35;

pub struct Sheet {
    /// Width and height of a tile in pixels.
    pub tile: [usize; 2],
    /// A line of text, none if empty, and the tiles below it: linear RGB, row by row; NaN is left open.
    pub rows: Vec<(String, Vec<Vec<[f32; 3]>>)>,
}

impl Sheet {
    pub fn write(&self, path: &Path) -> Result<()> {
        let [tile_width, tile_height] = self.tile;
        let text_height = |label: &str| if label.is_empty() { 0 } else { lettering::GLYPH + GAP };
        let row_width = |(label, tiles): &(String, Vec<Vec<[f32; 3]>>)| {
            GAP + (tiles.len() * (tile_width + GAP)).max(lettering::width(label, 1) + GAP)
        };
        let width = self.rows.iter().map(row_width).max().unwrap_or(1);
        let height = GAP + self.rows.iter().map(|(label, _)| text_height(label) + tile_height + GAP).sum::<usize>();
        let mut rgb = vec![BETWEEN; 3 * width * height];
        let mut top = GAP;
        for (label, tiles) in &self.rows {
            lettering::write(&mut rgb, width, (GAP, top), 1, [0.0; 3], label);
            top += text_height(label);
            for (column, tile) in tiles.iter().enumerate() {
                let left = GAP + column * (tile_width + GAP);
                for (y, line) in tile.chunks_exact(tile_width).enumerate() {
                    let places = rgb[3 * ((top + y) * width + left)..].iter_mut();
                    places.zip(line.as_flattened()).filter(|(_, value)| !value.is_nan()).for_each(|(p, v)| *p = *v);
                }
            }
            top += tile_height + GAP;
        }
        picture::write_png(path, width as u32, height as u32, &rgb, 0.0)
    }
}
