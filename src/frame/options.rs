//! Options of light and pictures: as users state them, and resolved for a frame.

use crate::bake::cache::Cache;
use crate::bake::{self, BakeOptions};
use crate::bounce::Bounces;
use crate::draw::{Antialias, Shading};
use crate::error::{Error, Result};
use crate::lists::skip::{EPS, Skip};
use crate::merge::variant::Variant;
use crate::scene::data::check_picture;
use crate::scene::{Lights, Scene};

/// Options of a frame: what decides it besides the scene.
#[derive(Clone, Copy, Debug, serde::Serialize, serde::Deserialize)]
pub struct Options {
    /// Fields and transfers.
    pub bake: bake::Options,
    /// Which lights are sharp.
    pub lights: Lights,
    /// Where their light is evaluated for pictures; `None` takes [`Shading::usual`].
    pub shading: Option<Shading>,
    /// How the merge is done; `None` takes what was measured to be the device's fastest.
    pub variant: Option<Variant>,
    /// Contributions that the merge leaves out.
    pub skip: Skip,
    /// Light that the merge leaves out: contributions to a vertex that are bounded below this share of the radiance
    /// that the scene's exposure shows as white; 0 leaves none out.
    pub eps: f32,
    /// How often light bounces from surface to surface.
    #[serde(default)]
    pub bounces: Bounces,
    /// Whether light that microfacets pass on to each other is lost, as in glTF's model.
    #[serde(default)]
    pub single_scatter: bool,
    /// Width and height of the picture in pixels.
    pub size: [u32; 2],
    /// How edges are kept from showing as stairs.
    pub antialias: Antialias,
    /// Whether what draws pictures is compiled beside what lights, and not when the first picture is drawn.
    #[serde(default)]
    pub pictures: bool,
}

impl Options {
    /// Whether pixels evaluate the scene's sharp lights, if it has any.
    pub(super) fn shades_pixels(&self) -> bool {
        self.shading.unwrap_or_else(|| Shading::usual(self.antialias)) == Shading::Pixel
    }

    /// What is baked: without the skip `static` every entity is a group by itself.
    pub(crate) fn baked(&self) -> bake::Options {
        bake::Options { groups: self.bake.groups && self.skip.grouped, ..self.bake }
    }
}

impl Default for Options {
    /// The defaults of `shadow-fields render`, in 960 x 640 pixels.
    fn default() -> Self {
        Options {
            bake: bake::Options::default(),
            lights: Lights::default(),
            shading: None,
            variant: None,
            skip: Skip::ALL,
            eps: EPS,
            bounces: Bounces::default(),
            single_scatter: false,
            size: [960, 640],
            antialias: Antialias::default(),
            pictures: false,
        }
    }
}

