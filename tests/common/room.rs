//! One small scene for all tests of the window: a floor, a ball and a lamp, which is the last entity.

#![allow(dead_code)] // every test binary uses its own part

use std::path::{Path, PathBuf};

/// Its text for pictures of a size, with more keys of the lamp, each behind a comma.
pub fn text([width, height]: [u32; 2], of_the_lamp: &str) -> String {
    format!(
        r#"
output = {{ width = {width}, height = {height} }}
camera = {{ eye = [0, 1.5, 5], target = [0, 0, 0] }}
environment = {{ gradient = {{ radiance = [0.3, 0.35, 0.4] }} }}
mesh = [
    {{ name = "floor", plane = {{ size_m = 6, cells = 24 }} }},
    {{ name = "ball", sphere = {{ radius_m = 0.6, subdivisions = 2 }} }},
]
entity = [
    {{ name = "floor", mesh = "floor", position = [0, -0.6, 0] }},
    {{ name = "ball", mesh = "ball" }},
    {{ name = "lamp", mesh = "ball", position = [1.4, 1.1, 0], scale = 0.3, emission = [30, 24, 12]{of_the_lamp} }},
]
"#
    )
}

/// Writes it as `scene.toml`, beside which a window saves what it is told to.
pub fn write(folder: &Path, size: [u32; 2], of_the_lamp: &str) -> PathBuf {
    std::fs::create_dir_all(folder).unwrap();
    let path = folder.join("scene.toml");
    std::fs::write(&path, text(size, of_the_lamp)).unwrap();
    path
}

/// Pixels that differ by more than the rounding of two encoders, whatever is behind their colours.
pub fn apart<const N: usize, const M: usize>(a: &[[u8; N]], b: &[[u8; M]]) -> usize {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).filter(|(a, b)| (0..3).any(|c| a[c].abs_diff(b[c]) > 1)).count()
}
