//! `cargo xtask`: the checks of this workspace, one file a command.
//!
//! `cargo xtask ci` runs them all, as CI does.

mod apt;
mod bench;
mod ci;
mod docs;
mod gallery;
mod html;
mod instructions;
mod package;
mod results;
mod shaders;
mod shell;
mod snapshots;
mod test_binaries;
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
    /// Golden pictures and text snapshots; a failing run leaves a page with expected, actual and difference.
    Snapshots {
        /// Put what differs into the tree.
        #[arg(long)]
        accept: bool,
    },
    /// Makes the figures of the READMEs by the command.
    Gallery {
        /// Write nothing; a figure that is missing or stale is a failure.
        #[arg(long)]
        check: bool,
    },
    /// Packs every crate and builds it from its package.
    Package,
    /// Runs benches and collects their tables in target/bench.
    Bench {
        /// Crates or benches [default: all]
        names: Vec<String>,
        /// Arguments of the benches themselves, such as `-- --quick`
        #[arg(last = true)]
        arguments: Vec<String>,
    },
    /// Counts the instructions of every technique by valgrind, and compares with what is kept.
    Instructions {
        /// Keep what was counted.
        #[arg(long)]
        accept: bool,
    },
    /// Runs what README.md and RESULTS.md say their figures are made by, and puts the output there.
    Results {
        /// Only blocks whose line holds one of these [default: all]
        words: Vec<String>,
    },
    /// Builds the documentation with and without the feature `gpu`; a warning is a failure.
    Docs,
}

fn main() -> ExitCode {
    let result = match Arguments::parse().command {
        Command::Ci => ci::run(),
        Command::Tidy => tidy::run(),
        Command::Shaders => shaders::run(),
        Command::Docs => docs::run(),
        Command::Snapshots { accept } => snapshots::run(accept),
        Command::Gallery { check } => gallery::run(check),
        Command::Instructions { accept } => instructions::run(accept),
        Command::Results { words } => results::run(&words),
        Command::Package => package::run(),
        Command::Bench { names, arguments } => bench::run(&names, &arguments),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("xtask: {error}");
            ExitCode::FAILURE
        }
    }
}
