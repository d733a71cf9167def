//! What a frame leaves out, and the thresholds of it.

/// Work that a frame leaves out. `horizon` and `cones` follow from true visibility, which makes it zero; the band-limited
/// product is not zero there, so each fades out over [`SKIP_FADE_RAD`] beyond its threshold. `caps` takes what is small as seen from
/// a vertex for a point ([`CAP_SINES`]). The others change no number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, serde::Serialize)]
pub struct Skip {
    /// Lights and occluders whose bounding spheres lie below the horizon of the receiving surface.
    pub horizon: bool,
    /// Occluders whose bounding spheres do not reach into a light's, as seen from the vertex.
    pub cones: bool,
    /// Occluders that are farther than the light from a whole cluster of vertices.
    pub behind: bool,
    /// Lights whose radiance field is zero on the side of a cluster.
    pub facing: bool,
    /// Entities whose field holds nothing but zeros.
    pub empty: bool,
    /// Entities that nothing but themselves is lit by: their fields are not baked.
    pub unseen: bool,
    /// The fields of occluders that are small as seen from a vertex: what they block is taken at one direction, with the solid
    /// angle that a fit of the field's outermost shell has for it ([`crate::field::Area`]).
    pub caps: bool,
    /// Clusters of vertices for which nothing has changed since they were last merged.
    pub unmoved: bool,
    /// Clusters of vertices that the camera cannot see, while things move, in pictures; and drawing what it cannot see.
    pub hidden: bool,
}

impl Skip {
    /// Every skip.
    pub const ALL: Skip = Skip {
        horizon: true,
        cones: true,
        behind: true,
        facing: true,
        empty: true,
        unseen: true,
        caps: true,
        unmoved: true,
        hidden: true,
    };
    /// No skip.
    pub const NONE: Skip = Skip {
        horizon: false,
        cones: false,
        behind: false,
        facing: false,
        empty: false,
        unseen: false,
        caps: false,
        unmoved: false,
        hidden: false,
    };
    /// Names on the command line.
    pub const NAMES: [&str; 9] =
        ["horizon", "cones", "behind", "facing", "empty", "unseen", "caps", "unmoved", "hidden"];

    /// The switch of that name.
    pub fn switch(&mut self, name: &str) -> Option<&mut bool> {
        Some(match name {
            "horizon" => &mut self.horizon,
            "cones" => &mut self.cones,
            "behind" => &mut self.behind,
            "facing" => &mut self.facing,
            "empty" => &mut self.empty,
            "unseen" => &mut self.unseen,
            "caps" => &mut self.caps,
            "unmoved" => &mut self.unmoved,
            "hidden" => &mut self.hidden,
            _ => return None,
        })
    }

    /// All but one.
    ///
    /// # Panics
    /// When there is no skip of that name.
    pub fn without(name: &str) -> Self {
        let mut skip = Skip::ALL;
        *skip.switch(name).unwrap_or_else(|| panic!("there is no skip {name}")) = false;
        skip
    }
}

impl std::str::FromStr for Skip {
    type Err = String;
    /// `all`, `none`, or a list of [`Skip::NAMES`] with commas.
    fn from_str(text: &str) -> std::result::Result<Self, String> {
        match text {
            "all" => return Ok(Skip::ALL),
            "none" => return Ok(Skip::NONE),
            _ => {}
        }
        let mut skip = Skip::NONE;
        for word in text.split(',') {
            *skip.switch(word).ok_or_else(|| {
                format!("unknown skip \"{word}\" (all, none, or a list of {})", Skip::NAMES.join(", "))
            })? = true;
        }
        Ok(skip)
    }
}

/// Default threshold of contributions: a quarter of a step of an 8-bit picture.
pub const EPS: f32 = 1e-3;

/// Angle over which a skip fades out: 10 degrees.
pub const SKIP_FADE_RAD: f64 = 10.0 * std::f64::consts::PI / 180.0;

/// Angle by which the cones of occluder and light reach into one another where the occluder counts in full: 20 degrees. Where they meet
/// less, little of the light is behind the occluder, but four bands darken all of it.
pub const CONES_MEET_RAD: f64 = 20.0 * std::f64::consts::PI / 180.0;

/// Sines of the half-angle of an occluder's bounding sphere: it is looked up in its field from the second on, a cap up to the
/// first, and both by shares between.
pub const CAP_SINES: [f64; 2] = [0.21, 0.27];

/// Mean square distance from the middle of what an occluder covers, per solid angle and pi: .5 for a disc, .52 for a cube, .69 and
/// .67 for torus and teapot.
pub const CAP_SPREAD: f64 = 0.58;
