//! The command line: what can be asked, and its help.

mod audit;
mod recommend;

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};

use crate::bench::shard::Shard;
use crate::bench::station::Axis;

pub(crate) use audit::AuditArgs;
pub(crate) use recommend::RecommendArgs;

/// Real-time shadow techniques, measured against ray-traced ground truth.
///
/// Gnomon renders a scene with any of its shadow techniques, holds each against ground truth and says what it
/// cost in milliseconds, bytes and error. What it measures is visibility: the fraction of a light that a
/// point sees, 1 lit, 0 in full shadow (umbra), between them penumbra.
#[derive(Debug, Parser)]
#[command(
    name = "gnomon",
    version,
    arg_required_else_help = true,
    max_term_width = 100,
    after_help = "\
Examples:
  gnomon compare dragon.obj            every technique beside ground truth, in out/dragon/index.html
  gnomon render chess --technique shadow-map --out out/chess
  gnomon reference cornell --samples 1024 --out out/truth
  gnomon bake park -o park.pdsm        soft shadows of what stands still, in a file
  gnomon bench ball quads              run time against error, in out/bench/index.html
  gnomon recommend dragon.obj --max-error 0.05
  gnomon techniques shadow-map         its settings, their units, ranges and defaults
  gnomon scenes                        built-in scenes and their parameters

Exit codes: 0 done, 1 a check failed, 2 bad usage or input, 3 no GPU where one was required.
If a command fails, none of its files are written."
)]
pub(crate) struct Arguments {
    #[command(flatten)]
    pub(crate) global: GlobalArgs,
    #[command(subcommand)]
    pub(crate) command: Command,
}

/// Options of every command.
#[derive(Args, Debug)]
pub(crate) struct GlobalArgs {
    /// Print one JSON object on stdout and nothing else there (nothing if the command fails)
    #[arg(long, global = true, help_heading = "Common options")]
    pub(crate) json: bool,
    /// Threads to compute with [default: one per core]
    #[arg(
        long,
        global = true,
        value_name = "N",
        help_heading = "Common options",
        value_parser = clap::value_parser!(u16).range(1..=1024)
    )]
    pub(crate) threads: Option<u16>,
}

/// What to do.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Every technique beside ground truth: contact sheet, error maps, table, HTML page
    Compare(CompareArgs),
    /// Shadows of one light by one technique
    Render(RenderArgs),
    /// Soft shadows of what stands still, computed once, in a file for `render --baked`
    Bake(BakeArgs),
    /// Ground truth: visibility by ray tracing, with an error estimate
    Reference(ReferenceArgs),
    /// Run time against error over every technique, variant and preset: charts, tables, HTML page
    Bench(BenchArgs),
    /// Every technique on scenes that are hard on numbers; exit code 1 if one fails
    Stress(StressArgs),
    /// The technique, variant and preset for a scene and an error or a time not to exceed
    Recommend(RecommendArgs),
    /// What skipping saves, technique by scene, and that it changes no image; exit code 1 if it does
    Audit(AuditArgs),
    /// Techniques with their settings, units, ranges, defaults and presets
    Techniques(TechniquesArgs),
    /// Built-in scenes and their parameters
    #[command(after_help = "\
Examples:
  gnomon scenes
  gnomon compare ball:height=1.2 --time 0.4      a scene with a parameter set, after 0.4 seconds")]
    Scenes,
}

