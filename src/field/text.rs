//! Text form of lattices, which the command line parses and prints.

use super::lattice::{AUTOMATIC, Lattice};

impl std::fmt::Display for Lattice {
    /// Writes the text that parsing accepts, and the fit to an object, which a bake chooses.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "cube:{}x{}", self.shells, self.cells)?;
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
            Some(fit) => write!(f, ",centre={},stretch={}", words(fit.centre), words(fit.stretch)),
            None => Ok(()),
        }
    }
}

impl std::str::FromStr for Lattice {
    type Err = String;

    /// `cube:SHELLSxCELLS`, then any of `,inner=R` `,outer=R` `,edges` `,edges=auto`.
    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let explain = || {
            format!(
                "cannot read lattice \"{text}\": expected cube:20x7, then any of ,inner=R ,outer=R ,edges ,edges=auto"
            )
        };
        let mut words = text.split(',');
        let counts = words.next().and_then(|word| word.strip_prefix("cube:")).and_then(|counts| counts.split_once('x'));
        let count = |text: &str| text.parse::<u32>().map_err(|_| explain());
        let (shells, cells) = counts.ok_or_else(explain)?;
        let mut lattice =
            Lattice { shells: count(shells)?, cells: count(cells)?, edges: Some(false), ..Lattice::default() };
        for word in words {
            match word.split_once('=') {
                Some(("edges", "auto")) => lattice.edges = None,
                Some(("inner", radius)) => lattice.inner = radius.parse().map_err(|_| explain())?,
                Some(("outer", radius)) => lattice.outer = radius.parse().map_err(|_| explain())?,
                None if word == "edges" => lattice.edges = Some(true),
                _ => return Err(explain()),
            }
        }
        lattice.validate().map_err(|error| error.to_string())?;
        Ok(lattice)
    }
}
