//! Closest hits and packets of shadow rays over an `obvhs` tree.
