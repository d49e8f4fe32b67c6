//! The `gnomon` command, run end to end.

mod audit;
mod backends;
mod bad_input;
mod bake;
mod bench;
mod compare;
mod errors;
mod files;
mod help;
mod listings;
mod streams;
mod stress;
mod workbench;
