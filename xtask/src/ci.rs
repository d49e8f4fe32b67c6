//! `cargo xtask ci`: everything CI checks. Cheap checks come first, so that a slip is told early.

use crate::shell::{CheckError, cargo};
use crate::{docs, tidy};

pub(crate) fn run() -> Result<(), CheckError> {
    tidy::run()?;
    cargo(&["fmt", "--all", "--check"], &[])?;
    // Every feature combination there is: `gpu` on or off.
    let deny = ["--", "-D", "warnings"];
    cargo(&[&["clippy", "--workspace", "--all-targets"][..], &deny].concat(), &[])?;
    cargo(&[&["clippy", "--workspace", "--all-targets", "--no-default-features"][..], &deny].concat(), &[])?;
    docs::run()?;
    // Release speed with debug assertions and overflow checks. INSTA_UPDATE=no: a missing or changed
    // snapshot fails, nothing is rewritten.
    let environment = [("INSTA_UPDATE", "no"), ("INSTA_FORCE_PASS", "0")];
    cargo(&["test", "--workspace", "--profile", "ci"], &environment)
}
