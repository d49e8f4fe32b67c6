//! `cargo xtask docs`: the documentation builds without a warning, with and without the GPU half.

use crate::shell::{CheckError, cargo};

pub(crate) fn run() -> Result<(), CheckError> {
    let deny = [("RUSTDOCFLAGS", "-D warnings")];
    cargo(&["doc", "--workspace", "--no-deps"], &deny)?;
    // A link into the GPU half must not dangle where that half is left out.
    cargo(&["doc", "--workspace", "--no-deps", "--no-default-features", "--lib"], &deny)
}