/// Which picture of which scene.
#[derive(Args, Debug)]
pub(crate) struct SceneArgs {
    /// A scene file (.toml, .json), a mesh (.obj, .gltf, .glb) or a built-in scene (`gnomon scenes`)
    ///
    /// A bare mesh gets a ground, a camera and a light. A built-in scene takes parameters:
    /// NAME:key=value,key=value. If a file has the name of a built-in scene, write ./NAME for
    /// the file.
    #[arg(value_name = "SCENE")]
    pub(crate) scene: String,
    /// Image size in pixels [default: the scene's]
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    pub(crate) size: Option<(u32, u32)>,
    /// Which of the scene's lights, counted from 0
    #[arg(long, value_name = "INDEX", default_value_t = 0)]
    pub(crate) light: usize,
    /// Seconds by which what moves in a built-in scene has moved [default: 0]
    #[arg(long, value_name = "T", value_parser = parse_time, allow_hyphen_values = true)]
    pub(crate) time: Option<f32>,
    /// Seed of all random choices: the same seed gives the same image, whatever the number of threads
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) seed: u64,
}

/// How ground truth is sampled.
#[derive(Args, Debug)]
pub(crate) struct TruthArgs {
    /// Shadow rays a pixel, rounded up to an even number
    ///
    /// A light without extent takes one, whatever this says. The error falls about as N^-0.75.
    #[arg(long, value_name = "N", default_value_t = 256, value_parser = clap::value_parser!(u32).range(1..=65_536))]
    pub(crate) samples: u32,
    /// Compute the visible part of the light's area without sampling: slow, and free of noise
    ///
    /// For rect and disk lights, suns up to 1.3° in radius and lights without extent; behind cut-out masks still by samples.
    #[arg(long)]
    pub(crate) exact: bool,
    /// Take as many samples a pixel as a standard error of about E takes, at most --samples
    ///
    /// `gnomon reference` writes what each pixel reached beside its V.
    #[arg(long, value_name = "E", conflicts_with = "exact", value_parser = parse_fraction)]
    pub(crate) max_error: Option<f32>,
}

/// `gnomon compare`.
#[derive(Args, Debug)]
#[command(after_help = "\
Examples:
  gnomon compare dragon.obj
  gnomon compare dragon.obj --variants
  gnomon compare cornell --size 256x256 --out out/cornell
  gnomon compare scene.toml --techniques shadow-map,shadow-map@high --samples 1024
  gnomon compare chess --backend cpu,gpu

Writes index.html (open it: a slider between any two images), contact-sheet.png, strip.png (the shaded images \
alone), table.csv and report.json.

Errors are taken over valid pixels: those whose surface faces the light (n·l > 0.05) with the whole light \
above it. mae is the mean of |error|, rmse the root of its mean square, p99 its 99th percentile, pen_rmse the \
rmse in and around penumbrae. Times are of the fastest of up to three runs; ground truth runs once. On the GPU \
they go from recording to the end of its work; uploads of the scene and making of pipelines are not in them.")]
pub(crate) struct CompareArgs {
    #[command(flatten)]
    pub(crate) scene: SceneArgs,
    #[command(flatten)]
    pub(crate) truth: TruthArgs,
    /// Techniques, separated by commas; NAME@PRESET takes a preset [default: all]
    #[arg(long, value_name = "A,B", value_delimiter = ',')]
    pub(crate) techniques: Vec<String>,
    /// Every variant of each technique, not its default one alone
    #[arg(long)]
    pub(crate) variants: bool,
    /// Where techniques run; cpu,gpu shows both side by side
    #[arg(long, value_enum, value_name = "BACKEND", value_delimiter = ',', default_value = "auto")]
    pub(crate) backend: Vec<Backend>,
    /// Error at which the error maps saturate
    #[arg(long, value_name = "E", default_value_t = 0.5, value_parser = parse_fraction)]
    pub(crate) error_scale: f32,
    /// Folder to write to [default: out/NAME, by the scene]
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
}

/// `gnomon render`.
#[derive(Args, Debug)]
#[command(after_help = "\
Examples:
  gnomon render chess --technique shadow-map --out out/chess
  gnomon render dragon.obj --technique shadow-map --set map_size=4096 --out out/dragon
  gnomon render quads:squares=5 --technique shadow-map --size 640x480 --json --out out/quads
  gnomon render park --baked park.pdsm --out out/park

