//! What a frame leaves out: one row a skip, and the thresholds of it.
//!
//! A new skip touches this table, the shader or function that its row names, and a test.

/// What a skip does to the numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SkipKind {
    /// It changes no number: what it leaves out contributes exactly zero.
    Exact,
    /// It changes numbers a little. `horizon` and `cones` follow from true visibility, which makes what they leave out zero; the
    /// band-limited product is not zero there, so each fades out over [`SKIP_FADE_RAD`] beyond its threshold.
    Approximate,
    /// It keeps what an earlier frame computed, or leaves for later what nobody sees: what is shown changes by no number.
    Incremental,
    /// It leaves out fields that nothing reads, when the scene is prepared.
    Bake,
}

/// What moves while `bench skip` times a skip.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BenchCase {
    /// Nothing: frames without drawing, everything merged in each.
    AtRest,
    /// One thing, frames without drawing.
    OneMoves,
    /// All that casts shadows or shines, frames as a window shows them.
    AllMove,
}

/// One skip.
#[derive(Clone, Copy, Debug)]
pub struct SkipRow {
    /// Name on the command line, and the field of [`Skip`]; without a switch it is always on.
    pub name: &'static str,
    /// What it does to the numbers.
    pub kind: SkipKind,
    /// The file in `src/` and the function that decides it on the host.
    pub host: &'static str,
    /// The macro by which GLSL knows it: in pass "gather" its bit of [`Skip::bits`].
    pub glsl: Option<&'static str>,
    /// Whether the merge shader decides it too, vertex by vertex: then the macro there says whether it is on.
    pub in_merge: bool,
    /// The field of [`crate::lists::gather::Counts`] that says what it left out.
    pub counter: Option<&'static str>,
    /// How `bench skip` times it; `None` where it has no switch.
    pub bench: Option<BenchCase>,
}