/// A user's options besides the scene: one list for programs, the command line and the window.
#[derive(Clone)]
#[cfg_attr(feature = "cli", derive(clap::Args))]
pub struct RenderOptions {
    /// Width and height of pictures in pixels, 1 to 16 384 each; default: the scene's
    #[cfg_attr(feature = "cli", arg(long, value_name = "WxH", value_parser = picture_size))]
    pub size: Option<[u32; 2]>,
    /// How edges are smoothed: by four samples a pixel, by redrawing outlines and creases (faster on a software
    /// device), or not at all. Default: samples, but outlines in a window on a software device while things move
    #[cfg_attr(feature = "cli", arg(long, value_name = "HOW"))]
    pub antialias: Option<Antialias>,
    /// Variant of the merge shader: storage, storage-uniform, texel-packed or texel-shifted. They differ in how they
    /// read fields. Default: the fastest on this device, measured once
    #[cfg_attr(feature = "cli", arg(long, help_heading = LIGHTING, value_name = "NAME", value_parser = Variant::named))]
    pub variant: Option<Variant>,
    /// Work to leave out: all, none, or a list of these with commas:
    ///   horizon  lights and occluders below the horizon of the surface *
    ///   cones    occluders beside the light, as seen from the vertex *
    ///   behind   occluders farther away than the light
    ///   caps     fields of occluders that look small from the vertex, which become points *
    ///   passed   occluders that no ray to a sharp light meets
    ///   covered  sharp lights that one occluder covers whole
    ///   unmoved  clusters of vertices for which nothing has changed
    ///   hidden   triangles that the camera cannot see, and reflections that it cannot
    /// Skips with * change pictures a little; the others do not change what is shown
    #[cfg_attr(
        feature = "cli",
        arg(long, help_heading = LIGHTING, default_value = "all", value_name = "all|none|LIST", verbatim_doc_comment)
    )]
    pub skip: Skip,
    /// Leave out an entity's light or shadow on a vertex where it is bounded below this share of white, 0 to 1; 0
    /// leaves out nothing
    #[cfg_attr(
        feature = "cli",
        arg(
            long,
            help_heading = LIGHTING,
            default_value_t = EPS,
            value_name = "SHARE",
            value_parser = crate::text::number::<f32>(0.0..=1.0),
            allow_negative_numbers = true
        )
    )]
    pub eps: f32,
    /// How lamps are computed
    #[cfg_attr(
        feature = "cli",
        arg(long, help_heading = LIGHTING, value_enum, default_value = "sharp", value_name = "sh|sharp")
    )]
    pub lights: Lights,
    /// How often light bounces from surface to surface
    #[cfg_attr(
        feature = "cli",
        arg(long, help_heading = LIGHTING, value_enum, default_value = "all", value_name = "0|1|all")
    )]
    pub bounces: Bounces,
    /// Lose the light that microfacets pass on to each other, as glTF's own model does: rough metals become up to half
    /// as bright
    #[cfg_attr(feature = "cli", arg(long, help_heading = LIGHTING))]
    pub single_scatter: bool,
    /// Where sharp lights are evaluated for pictures. Default: pixel with four samples a pixel, vertex with one
    #[cfg_attr(feature = "cli", arg(long, help_heading = LIGHTING, value_enum, value_name = "vertex|pixel"))]
    pub shading: Option<Shading>,
    /// How fields are baked.
    #[cfg_attr(feature = "cli", command(flatten))]
    pub bake: BakeOptions,
    /// Where what is baked is kept; `None` is below the cache folder of the device, or in memory where it has none.
    #[cfg_attr(feature = "cli", arg(skip))]
    pub cache: Option<Cache>,
}

/// Heading of the options of light in help texts.
#[cfg(feature = "cli")]
const LIGHTING: &str = "Lighting";

/// Width and height from `WxH`.
#[cfg(feature = "cli")]
pub fn picture_size(text: &str) -> std::result::Result<[u32; 2], String> {
    let pair = text.split_once('x').and_then(|(w, h)| Some([w.parse().ok()?, h.parse().ok()?]));
    pair.filter(|size| check_picture(*size).is_ok())
        .ok_or_else(|| format!("expected a size like 1280x720, got \"{text}\""))
}

impl Default for RenderOptions {
    /// The defaults of `shadow-fields render`.
    fn default() -> Self {
        let Options { lights, shading, variant, skip, eps, bounces, single_scatter, .. } = Options::default();
        let bake = BakeOptions::default();
        RenderOptions {
            size: None,
            antialias: None,
            variant,
            skip,
            eps,
            lights,
            bounces,
            single_scatter,
            shading,
            bake,
            cache: None,
        }
    }
}

impl RenderOptions {
    /// The options of a frame of a scene.
    pub fn frame(&self, scene: &Scene) -> Result<Options> {
        let size = self.size.unwrap_or([scene.data.output.width, scene.data.output.height]);
        check_picture(size).map_err(Error::Input)?;
        if !(0.0..=1.0).contains(&self.eps) {
            return Err(Error::Input(format!("eps {} is not within 0 to 1", self.eps)));
        }
        Ok(Options {
            bake: self.bake.resolve()?,
            lights: self.lights,
            shading: self.shading,
            variant: self.variant,
            skip: self.skip,
            eps: self.eps,
            bounces: self.bounces,
            single_scatter: self.single_scatter,
            size,
            antialias: self.antialias.unwrap_or_default(),
            pictures: true,
        })
    }
}