Writes image.png (shaded), visibility.png (grey, transparent where nothing is seen), visibility.npy (float32, \
H×W, NaN where nothing is seen) and report.json (milliseconds per stage, bytes, what was skipped).")]
pub(crate) struct RenderArgs {
    #[command(flatten)]
    pub(crate) scene: SceneArgs,
    /// The technique; `gnomon techniques` lists them
    #[arg(long, value_name = "NAME", required_unless_present = "baked")]
    pub(crate) technique: Option<String>,
    /// Take what `gnomon bake` wrote in place of a technique; settings are those it was baked with
    ///
    /// The light and all objects that are not `dynamic` must be those that it was baked for.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["technique", "preset", "set"])]
    pub(crate) baked: Option<PathBuf>,
    /// A rung of the technique's quality ladder, to start the settings from [default: the defaults]
    #[arg(long, value_name = "NAME")]
    pub(crate) preset: Option<String>,
    /// A setting, on top of the preset; may be repeated
    #[arg(long, value_name = "KEY=VALUE", value_parser = parse_setting)]
    pub(crate) set: Vec<(String, String)>,
    /// Where the technique runs
    #[arg(long, value_enum, default_value_t)]
    pub(crate) backend: Backend,
    /// Folder to write to; files of the same names are replaced
    #[arg(long, value_name = "DIR")]
    pub(crate) out: PathBuf,
}

/// `gnomon bake`.
#[derive(Args, Debug)]
#[command(after_help = "\
Examples:
  gnomon bake park -o park.pdsm
  gnomon bake dragon.obj --preset high --set precision=half --out dragon.pdsm
  gnomon bake chess --set only_surfaces=true -o chess.pdsm

Builds the penumbra deep shadow map of one light (`gnomon techniques pdsm` lists its settings) over all objects that are \
not `dynamic`, and writes it with a version and a checksum. It holds for every camera.")]
pub(crate) struct BakeArgs {
    #[command(flatten)]
    pub(crate) scene: SceneArgs,
    /// A rung of pdsm's quality ladder, to start the settings from [default: the defaults]
    #[arg(long, value_name = "NAME")]
    pub(crate) preset: Option<String>,
    /// A setting of pdsm, on top of the preset; may be repeated
    #[arg(long, value_name = "KEY=VALUE", value_parser = parse_setting)]
    pub(crate) set: Vec<(String, String)>,
    /// File to write to; one that is there is replaced when the new one is whole
    #[arg(short, long, value_name = "FILE")]
    pub(crate) out: PathBuf,
}

/// `gnomon reference`.
#[derive(Args, Debug)]
#[command(after_help = "\
Examples:
  gnomon reference cornell --out out/truth
  gnomon reference dragon.obj --samples 1024 --size 512x512 --out out/dragon-truth
  gnomon reference quads --exact --out out/exact
  gnomon reference knot --max-error 0.005 --samples 4096 --out out/knot-truth

