//! `gnomon recommend`: the technique for a scene and a limit.

use serde::Serialize;

use crate::args::RecommendArgs;
use crate::bench::front::Time;
use crate::compare::table::{aligned, error_text, milliseconds};
use crate::console::Console;
use crate::error::CliError;
use crate::recommend::check::{Check, check};
use crate::recommend::choice::{Goal, SHORT_LIST};
use crate::recommend::data::Data;
use crate::recommend::features::Features;
use crate::recommend::model::{Expected, Model};
use crate::recommend::preview::{Preview, Tried};
use crate::scene_source;
use crate::techniques::{find, label, with_seed};

/// A contender that was tried.
#[derive(Debug, Serialize)]
struct Candidate {
    technique: String,
    preset: Option<String>,
    variant: String,
    expected_ms: f64,
    expected_rmse: f64,
    /// Factors by which the two are off, typically.
    ms_factor: f64,
    rmse_factor: f64,
    /// On the preview, its times scaled to the picture asked for.
    tried: Tried,
}

#[derive(Debug, Serialize)]
struct Recommendation {
    features: Features,
    /// The pick first.
    candidates: Vec<Candidate>,
    keeps_the_limit: bool,
    /// How often such picks are within 1.5 times of the best, with the scene in question unknown.
    right_on_unknown_scenes: f64,
    render: String,
}

pub(crate) fn run(args: &RecommendArgs, console: &Console) -> Result<(), CliError> {
    let data = Data::load(args.data.as_deref())?;
    let goal = match (args.goal.max_error, args.goal.max_ms) {
        (Some(limit), _) => Goal::MaxError(limit),
        (None, limit) => Goal::MaxMs(limit.unwrap_or(f64::INFINITY)),
    };
    let time = if args.moving_camera { Time::Frame } else { Time::Whole };
    let view = scene_source::view(&args.scene, console)?;
    let preview = {
        let _working = console.working("looking at the scene");
        Preview::new(view, args.scene.seed)?
    };
    let model = Model::new(&data, time, None);
    let ranked = goal.ranked(tried(&preview, &model, &data, goal, time, args.scene.seed, console)?);
    let Some((_, expected)) = ranked.first() else { return Err(CliError::NothingToRecommend) };
    let keeps_the_limit = goal.is_kept_by(expected);
    let candidates: Vec<Candidate> = ranked.into_iter().map(|(candidate, _)| candidate).collect();
    let features = *preview.features();
    let Check { held_out, .. } = check(&data, time);
    let render = command(&candidates[0], &args.scene.scene);
    let report =
        Recommendation { features, candidates, keeps_the_limit, right_on_unknown_scenes: held_out, render };
    console.result(&report, &text(&report, goal, data.scenes.len()))
}

/// The first of the short list that take the scene, with what is expected of each after a trial.
fn tried(
    preview: &Preview,
    model: &Model,
    data: &Data,
    goal: Goal,
    time: Time,
    seed: u64,
    console: &Console,
) -> Result<Vec<(Candidate, Expected)>, CliError> {
    let _working = console.working("trying the short list");
    let features = preview.features();
    let mut found = Vec::new();
    for label in goal.short_list(model.at_sight(features)) {
        if found.len() == SHORT_LIST {
            break;
        }
        let Some(line) = data.scenes.values().flatten().find(|line| line.label() == label) else { continue };
        let factory = find(&line.technique)?;
        let variant = [("variant".to_owned(), line.variant.clone())];
        let overrides = if line.variant == "default" { &[][..] } else { &variant };
        let technique = factory.create(line.preset.as_deref(), &with_seed(factory, overrides, seed))?;
        let Some(tried) = preview.try_out(technique.as_ref())? else { continue };
        let Some(expected) = model.after_trial(label, features, &tried, time) else { continue };
        let candidate = Candidate {
            technique: line.technique.clone(),
            preset: line.preset.clone(),
            variant: line.variant.clone(),
            expected_ms: expected.ms,
            expected_rmse: expected.rmse,
            ms_factor: expected.ms_factor,
            rmse_factor: expected.rmse_factor,
            tried,
        };
        found.push((candidate, expected));
    }
    Ok(found)
}

impl Candidate {
    fn name(&self) -> String {
        label(&self.technique, self.preset.as_deref(), &self.variant)
    }
}

/// The command that renders with the pick.
fn command(pick: &Candidate, scene: &str) -> String {
    let mut words = vec!["gnomon", "render", scene, "--technique", &pick.technique];
    if let Some(preset) = &pick.preset {
        words.extend(["--preset", preset]);
    }
    let variant = format!("variant={}", pick.variant);
    if pick.variant != "default" {
        words.extend(["--set", &variant]);
    }
    words.join(" ") + " --out out/pick"
}

/// For people: the pick, why, and what else was thought of.
fn text(report: &Recommendation, goal: Goal, scenes: usize) -> String {
    let Features { triangles, pixels, hard_rmse, penumbra, width } = report.features;
    let pick = &report.candidates[0];
    let limit = match goal {
        Goal::MaxError(limit) => format!("an rmse of {limit}"),
        Goal::MaxMs(limit) => format!("{limit} ms"),
    };
    let verdict = if report.keeps_the_limit {
        format!("should keep to {limit}")
    } else {
        format!("comes nearest to {limit}, which nothing is expected to keep to")
    };
    let mut lines = vec![
        ["candidate", "expected ms", "off by", "expected rmse", "off by", "rmse in small"].map(str::to_owned),
    ];
    lines.extend(report.candidates.iter().map(|candidate| {
        [
            format!("  {}", candidate.name()),
            milliseconds(candidate.expected_ms),
            format!("{:.2}x", candidate.ms_factor),
            error_text(candidate.expected_rmse),
            format!("{:.2}x", candidate.rmse_factor),
            error_text(candidate.tried.rmse),
        ]
    }));
    format!(
        "{name} {verdict}\n  {render}\n\nthe scene: {triangles:.0} casting triangles, {pixels:.0} pixels, {penumbra:.1} % of them in \
         penumbrae about {width:.0} pixels wide; a hard shadow is wrong by {hard_rmse:.3} (rmse)\n\n{table}\non scenes left out of the \
         measurements ({scenes} in all) {right:.0} % of picks are within 1.5 times of the best, in time and error\n",
        name = pick.name(),
        render = report.render,
        penumbra = penumbra * 100.0,
        table = aligned(&lines),
        right = report.right_on_unknown_scenes * 100.0,
    )
}
