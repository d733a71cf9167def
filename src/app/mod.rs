//! The command line: one file a subcommand. Results go to stdout, logs and progress to stderr.

mod bake;
mod bench;
mod check;
mod compare;
mod context;
mod demo;
mod devices;
mod farm;
mod import;
mod inspect;
mod output;
mod outputs;
mod profile;
mod render;
mod source;
#[cfg(feature = "view")]
mod view;

use crate::error::{Error, Result, one_line};
#[cfg(all(unix, feature = "view"))]
use crate::gpu::display;
use crate::gpu::process;
use clap::{Parser, Subcommand};
pub use context::Global;
use std::ffi::OsString;
use std::process::ExitCode;

/// Precomputed shadow fields: shadows of many moving objects under many moving lights, on Vulkan.
///
/// Start with `shadow-fields demo`: it bakes and renders the built-in scenes into out/.
#[derive(Parser)]
#[command(name = "shadow-fields", version, max_term_width = 110)]
struct Cli {
    #[command(flatten)]
    global: Global,
    #[command(subcommand)]
    command: Subcommands,
}

#[derive(Subcommand)]
enum Subcommands {
    /// Bake and render the built-in scenes into a folder and print a table of times
    Demo(demo::Arguments),
    /// Render a scene file to a picture, an animation or a table of vertices
    Render(render::Arguments),
    /// Bake the field of a mesh into an .sf file
    Bake(bake::Arguments),
    /// Write a glTF or OBJ file as a scene file with its meshes, to be edited
    Import(import::Arguments),
    /// Show what is in an .sf file: its header, one lookup
    Inspect(inspect::Arguments),
    /// Measure error, time and stability and write tables
    Bench(bench::Arguments),
    /// Compare every pass with its CPU twin on the chosen device; exit code 1 where one differs by more than its
    /// tolerance
    Check(check::Arguments),
    /// Compare two pictures, made by this program or not; exit code 1 where they differ by more than a bound
    Compare(compare::Arguments),
    /// Time every pass and every variant of the merge shader on this device
    Profile(profile::Arguments),
    /// Open a window: move lights and occluders by hand and see the shadows follow
    #[cfg(feature = "view")]
    View(view::Arguments),
    /// List the Vulkan devices of this machine
    Devices(devices::Arguments),
    /// Share bakes and pictures out among many machines
    #[command(subcommand_required = true, arg_required_else_help = true)]
    Farm(farm::Arguments),
}

/// Runs the program on arguments, the first of which is its name, as the command line does.
pub fn run_on<A: Into<OsString> + Clone>(arguments: impl IntoIterator<Item = A>) -> Result<()> {
    let cli = Cli::try_parse_from(arguments).map_err(|error| Error::Usage(error.to_string()))?;
    run(&cli).and_then(|()| output::written())
}

/// Runs the program on the process's arguments and returns its exit code.
pub fn main() -> ExitCode {
    process::fail_writes_beyond_limit();
    let cli = Cli::try_parse().unwrap_or_else(|error| refuse(error));
    output::start_log(&cli.global);
    match run(&cli).and_then(|()| output::written()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            output::complain(&error);
            // The device of a window whose display is lost still works: exit handlers would unload what it runs.
            #[cfg(all(unix, feature = "view"))]
            if display::is_lost() {
                process::end_at_once(error.exit_code());
            }
            ExitCode::from(error.exit_code())
        }
    }
}

/// Ends the program with what the parser says. It quotes arguments, so it reads them again with their control
/// characters escaped.
fn refuse(error: clap::Error) -> ! {
    let arguments = std::env::args_os().map(|argument| one_line(&argument.to_string_lossy()));
    Cli::try_parse_from(arguments).err().unwrap_or(error).exit()
}

fn run(cli: &Cli) -> Result<()> {
    match &cli.command {
        Subcommands::Demo(arguments) => demo::run(&cli.global, arguments),
        Subcommands::Render(arguments) => render::run(&cli.global, arguments),
        Subcommands::Bake(arguments) => bake::run(&cli.global, arguments),
        Subcommands::Import(arguments) => import::run(&cli.global, arguments),
        Subcommands::Inspect(arguments) => inspect::run(&cli.global, arguments),
        Subcommands::Bench(arguments) => bench::run(&cli.global, arguments),
        Subcommands::Check(arguments) => check::run(&cli.global, arguments),
        Subcommands::Compare(arguments) => compare::run(&cli.global, arguments),
        Subcommands::Profile(arguments) => profile::run(&cli.global, arguments),
        #[cfg(feature = "view")]
        Subcommands::View(arguments) => view::run(&cli.global, arguments),
        Subcommands::Devices(arguments) => devices::run(&cli.global, arguments),
        Subcommands::Farm(arguments) => farm::run(&cli.global, arguments),
    }
}
