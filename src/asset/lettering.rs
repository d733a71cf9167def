//! Text in pictures, in glyphs of 8 x 8 pixels.

use font8x8::UnicodeFonts;

/// Edge of a glyph in pixels at size 1, with its spacing.
pub const GLYPH: usize = 8;

pub fn width(text: &str, size: usize) -> usize {
    GLYPH * size * text.chars().count()
}

/// Writes one line into a picture of RGB triples, `picture_width` pixels wide, its upper left corner at (x, y). Pixels
/// outside the picture and characters without a glyph are left out.
pub fn write(rgb: &mut [f32], picture_width: usize, (x, y): (usize, usize), size: usize, color: [f32; 3], text: &str) {
    for (index, letter) in text.chars().enumerate() {
        let rows = font8x8::BASIC_FONTS.get(letter).or_else(|| font8x8::GREEK_FONTS.get(letter)).unwrap_or_default();
        for place in 0..(GLYPH * size).pow(2) {
            let dx = place % (GLYPH * size);
            let dy = place / (GLYPH * size);
            let px = x + index * GLYPH * size + dx;
            let py = y + dy;
            let at = 3 * (py * picture_width + px);
            if rows[dy / size] >> (dx / size) & 1 == 1 && px < picture_width && at + 3 <= rgb.len() {
                rgb[at..at + 3].copy_from_slice(&color);
            }
        }
    }
}
