//! The `gnomon` command: renders a scene with any shadow technique, holds each against ray-traced ground
//! truth, and says what it cost.
//!
//! A command gathers its input ([`scene_source`], [`techniques`]), measures ([`measure`], [`ground_truth`]), draws
//! ([`picture`], [`compare`]) and puts its files in place at the very end ([`output`]): if anything fails, nothing is written.

mod args;
mod backend;
mod bench;
mod commands;
mod compare;
mod console;
mod error;
mod ground_truth;
mod measure;
mod output;
mod picture;
mod recommend;
mod report;
mod scene_source;
mod source;
mod stress;
mod techniques;

use std::process::ExitCode;

use clap::Parser;

use crate::args::{Arguments, Command};
use crate::console::Console;
use crate::error::CliError;

fn main() -> ExitCode {
    let arguments = match Arguments::try_parse() {
        Ok(arguments) => arguments,
        Err(error) => {
            // Help and version go to stdout, faults to stderr; a closed pipe is nobody's fault.
            let _ = error.print();
            return if error.use_stderr() { error::BAD_INPUT.into() } else { ExitCode::SUCCESS };
        }
    };
    match run(&arguments) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => error.report(),
    }
}

fn run(arguments: &Arguments) -> Result<(), CliError> {
    if let Some(threads) = arguments.global.threads {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(usize::from(threads));
        // One thread is this one, so that a profiler finds all work below its caller.
        let pool = if threads == 1 { pool.use_current_thread() } else { pool };
        pool.build_global().map_err(|error| CliError::Threads(error.to_string()))?;
    }
    let console = Console::new(arguments.global.json);
    match &arguments.command {
        Command::Compare(arguments) => commands::compare::run(arguments, &console),
        Command::Render(arguments) => commands::render::run(arguments, &console),
        Command::Bake(arguments) => commands::bake::run(arguments, &console),
        Command::Reference(arguments) => commands::reference::run(arguments, &console),
        Command::Bench(arguments) => commands::bench::run(arguments, &console),
        Command::Recommend(arguments) => commands::recommend::run(arguments, &console),
        Command::Audit(arguments) => commands::audit::run(arguments, &console),
        Command::Stress(arguments) => commands::stress::run(arguments, &console),
        Command::Techniques(arguments) => commands::techniques::run(arguments, &console),
        Command::Scenes => commands::scenes::run(&console),
    }
}
