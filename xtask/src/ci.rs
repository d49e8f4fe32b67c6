//! `cargo xtask ci`: everything CI checks. Cheap checks come first, so that a slip is told early.

use crate::shell::{CheckError, cargo};
use crate::{docs, shaders, tidy, vulkan};

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
    // Release speed with debug assertions and overflow checks. INSTA_UPDATE=no: a missing or changed
    // snapshot fails, nothing is rewritten.
    let mut environment = vec![("INSTA_UPDATE", "no"), ("INSTA_FORCE_PASS", "0")];
    environment.extend(gpu.iter().map(|(name, value)| (*name, value.as_str())));
    cargo(&["test", "--workspace", "--profile", "ci"], &environment)
}