Writes image.png, visibility.png and report.json as `render` does, and NumPy arrays: visibility.npy and \
std_error.npy (float32, H×W: V and the standard error of each pixel's V, NaN where nothing is seen), valid.npy \
(bool, H×W: which pixels may be compared) and position.npy (float32, H×W×3: world-space positions).")]
pub(crate) struct ReferenceArgs {
    #[command(flatten)]
    pub(crate) scene: SceneArgs,
    #[command(flatten)]
    pub(crate) truth: TruthArgs,
    /// Folder to write to; files of the same names are replaced
    #[arg(long, value_name = "DIR")]
    pub(crate) out: PathBuf,
}

/// `gnomon bench`.
#[derive(Args, Debug)]
#[command(after_help = "\
Examples:
  gnomon bench                                       every built-in scene
  gnomon bench ball dragon.obj --defaults            untouched settings only, beside ray tracing
  gnomon bench ball --sweep triangles,image,map,light
  gnomon bench --shard 3/8 --out out/bench-3         one of eight parts, on a machine of its own
  gnomon bench --merge out/bench-1,out/bench-2 --out out/bench

Shards by GNU parallel, a Slurm array and a Kubernetes indexed job:
  parallel -j1 gnomon bench --shard {}/8 --out out/bench-{} ::: $(seq 8)
  sbatch --array=1-8 --wrap 'gnomon bench --shard $SLURM_ARRAY_TASK_ID/8 --out out/bench-$SLURM_ARRAY_TASK_ID'
  command: [sh, -c, 'gnomon bench --shard $((JOB_COMPLETION_INDEX + 1))/8 --out /out/bench-$JOB_COMPLETION_INDEX']

Writes results.jsonl (a line as soon as a cell is measured: an interrupted run goes on where it stopped), results.csv, \
results.json, a chart for each scene and error (SVG and PNG) and index.html. Ground truth is kept in truth/. Times are \
medians of runs after one to warm up. Ray tracing with 1, 4, 16, 64 and 256 samples is measured beside, plain and with \
the proofs that leave rays out.")]
pub(crate) struct BenchArgs {
    /// Scenes: files, meshes or built-in ones [default: every built-in scene]
    #[arg(value_name = "SCENE")]
    pub(crate) scenes: Vec<String>,
    /// Techniques, separated by commas [default: all]
    #[arg(long, value_name = "A,B", value_delimiter = ',')]
    pub(crate) techniques: Vec<String>,
    /// Each technique with its settings untouched, not in every variant and preset
    #[arg(long)]
    pub(crate) defaults: bool,
    /// Cost curves besides, of the defaults: over triangles of `forest`; over the others with the first scene
    #[arg(long, value_enum, value_name = "AXIS", value_delimiter = ',')]
    pub(crate) sweep: Vec<Axis>,
    /// Image size in pixels
    #[arg(long, value_name = "WxH", value_parser = parse_size, default_value = "512x512")]
    pub(crate) size: (u32, u32),
    /// Which of each scene's lights, counted from 0
    #[arg(long, value_name = "INDEX", default_value_t = 0)]
    pub(crate) light: usize,
    /// Seed of all random choices; ray tracing as a contender gets another one than ground truth
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) seed: u64,
    /// Shadow rays a pixel of ground truth
    #[arg(long, value_name = "N", default_value_t = 1024, value_parser = clap::value_parser!(u32).range(1..=65_536))]
    pub(crate) samples: u32,
    /// Timed runs of a cell; none begins after two seconds
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u16).range(1..=1000))]
    pub(crate) runs: u16,
    /// Where techniques run; cpu,gpu measures both
    #[arg(long, value_enum, value_name = "BACKEND", value_delimiter = ',', default_value = "auto")]
    pub(crate) backend: Vec<Backend>,
    /// Measure every N-th cell only, beginning with the I-th
    #[arg(long, value_name = "I/N", default_value_t = Shard::WHOLE)]
    pub(crate) shard: Shard,
    /// Measure nothing: put the results of these folders together
    #[arg(long, value_name = "DIR,DIR", value_delimiter = ',')]
    pub(crate) merge: Vec<PathBuf>,
    /// Forget what was measured before
    #[arg(long)]
    pub(crate) fresh: bool,
    /// Folder of ground truth, to share it among runs [default: truth in the folder to write to]
    #[arg(long, value_name = "DIR")]
    pub(crate) truth: Option<PathBuf>,
    /// Folder to write to, and to go on in
    #[arg(long, value_name = "DIR", default_value = "out/bench")]
    pub(crate) out: PathBuf,
}

/// `gnomon stress`.
#[derive(Args, Debug)]
#[command(after_help = "\
Examples:
  gnomon stress --quick
  gnomon stress --variants --backend cpu,gpu
  gnomon stress --techniques psm --json
  gnomon stress --cells 'ten million' --backend gpu

