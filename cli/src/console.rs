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
            serde_json::to_writer_pretty(&mut out, json).map_err(std::io::Error::from).and_then(|()| writeln!(out))
        } else {
            out.write_all(text.as_bytes())
        };
        written.and_then(|()| out.flush()).map_err(CliError::Stdout)
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

    fn bar(&self, bar: ProgressBar) -> ProgressBar {
        bar.set_draw_target(if self.progress { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() });
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

/// Writes a line to stderr; if stderr is gone there is nobody to tell.
pub(crate) fn stderr_line(text: &str) {
    let _ = writeln!(std::io::stderr(), "{text}");
}
