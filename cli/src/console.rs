//! What the user sees while a command works: results on stdout, everything else on stderr.

use std::io::{IsTerminal, Write};
use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use serde::Serialize;

use crate::error::CliError;

/// Where a command talks to.
#[derive(Debug)]
pub(crate) struct Console {
    json: bool,
    progress: bool,
}

impl Console {
    /// With `json`, stdout carries one JSON object instead of text. Progress is shown on a terminal only.
    pub(crate) fn new(json: bool) -> Self {
        Self { json, progress: std::io::stderr().is_terminal() }
    }

    /// Prints a command's result: `json` with `--json`, else `text`.
    pub(crate) fn result(&self, json: &impl Serialize, text: &str) -> Result<(), CliError> {
        let mut out = std::io::stdout().lock();
        let written = if self.json {
            serde_json::to_writer_pretty(&mut out, json)
                .map_err(std::io::Error::from)
                .and_then(|()| writeln!(out))
        } else {
            out.write_all(text.as_bytes())
        };
        written.and_then(|()| out.flush()).map_err(CliError::Stdout)
    }

    /// Prints a line of a result that comes line by line; nothing with `--json`, whose object comes whole.
    pub(crate) fn row(&self, text: &str) -> Result<(), CliError> {
        if self.json {
            return Ok(());
        }
        let mut out = std::io::stdout().lock();
        writeln!(out, "{text}").and_then(|()| out.flush()).map_err(CliError::Stdout)
    }

    /// Tells the user something that is not the result.
    pub(crate) fn note(&self, text: &str) {
        stderr_line(text);
    }

    /// Shows that `what` is being done until the returned value is dropped.
    pub(crate) fn working(&self, what: impl Into<String>) -> Working {
        let bar = self.bar(ProgressBar::no_length());
        bar.set_style(style("{spinner} {msg} {elapsed}"));
        bar.set_message(what.into());
        bar.enable_steady_tick(Duration::from_millis(100));
        Working(bar)
    }

    /// Shows how much of `what` is done until the returned value is dropped.
    pub(crate) fn progress(&self, what: impl Into<String>) -> Progress {
        let bar = self.bar(ProgressBar::new(Progress::STEPS));
        bar.set_style(style("{bar:30} {percent:>3} % {msg} {elapsed}, {eta} left"));
        bar.set_message(what.into());
        Progress(bar)
    }

    fn bar(&self, bar: ProgressBar) -> ProgressBar {
        bar.set_draw_target(if self.progress {
            ProgressDrawTarget::stderr()
        } else {
            ProgressDrawTarget::hidden()
        });
        bar
    }
}

fn style(template: &str) -> ProgressStyle {
    ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar())
}

/// A progress display that goes away when dropped.
#[derive(Debug)]
pub(crate) struct Working(ProgressBar);

impl Drop for Working {
    fn drop(&mut self) {
        self.0.finish_and_clear();
    }
}

/// A progress bar that goes away when dropped.
#[derive(Debug)]
pub(crate) struct Progress(ProgressBar);

impl Progress {
    const STEPS: u64 = 1000;

    /// Shows the share done, in [0, 1]. May be called from any thread and out of order: the bar never goes back.
    pub(crate) fn set(&self, fraction: f32) {
        let position = (fraction.clamp(0.0, 1.0) * Self::STEPS as f32) as u64;
        if position > self.0.position() {
            self.0.set_position(position);
        }
    }

    /// Names what is done now.
    pub(crate) fn at(&self, what: impl Into<String>) {
        self.0.set_message(what.into());
        self.0.tick();
    }

    /// Lets `print` write to the terminal, the bar out of its way.
    pub(crate) fn above<T>(&self, print: impl FnOnce() -> T) -> T {
        self.0.suspend(print)
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.0.finish_and_clear();
    }
}

/// Writes a line to stderr; if stderr is gone there is nobody to tell.
pub(crate) fn stderr_line(text: &str) {
    let _ = writeln!(std::io::stderr(), "{text}");
}
