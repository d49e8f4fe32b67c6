//! `cargo xtask`: the checks of this workspace, one file a command.
//!
//! `cargo xtask ci` runs them all, as CI does.

mod ci;
mod docs;
mod shaders;
mod shell;
mod tidy;
mod vulkan;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

/// Checks of the Gnomon workspace.
#[derive(Parser)]
#[command(name = "cargo xtask", bin_name = "cargo xtask", arg_required_else_help = true)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Everything CI checks, in order; stops at the first failure.
    Ci,
    /// Project rules that no compiler knows: file lengths, sister files of the technique crates, leftovers.
    Tidy,
    /// Links, validates and translates every shader, and holds it against the project's rules.
    Shaders,
    /// Builds the documentation with and without the feature `gpu`; a warning is a failure.
    Docs,
}

fn main() -> ExitCode {
    let result = match Arguments::parse().command {
        Command::Ci => ci::run(),
        Command::Tidy => tidy::run(),
        Command::Shaders => shaders::run(),
        Command::Docs => docs::run(),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("xtask: {error}");
            ExitCode::FAILURE
        }
    }
}