macro_rules! skips {
    (
        switches { $($(#[$doc:meta])* $name:ident: $kind:ident, $host:literal, $glsl:expr, $in_merge:literal, $counter:expr, $bench:ident;)* }
        always { $($(#[$always_doc:meta])* $always:ident: $always_kind:ident, $always_host:literal, $always_counter:literal;)* }
    ) => {
        /// The skips that a user can switch, each on or off.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, serde::Serialize)]
        pub struct Skip { $($(#[$doc])* pub $name: bool,)* }

        impl Skip {
            /// Every skip.
            pub const ALL: Skip = Skip { $($name: true,)* };
            /// No skip but those without a switch.
            pub const NONE: Skip = Skip { $($name: false,)* };

            /// The switch of that name.
            pub fn switch(&mut self, name: &str) -> Option<&mut bool> {
                match name {
                    $(stringify!($name) => Some(&mut self.$name),)*
                    _ => None,
                }
            }

            /// Every switch in the order of [`TABLE`].
            fn values(self) -> impl Iterator<Item = bool> {
                [$(self.$name),*].into_iter()
            }
        }

        /// Every skip: first those with a switch, then those that are always on.
        pub const TABLE: &[SkipRow] = &[
            $(SkipRow { name: stringify!($name), kind: SkipKind::$kind, host: $host, glsl: $glsl,
                in_merge: $in_merge, counter: $counter, bench: Some(BenchCase::$bench) },)*
            $(SkipRow { name: stringify!($always), kind: SkipKind::$always_kind, host: $always_host, glsl: None,
                in_merge: false, counter: Some($always_counter), bench: None },)*
        ];
    };
}

skips! {
    switches {
        /// Lights and occluders whose bounding spheres lie below the horizon of the receiving surface.
        horizon: Approximate, "lists/scope.rs view", Some("SKIP_HORIZON"), true, Some("below_horizon"), AtRest;
        /// Occluders whose bounding spheres do not reach into a light's, as seen from the vertex.
        cones: Approximate, "lists/scope.rs apart", Some("SKIP_CONES"), true, Some("apart"), AtRest;
        /// Occluders that are farther than the light from a whole cluster of vertices.
        behind: Exact, "lists/scope.rs occluder_result", Some("SKIP_BEHIND"), false, Some("behind_light"), AtRest;
        /// The fields of occluders that are small as seen from a vertex: what they block is taken at one direction ([`CAP_SINES`]), with
        /// the solid angle that a fit of the field's outermost shell has for it ([`crate::field::Area`]).
        caps: Approximate, "lists/scope.rs view", Some("SKIP_CAPS"), true, Some("caps"), AtRest;
        /// Occluders that every ray from a cluster to a sharp light passes by, on lists that the host makes.
        passed: Exact, "lists/scope.rs outline_result", None, false, Some("passed_by"), AtRest;
        /// Sharp lights of which one occluder covers all from a whole cluster, on lists that the host makes.
        covered: Exact, "lists/scope.rs outline_result", None, false, Some("covered"), AtRest;
        /// Clusters of vertices for which nothing has changed since they were last merged.
        unmoved: Incremental, "lists/incremental.rs update", None, false, None, OneMoves;
        /// Clusters that the camera cannot see, in pictures of a moving scene, and triangles that it cannot see.
        hidden: Incremental, "lists/sight.rs may_see", None, false, Some("hidden"), AllMove;
    }
    always {
        /// Lights whose radiance field is zero on the side of a cluster.
        facing: Exact, "lists/scope.rs light_result", "facing_away";
        /// Entities whose field holds nothing but zeros.
        empty: Exact, "frame/pose.rs entity_bounds", "empty";
        /// Entities that nothing but themselves is lit by: their fields are not baked.
        unseen: Bake, "bake/ensure.rs needs", "unseen";
        /// Light and shadow that is bounded below `--eps`.
        eps: Approximate, "lists/scope.rs of_weight", "below_eps";
    }
}

/// The rows with a switch.
pub fn switches() -> impl Iterator<Item = &'static SkipRow> {
    TABLE.iter().filter(|row| row.bench.is_some())
}

/// The row of that name.
pub fn row(name: &str) -> Option<&'static SkipRow> {
    TABLE.iter().find(|row| row.name == name)
}

impl Skip {
    /// All but one.
    ///
    /// # Panics
    /// When there is no skip of that name.
    pub fn without(name: &str) -> Self {
        let mut skip = Skip::ALL;
        *skip.switch(name).unwrap_or_else(|| panic!("there is no skip {name}")) = false;
        skip
    }

    /// The constants that GLSL knows, with what each is: the bit of a row is its place among them.
    fn constants(self) -> impl Iterator<Item = (&'static str, bool)> {
        switches().zip(self.values()).filter_map(|(row, on)| Some((row.glsl?, on)))
    }

    /// The defines of the merge shader, with what each is.
    pub fn merge_defines(self) -> impl Iterator<Item = (&'static str, bool)> {
        switches().zip(self.values()).filter_map(|(row, on)| Some((row.glsl.filter(|_| row.in_merge)?, on)))
    }

    /// Macros of pass "gather": the bit of each.
    pub fn gather_defines() -> impl Iterator<Item = (&'static str, u32)> {
        Skip::ALL.constants().enumerate().map(|(bit, (name, _))| (name, 1 << bit))
    }

    /// The switches as bits.
    pub fn bits(self) -> u32 {
        self.constants().enumerate().map(|(bit, (_, on))| u32::from(on) << bit).sum()
    }
}

impl std::str::FromStr for Skip {
    type Err = String;
    /// `all`, `none`, or a list of names of [`switches`] with commas.
    fn from_str(text: &str) -> std::result::Result<Self, String> {
        match text {
            "all" => return Ok(Skip::ALL),
            "none" => return Ok(Skip::NONE),
            _ => {}
        }
        let mut skip = Skip::NONE;
        for word in text.split(',') {
            *skip.switch(word).ok_or_else(|| {
                let names: Vec<_> = switches().map(|row| row.name).collect();
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

/// Angle by which the cones of occluder and light reach into one another where the occluder counts in full: 20 degrees. Where they meet
/// less, little of the light is behind the occluder, but four bands darken all of it.
pub const CONES_MEET_RAD: f64 = 20.0 * std::f64::consts::PI / 180.0;

/// Sines of the half-angle of an occluder's bounding sphere: it is looked up in its field from the second on, a cap up to the
/// first, and both by shares between.
pub const CAP_SINES: [f64; 2] = [0.21, 0.27];

/// Mean square distance from the middle of what an occluder covers, per solid angle and pi: 0.5 for a disc, 0.52 for a cube, 0.69
/// and 0.67 for torus and teapot.
pub const CAP_SPREAD: f64 = 0.58;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_switch_can_be_named_and_has_its_own_bit() {
        for row in switches() {
            let mut only = Skip::NONE;
            *only.switch(row.name).unwrap() = true;
            assert_eq!(row.name.parse(), Ok(only));
            assert_eq!(Skip::without(row.name).bits() | only.bits(), Skip::ALL.bits());
            assert_eq!(row.glsl.is_some(), only.bits().count_ones() == 1, "{row:?}");
        }
        assert_eq!(Skip::ALL.bits(), (1 << Skip::ALL.constants().count()) - 1);
        assert!("facing".parse::<Skip>().unwrap_err().contains("horizon, cones, behind"), "always on");
    }

    #[test]
    fn every_rule_is_where_its_row_says() {
        for row in TABLE {
            let (file, function) = row.host.split_once(' ').unwrap();
            let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("src").join(file);
            let text = std::fs::read_to_string(path).unwrap();
            assert!(text.contains(&format!("fn {function}(")), "{row:?}");
        }
    }

    #[test]
    fn every_macro_stands_in_the_shaders_that_its_row_names() {
        let text = |file: &str| {
            let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("glsl").join(file);
            std::fs::read_to_string(path).unwrap()
        };
        let gather = text("gather_scope.glsl");
        let merge = ["merge.comp", "merge_cone.glsl", "merge_cap.glsl"].map(text).concat();
        for row in TABLE {
            let is_used = |shader: &str| row.glsl.is_some_and(|name| shader.contains(name));
            assert_eq!(is_used(&gather), row.glsl.is_some(), "{row:?}");
            assert_eq!(is_used(&merge), row.in_merge, "{row:?}");
        }
    }

    #[test]
    fn every_counter_is_one_of_the_counts() {
        let counts = serde_json::to_value(crate::lists::gather::Counts::default()).unwrap();
        for row in TABLE {
            assert!(row.counter.is_none_or(|name| counts.get(name).is_some()), "{row:?}");
        }
    }
}
