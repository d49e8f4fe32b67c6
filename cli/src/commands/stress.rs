//! `gnomon stress`: every technique on scenes that are hard on numbers.

use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};

use scene_core::raster::render_gbuffer;
use scene_core::technique::TechniqueError;
use serde::Serialize;

use crate::args::{StressArgs, TruthArgs};
use crate::compare::table::{aligned, error_text};
use crate::console::Console;
use crate::error::{CliError, count_of};
use crate::measure::{Repeats, Stand};
use crate::stress::trial;
use crate::stress::verdict::{Verdict, judge};
use crate::{backend, ground_truth, techniques};

/// One technique on one trial.
#[derive(Serialize)]
struct Cell {
    trial: String,
    technique: String,
    backend: &'static str,
    #[serde(flatten)]
    verdict: Verdict,
}

#[derive(Serialize)]
struct StressReport {
    cells: Vec<Cell>,
    passed: usize,
    failed: usize,
    refused: usize,
}

pub(crate) fn run(args: &StressArgs, console: &Console) -> Result<(), CliError> {
    let chosen = techniques::chosen(&args.techniques, args.variants, args.seed)?;
    let gpu = backend::open(&args.backend)?;
    let trials = trial::chosen(args.quick, &args.cells)?;
    let truth_args = TruthArgs { samples: args.samples, exact: false, max_error: None };
    let mut cells: Vec<Cell> = Vec::new();
    // Errors on scenes as they are, by trial and technique: what changed scenes are held against.
    let mut base_rmse: BTreeMap<(String, String, &str), f64> = BTreeMap::new();
    for (what, said) in trial::refusals(&args.cells) {
        let verdict = match said {
            Some(why) => Verdict::Refused { why },
            None => Verdict::Fail { why: "a scene took it".to_owned() },
        };
        cells.push(Cell { trial: what.to_owned(), technique: "loading".to_owned(), backend: "-", verdict });
    }
    let bar = console.progress("stress");
    for (number, trial) in trials.iter().enumerate() {
        let view = &trial.view;
        let gbuffer = render_gbuffer(&view.setup.scene, &view.setup.camera);
        let (truth, _) = ground_truth::trace(view, &gbuffer, &truth_args, args.seed, console)?;
        let mut stand = Stand::new(view, &gbuffer, gpu.as_ref());
        for chosen in &chosen {
            let sides = backend::sides(chosen.technique.as_ref(), &args.backend, gpu.is_some());
            for side in sides.into_iter().filter_map(|(_, side)| side) {
                bar.at(format!("{} ({}) on {}", chosen.label, side.name(), trial.name));
                let repeats = Repeats { runs: 1, budget_ms: 0.0 };
                let key = |trial: &str| (trial.to_owned(), chosen.label.clone(), side.name());
                let base = trial.same_as.as_ref().and_then(|base| base_rmse.get(&key(base)).copied());
                // A panic is the worst answer, but not a reason to stop asking.
                let run =
                    catch_unwind(AssertUnwindSafe(|| stand.repeat(chosen.technique.as_ref(), side, repeats)));
                let verdict = match run {
                    Err(_) => Verdict::Fail { why: "it panicked".to_owned() },
                    Ok(Ok(run)) => judge(&run.fastest.visibility, &truth, base)?,
                    Ok(Err(CliError::Technique(TechniqueError::Unsupported { why, .. }))) => {
                        Verdict::Refused { why }
                    }
                    Ok(Err(error)) => Verdict::Fail { why: error.to_string() },
                };
                if let Verdict::Pass { rmse, .. } = verdict {
                    base_rmse.insert(key(&trial.name), rmse);
                }
                cells.push(Cell {
                    trial: trial.name.clone(),
                    technique: chosen.label.clone(),
                    backend: side.name(),
                    verdict,
                });
            }
        }
        bar.set((number + 1) as f32 / trials.len() as f32);
    }
    drop(bar);
    let count = |is: fn(&Verdict) -> bool| cells.iter().filter(|cell| is(&cell.verdict)).count();
    let passed = count(|v| matches!(v, Verdict::Pass { .. }));
    let failed = count(|v| matches!(v, Verdict::Fail { .. }));
    let refused = count(|v| matches!(v, Verdict::Refused { .. }));
    let text = table(&cells);
    let report = StressReport { cells, passed, failed, refused };
    console.result(&report, &text)?;
    console.note(&format!("{passed} passed, {failed} failed, {refused} refused"));
    if failed > 0 { Err(CliError::CheckFailed(count_of(failed, "cell") + " failed")) } else { Ok(()) }
}

/// One row a technique and backend, its worst figures, then every failure.
fn table(cells: &[Cell]) -> String {
    let mut rows: BTreeMap<(&str, &str), [usize; 3]> = BTreeMap::new();
    // The cell nearest to its bound, or beyond what it was allowed: rmse over bound.
    let mut nearest: BTreeMap<(&str, &str), (f64, f64, &str)> = BTreeMap::new();
    for cell in cells {
        let key = (cell.technique.as_str(), cell.backend);
        let row = rows.entry(key).or_default();
        match &cell.verdict {
            Verdict::Pass { rmse, bound } => {
                row[0] += 1;
                let share = bound.map_or(0.0, |bound| rmse / bound.max(f64::MIN_POSITIVE));
                let worst = nearest.entry(key).or_insert((0.0, *rmse, "-"));
                if share > worst.0 {
                    *worst = (share, *rmse, &cell.trial);
                }
            }
            Verdict::Fail { .. } => row[1] += 1,
            Verdict::Refused { .. } => row[2] += 1,
        }
    }
    let mut lines = vec![
        ["technique", "backend", "pass", "fail", "refused", "rmse / bound", "rmse", "at worst on"]
            .map(str::to_owned),
    ];
    for (key, [pass, fail, refused]) in rows {
        let (share, rmse, trial) = nearest.get(&key).copied().unwrap_or((0.0, f64::NAN, "-"));
        lines.push([
            key.0.to_owned(),
            key.1.to_owned(),
            pass.to_string(),
            fail.to_string(),
            refused.to_string(),
            format!("{share:.2}"),
            error_text(rmse),
            trial.to_owned(),
        ]);
    }
    let mut text = aligned(&lines);
    for cell in cells {
        if let Verdict::Fail { why } = &cell.verdict {
            text.push_str(&format!("FAIL {} ({}) on {}: {why}\n", cell.technique, cell.backend, cell.trial));
        }
    }
    text
}
