//! Text form of lattices, which the command line parses and prints.

use super::Fit;
use super::lattice::{AUTOMATIC, Directions, Lattice, Spacing};

impl std::fmt::Display for Lattice {
    /// Writes the text that parsing accepts.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.directions {
            Directions::Cube { cells } => write!(f, "cube:{}x{cells}", self.shells)?,
            Directions::LatLon { latitudes, longitudes } => {
                write!(f, "latlon:{}x{latitudes}x{longitudes}", self.shells)?;
            }
        }
        let spacing = match self.spacing {
            Spacing::Chord => "chord",
            Spacing::Linear => "linear",
        };
        let stored = if self.scaled { "scaled" } else { "raw" };
        write!(f, ",{spacing},{stored}")?;
        if self.inner != AUTOMATIC {
            write!(f, ",inner={}", self.inner)?;
        }
        write!(f, ",outer={}", self.outer)?;
        match self.edges {
            Some(true) => write!(f, ",edges")?,
            Some(false) => {}
            None => write!(f, ",edges=auto")?,
        }
        let words = |of: [f64; 3]| of.map(|x| x.to_string()).join(":");
        match self.fit {
            Some(fit) if fit == Fit::ROUND => write!(f, ",round"),
            Some(fit) => write!(f, ",centre={},stretch={}", words(fit.centre), words(fit.stretch)),
            None => Ok(()),
        }
    }
}

impl std::str::FromStr for Lattice {
    type Err = String;

    /// `cube:SHELLSxCELLS` or `latlon:SHELLSxLATITUDESxLONGITUDES`, then `,chord,scaled` or `,linear,raw`, and any of
    /// `,inner=R` `,outer=R` `,edges` `,edges=auto` `,round`, or `,centre=X:Y:Z` and `,stretch=X:Y:Z`.
    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let explain = || {
            format!(
                "cannot read lattice \"{text}\": expected cube:18x7 or latlon:8x4x4, then any of ,linear,raw ,inner=R \
                 ,outer=R ,edges ,edges=auto ,round"
            )
        };
        let mut words = text.split(',');
        let (kind, counts) = words.next().and_then(|w| w.split_once(':')).ok_or_else(explain)?;
        let counts: Vec<u32> =
            counts.split('x').map(str::parse).collect::<std::result::Result<_, _>>().map_err(|_| explain())?;
        let mut lattice = Lattice { edges: Some(false), ..Lattice::default() };
        (lattice.shells, lattice.directions) = match (kind, &counts[..]) {
            ("cube", &[shells, cells]) => (shells, Directions::Cube { cells }),
            ("latlon", &[shells, latitudes, longitudes]) => (shells, Directions::LatLon { latitudes, longitudes }),
            _ => return Err(explain()),
        };
        for word in words {
            match word.split_once('=') {
                Some(("edges", "auto")) => lattice.edges = None,
                Some(("inner", radius)) => lattice.inner = radius.parse().map_err(|_| explain())?,
                Some(("outer", radius)) => lattice.outer = radius.parse().map_err(|_| explain())?,
                Some(("centre", words)) => {
                    lattice.fit.get_or_insert(Fit::ROUND).centre = triple(words).ok_or_else(explain)?;
                }
                Some(("stretch", words)) => {
                    lattice.fit.get_or_insert(Fit::ROUND).stretch = triple(words).ok_or_else(explain)?;
                }
                _ => match word {
                    "chord" => lattice.spacing = Spacing::Chord,
                    "linear" => lattice.spacing = Spacing::Linear,
                    "scaled" => lattice.scaled = true,
                    "raw" => lattice.scaled = false,
                    "edges" => lattice.edges = Some(true),
                    "round" => lattice.fit = Some(Fit::ROUND),
                    _ => return Err(explain()),
                },
            }
        }
        lattice.validate().map_err(|error| error.to_string())?;
        Ok(lattice)
    }
}

/// Three numbers separated by colons.
fn triple(words: &str) -> Option<[f64; 3]> {
    let numbers: Vec<f64> = words.split(':').map(|w| w.parse().ok()).collect::<Option<_>>()?;
    numbers.try_into().ok()
}
