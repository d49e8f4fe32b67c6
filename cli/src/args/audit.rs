//! The words of `gnomon audit`.

use clap::Args;

use super::{Backend, parse_size};

/// `gnomon audit`.
#[derive(Args, Debug)]
#[command(after_help = "\
Examples:
  gnomon audit
  gnomon audit street forest:triangles=1000000 --variants
  gnomon audit dragon.obj --techniques shadow-map --backend cpu,gpu

Every technique runs with its setting `skip` on and off, in turn; the images have to be alike to the bit. Times are medians of \
prepare and shade together, off / on is what skipping gains: below 1 it costs.")]
pub(crate) struct AuditArgs {
    /// Scenes: files, meshes or built-in ones [default: every built-in scene]
    #[arg(value_name = "SCENE")]
    pub(crate) scenes: Vec<String>,
    /// Techniques, separated by commas [default: all]
    #[arg(long, value_name = "A,B", value_delimiter = ',')]
    pub(crate) techniques: Vec<String>,
    /// Every variant of each technique, not its default one alone
    #[arg(long)]
    pub(crate) variants: bool,
    /// Image size in pixels
    #[arg(long, value_name = "WxH", value_parser = parse_size, default_value = "512x512")]
    pub(crate) size: (u32, u32),
    /// Which of each scene's lights, counted from 0
    #[arg(long, value_name = "INDEX", default_value_t = 0)]
    pub(crate) light: usize,
    /// Where techniques run; cpu,gpu measures both
    #[arg(long, value_enum, value_name = "BACKEND", value_delimiter = ',', default_value = "cpu")]
    pub(crate) backend: Vec<Backend>,
    /// Timed runs of each; none begins after two seconds
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u16).range(1..=1000))]
    pub(crate) runs: u16,
    /// Seed of all random choices
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) seed: u64,
}
