//! What a frame leaves out: one row a skip, and the thresholds.
//!
//! Most skips change no number: what they leave out contributes exactly zero, was computed before or is not seen.
//! `horizon`, `cones`, `caps` and `static` change numbers a little. `horizon` and `cones` follow from true visibility,
//! which makes what they leave out zero; the band-limited product is not zero there, so each fades out over
//! [`SKIP_FADE_RAD`] beyond its threshold.
//!
//! A new skip touches this table, the shader that its row names, and a test. Some skips have no switch: spots whose cone
//! a cluster is out of, entities whose field holds nothing but zeros, fields that no receiver sees, and what is bounded
//! below `--eps`.

#[derive(Clone, Copy, Debug)]
pub struct SkipRow {
    pub name: &'static str,
    /// The macro of the merge shader, where that decides it too, vertex by vertex.
    pub glsl: Option<&'static str>,
}

macro_rules! skips {
    ($($(#[$doc:meta])* $name:ident $text:literal: $glsl:expr;)*) => {
        /// The skips that a user can switch, each on or off.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
        pub struct Skip { $($(#[$doc])* pub $name: bool,)* }

        impl Skip {
            pub const ALL: Skip = Skip { $($name: true,)* };
            /// No skip but those without a switch.
            pub const NONE: Skip = Skip { $($name: false,)* };

            pub fn switch(&mut self, name: &str) -> Option<&mut bool> {
                match name {
                    $($text => Some(&mut self.$name),)*
                    _ => None,
                }
            }

            /// Every switch in the order of [`TABLE`].
            fn values(self) -> impl Iterator<Item = bool> {
                [$(self.$name),*].into_iter()
            }
        }

        pub const TABLE: &[SkipRow] = &[
            $(SkipRow { name: $text, glsl: $glsl },)*
        ];
    };
}

skips! {
    /// Lights and occluders whose bounding spheres lie below the horizon of the receiving surface.
    horizon "horizon": Some("SKIP_HORIZON");
    /// Occluders whose bounding spheres do not reach into a light's, as seen from the vertex.
    cones "cones": Some("SKIP_CONES");
    /// Occluders that are farther than the light from a whole cluster of vertices.
    behind "behind": None;
    /// The fields of occluders that are small as seen from a vertex: what they block is taken at one direction
    /// ([`CAP_SINES`]), with the solid angle that a fit of the field's outermost shell has for it
    /// ([`crate::field::Area`]).
    caps "caps": Some("SKIP_CAPS");
    /// Occluders that every ray from a cluster to a sharp light passes by.
    passed "passed": None;
    /// Sharp lights of which one occluder covers all from a whole cluster.
    covered "covered": None;
    /// Occluders that never move against the receiver: its own visibility has their shadows, exactly where they touch.
    grouped "static": None;
    /// Clusters of vertices for which nothing has changed since they were last merged.
    unmoved "unmoved": None;
    /// Triangles that the camera cannot see, and the reflections of clusters that it cannot.
    hidden "hidden": None;
}

impl Skip {
    /// All but one, which there must be.
    pub fn without(name: &str) -> Self {
        let mut skip = Skip::ALL;
        *skip.switch(name).unwrap_or_else(|| panic!("there is no skip {name}")) = false;
        skip
    }

    /// The defines of the merge shader, with what each is.
    pub fn merge_defines(self) -> impl Iterator<Item = (&'static str, bool)> {
        TABLE.iter().zip(self.values()).filter_map(|(row, on)| Some((row.glsl?, on)))
    }
}

impl std::str::FromStr for Skip {
    type Err = String;
    /// `all`, `none`, or a list of names of [`TABLE`] with commas.
    fn from_str(text: &str) -> std::result::Result<Self, String> {
        match text {
            "all" => return Ok(Skip::ALL),
            "none" => return Ok(Skip::NONE),
            _ => {}
        }
        let mut skip = Skip::NONE;
        for word in text.split(',') {
            *skip.switch(word).ok_or_else(|| {
                let names: Vec<_> = TABLE.iter().map(|row| row.name).collect();
                format!("unknown skip \"{word}\" (all, none, or a list of {})", names.join(", "))
            })? = true;
        }
        Ok(skip)
    }
}

/// Default threshold of contributions: a quarter of a step of an 8-bit picture.
pub const EPS: f32 = 1e-3;

/// Angle over which a skip fades out: 10 degrees.
pub const SKIP_FADE_RAD: f64 = 10.0 * std::f64::consts::PI / 180.0;

/// Angle by which the cones of occluder and light reach into one another where the occluder counts in full: 20 degrees.
/// Where they meet less, little of the light is behind the occluder, but four bands darken all of it.
pub const CONES_MEET_RAD: f64 = 20.0 * std::f64::consts::PI / 180.0;

/// Sines of the half-angle of an occluder's bounding sphere: it is looked up in its field from the second on, a cap up
/// to the first, and both by shares between.
pub const CAP_SINES: [f64; 2] = [0.21, 0.27];

/// Mean square distance from the middle of what an occluder covers, per solid angle and pi: 0.5 for a disc, 0.52 for a
/// cube, 0.69 and 0.67 for torus and teapot.
pub const CAP_SPREAD: f64 = 0.58;
