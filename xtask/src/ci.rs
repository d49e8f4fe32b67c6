//! `cargo xtask ci`: everything CI checks. Cheap checks come first, so that a slip is told early.

use crate::shell::{CheckError, cargo};
use crate::snapshots::Report;
use crate::{docs, gallery, instructions, package, shaders, test_binaries, tidy, vulkan};

pub(crate) fn run() -> Result<(), CheckError> {
    tidy::run()?;
    shaders::run()?;
    // Found or installed before the long steps: without it the last one would fail.
    let gpu = vulkan::environment()?;
    cargo(&["fmt", "--all", "--check"], &[])?;
    // Every feature combination there is: `gpu` on or off.
    let deny = ["--", "-D", "warnings"];
    cargo(&[&["clippy", "--workspace", "--all-targets"][..], &deny].concat(), &[])?;
    cargo(&[&["clippy", "--workspace", "--all-targets", "--no-default-features"][..], &deny].concat(), &[])?;
    docs::run()?;
    package::run()?;
    // Release speed with debug assertions and overflow checks. A missing or changed snapshot fails, nothing in the tree
    // is rewritten; what differs is shown by a page.
    let report = Report::new()?;
    let environment = report.environment().into_iter().chain(gpu);
    let environment: Vec<_> = environment.collect();
    let environment: Vec<_> = environment.iter().map(|(name, value)| (*name, value.as_str())).collect();
    // Examples are not built again: clippy has compiled them, and tests that want one take its code.
    let tested = test_binaries::run(&environment);
    // Where tests failed some have asked for nothing.
    let found = report.write(tested.is_ok())?;
    tested?;
    if let Some(finding) = found.first() {
        return Err(CheckError::Failed(format!("{}: {}", finding.name(), finding.why())));
    }
    cargo(&["test", "--workspace", "--profile", "ci", "--doc"], &environment)?;
    gallery::run_built(true)?;
    instructions::run_built(false)
}
