//! `shadow-fields pages`: shell completions and manual pages, which `scripts/package` puts into the package.

use super::Cli;
use crate::error::{Error, Result};
use clap::{Args, CommandFactory};
use clap_complete::Shell;
use std::path::PathBuf;

/// Arguments of `pages`.
#[derive(Args)]
pub struct Arguments {
    /// Folder for a manual page of every command and a file of completions for every shell
    #[arg(value_name = "DIR")]
    folder: PathBuf,
}

/// Writes all files; what stands there under their names is replaced.
pub fn run(arguments: &Arguments) -> Result<()> {
    let folder = &arguments.folder;
    let unwritten = |error: std::io::Error| Error::Failed(format!("{}: cannot be written: {error}", folder.display()));
    std::fs::create_dir_all(folder).map_err(unwritten)?;
    let mut command = Cli::command();
    for shell in [Shell::Bash, Shell::Zsh, Shell::Fish] {
        clap_complete::generate_to(shell, &mut command, "shadow-fields", folder).map_err(unwritten)?;
    }
    clap_mangen::generate_to(Cli::command(), folder).map_err(unwritten)
}
