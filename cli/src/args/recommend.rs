//! The words of `gnomon recommend`.

use std::path::PathBuf;

use clap::Args;

use super::SceneArgs;

/// `gnomon recommend`.
#[derive(Args, Debug)]
#[command(after_help = "\
Examples:
  gnomon recommend dragon.obj --max-error 0.05
  gnomon recommend street --max-ms 10 --moving-camera
  gnomon recommend scene.toml --max-error 0.02 --data out/bench/recommend.csv

The scene is drawn in a small picture with ground truth; from its triangles, pixels, penumbrae and the error of a hard shadow a \
model fitted on the measurements of `gnomon bench` names a short list, which is tried on the small picture before one is \
picked. Errors are rmse of V. Times are those of the machine that the measurements are from: for yours take those of a \
`gnomon bench` of your own by --data.")]
pub(crate) struct RecommendArgs {
    #[command(flatten)]
    pub(crate) scene: SceneArgs,
    #[command(flatten)]
    pub(crate) goal: GoalArgs,
    /// Count a frame while only the camera moves: what survives that is not prepared again
    #[arg(long)]
    pub(crate) moving_camera: bool,
    /// Measurements to learn from: the recommend.csv of a `gnomon bench` [default: those of this build]
    #[arg(long, value_name = "FILE")]
    pub(crate) data: Option<PathBuf>,
}

/// What must not be exceeded.
#[derive(Args, Clone, Copy, Debug)]
#[group(required = true, multiple = false)]
pub(crate) struct GoalArgs {
    /// The fastest with at most this rmse
    #[arg(long, value_name = "E", value_parser = parse_limit)]
    pub(crate) max_error: Option<f64>,
    /// The nearest to ground truth within so many milliseconds
    #[arg(long, value_name = "MS", value_parser = parse_limit)]
    pub(crate) max_ms: Option<f64>,
}

fn parse_limit(text: &str) -> Result<f64, String> {
    let limit = text.parse().ok().filter(|limit: &f64| limit.is_finite() && *limit > 0.0);
    limit.ok_or_else(|| "give a number above 0".to_owned())
}