Scenes are scaled (1e-3 to 1e4), moved (to 1e4 of their size) and cut into other triangles, none of which may change the \
image: their error may exceed that of the scene as it was by what moving shadows by half a pixel would add. Lights at \
the horizon, in the camera's plane, on faces and vertices, without size and huge, near planes through geometry, images \
of one row, empty and broken geometry have no such twin: V has to be finite and in [0, 1].")]
pub(crate) struct StressArgs {
    /// Techniques, separated by commas; NAME@PRESET takes a preset [default: all]
    #[arg(long, value_name = "A,B", value_delimiter = ',')]
    pub(crate) techniques: Vec<String>,
    /// Every variant of each technique, not its default one alone
    #[arg(long)]
    pub(crate) variants: bool,
    /// One scene in place of four, and no large one
    #[arg(long)]
    pub(crate) quick: bool,
    /// Only scenes with this in their name, as tables and failures write it, and those that they are held against; may be
    /// given again
    #[arg(long, value_name = "TEXT")]
    pub(crate) cells: Vec<String>,
    /// Where techniques run; cpu,gpu tries both
    #[arg(long, value_enum, value_name = "BACKEND", value_delimiter = ',', default_value = "cpu")]
    pub(crate) backend: Vec<Backend>,
    /// Shadow rays a pixel of ground truth
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = clap::value_parser!(u32).range(1..=65_536))]
    pub(crate) samples: u32,
    /// Seed of all random choices
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) seed: u64,
}

/// `gnomon techniques`.
#[derive(Args, Debug)]
#[command(after_help = "\
Examples:
  gnomon techniques
  gnomon techniques shadow-map --json")]
pub(crate) struct TechniquesArgs {
    /// Show this one only
    pub(crate) name: Option<String>,
}

/// Where a technique runs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum Backend {
    /// The GPU if the technique has a path on it and the machine has one that is not in software, else the CPU
    #[default]
    Auto,
    /// The CPU
    Cpu,
    /// The GPU, one in software too; exit code 3 if there is none. The variable `GNOMON_ADAPTER` chooses one by number
    /// or a part of its name
    Gpu,
}

fn parse_size(text: &str) -> Result<(u32, u32), String> {
    let max = scene_core::Camera::MAX_SIDE;
    let side = |text: &str| text.parse().ok().filter(|side| (1..=max).contains(side));
    text.split_once(['x', 'X', '×'])
        .and_then(|(width, height)| Some((side(width)?, side(height)?)))
        .ok_or_else(|| format!("give it as WIDTHxHEIGHT, each from 1 to {max}, such as 640x480"))
}

fn parse_time(text: &str) -> Result<f32, String> {
    text.parse()
        .ok()
        .filter(|time: &f32| time.is_finite())
        .ok_or_else(|| "give seconds, such as 1.5".to_owned())
}

fn parse_fraction(text: &str) -> Result<f32, String> {
    let in_range = |scale: &f32| (0.001..=1.0).contains(scale);
    text.parse().ok().filter(in_range).ok_or_else(|| "give a number from 0.001 to 1".to_owned())
}

fn parse_setting(text: &str) -> Result<(String, String), String> {
    match text.split_once('=') {
        Some((key, value)) if !key.trim().is_empty() => Ok((key.trim().to_owned(), value.trim().to_owned())),
        _ => Err("give it as KEY=VALUE, such as map_size=2048".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_line_is_consistent() {
        use clap::CommandFactory;
        Arguments::command().debug_assert();
    }

    #[test]
    fn sizes() {
        assert_eq!(parse_size("640x480"), Ok((640, 480)));
        for bad in ["", "640", "0x4", "4x0", "-4x4", "4x4x4", "99999x4", "4 x 4", "axb"] {
            assert!(parse_size(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn settings_keep_everything_after_the_first_equals_sign() {
        assert_eq!(parse_setting("a=b=c"), Ok(("a".to_owned(), "b=c".to_owned())));
        assert!(parse_setting("a").is_err() && parse_setting("=b").is_err());
    }
}
