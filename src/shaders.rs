//! Every shader of the program: entry points and includes embedded in the binary, a folder that overrides them, and the
//! text that is generated from the tables of [`crate::sh`].

use crate::error::{Error, Result};
use crate::field::cuboid::{ENTERED, NEAREST_EDGE, PARALLEL};
use crate::field::quantity::channel_stride;
use crate::field::self_visibility;
use crate::field::silhouette::{LEAST_PENUMBRA, LEAST_STEP, NEAREST, NO_BOX, TOUCHING};
use crate::files;
use crate::gpu::shader::ShaderSource;
use crate::gpu::{Shader, Stage};
use crate::layout::{self, shared_macros};
use crate::sh;
use crate::sh::product_program::glsl_subtract;
use crate::sh::rotation::glsl_rotate;
use std::path::PathBuf;

/// File name and text of everything in `glsl/`, as the build script lists it.
pub const FILES: &[(&str, &str)] = include!(concat!(env!("OUT_DIR"), "/shaders.rs"));

/// One compilation of one entry point. It contains everything that changes the compiled code, and all of it is the
/// cache key.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct ShaderPermutation {
    /// File in `glsl/`; its ending decides the stage.
    pub file: &'static str,
    /// SH bands that generated includes are made for; defines BANDS, COEFFICIENTS and STRIDE.
    pub bands: usize,
    /// Further macros.
    pub defines: Vec<(&'static str, String)>,
}

impl ShaderPermutation {
    /// A permutation without further macros.
    pub fn new(file: &'static str, bands: usize) -> Self {
        ShaderPermutation { file, bands, defines: Vec::new() }
    }

    /// Adds a macro.
    pub fn define(mut self, name: &'static str, value: impl Into<u32>) -> Self {
        self.defines.push((name, value.into().to_string()));
        self
    }

    /// Adds the macros of `self_visibility.glsl`.
    pub fn self_visibility(self) -> Self {
        self.define("SELF_SIDE", self_visibility::SIDE as u32)
            .number("SELF_RIM", self_visibility::RIM)
            .number("SELF_LIMIT", self_visibility::LIMIT_RAD)
            .number("SELF_STEPS", self_visibility::DISTANCE_STEPS)
            .number("SELF_FIRST", self_visibility::DISTANCE_FIRST)
            .number("SELF_RAMP", self_visibility::RAMP)
    }

    /// Adds the macros of `outline.glsl` and `cuboid.glsl`.
    pub fn outlines(self) -> Self {
        self.number("NEAREST", NEAREST)
            .number("NEAREST_EDGE", NEAREST_EDGE)
            .number("PARALLEL", PARALLEL)
            .number("ENTERED", ENTERED)
            .number("NO_BOX", NO_BOX)
            .number("TOUCHING", TOUCHING)
            .number("LEAST_STEP", LEAST_STEP)
            .number("LEAST_PENUMBRA", LEAST_PENUMBRA)
    }

    /// Adds a macro whose value is an f32.
    pub fn number(mut self, name: &'static str, value: f64) -> Self {
        self.defines.push((name, format!("({:?})", value as f32)));
        self
    }
}

/// Where shader text comes from and where compiled code is kept.
#[derive(Clone, Debug, Default)]
pub struct Library {
    /// Files here are used instead of the embedded ones of the same name.
    pub shader_dir: Option<PathBuf>,
    /// Folder of the SPIR-V cache.
    pub cache_dir: Option<PathBuf>,
}

impl Library {
    /// Compiles a permutation, or reads it from the cache.
    pub fn shader(&self, row: &ShaderPermutation) -> Result<Shader> {
        self.compiled(row, false)
    }

    /// The same with its loops unrolled, whose arithmetic can be counted.
    pub fn unrolled(&self, row: &ShaderPermutation) -> Result<Shader> {
        self.compiled(row, true)
    }

    fn compiled(&self, row: &ShaderPermutation, optimised: bool) -> Result<Shader> {
        let stage = match row.file.rsplit('.').next() {
            Some("comp") => Stage::Compute,
            Some("vert") => Stage::Vertex,
            Some("frag") => Stage::Fragment,
            _ => return Err(Error::Failed(format!("{}: not the name of an entry point", row.file))),
        };
        let of_bands = [
            ("BANDS", row.bands),
            ("COEFFICIENTS", sh::basis::coefficient_count(row.bands)),
            ("STRIDE", channel_stride(row.bands)),
        ];
        let of_bands = of_bands.map(|(name, value)| (name, value.to_string()));
        let defines = [&of_bands[..], &shared_macros(), &row.defines].concat();
        let include = |name: &str| match name.strip_prefix("generated/") {
            Some(generated) => generate(generated, row),
            None => self.text(name).ok(),
        };
        let text = self.text(row.file)?;
        let source = ShaderSource { name: row.file, stage, text, defines: &defines, optimised, include: &include };
        Shader::compile(&source, self.cache_dir.as_deref())
    }

    fn text(&self, name: &str) -> Result<String> {
        if let Some(path) = self.shader_dir.as_ref().map(|folder| folder.join(name))
            && path.exists()
        {
            let text = files::open(&path).and_then(std::io::read_to_string);
            return text.map_err(|error| Error::input(&path, format!("cannot be read: {error}")));
        }
        FILES
            .iter()
            .find(|(file, _)| *file == name)
            .map(|(_, text)| (*text).to_owned())
            .ok_or_else(|| Error::Failed(format!("there is no shader file \"{name}\"")))
    }
}

/// Text of a generated include. Includes are resolved before the preprocessor removes any, so a permutation may also
/// request includes that it does not use.
fn generate(name: &str, row: &ShaderPermutation) -> Option<String> {
    let bands = row.bands;
    match name {
        "basis.glsl" => Some(sh::basis::glsl_basis(bands)),
        "cosine.glsl" => Some(sh::lobe::glsl_clamped_cosine(bands)),
        "product.glsl" => Some(glsl_subtract(bands)),
        "rotate.glsl" => Some(glsl_rotate(bands)),
        _ => layout::glsl(name),
    }
}
