//! Errors of a visibility image against ground truth.
