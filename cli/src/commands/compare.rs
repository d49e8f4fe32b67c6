//! `gnomon compare`: every technique beside ground truth.

use std::path::{Path, PathBuf};
use std::rc::Rc;

use scene_core::io::write;
use scene_core::raster::render_gbuffer;
use scene_core::technique::{ShadowTechnique, TechniqueError};

use crate::args::{Backend, CompareArgs};
use crate::backend::Side;
use crate::compare::{Comparison, Entry, Refused, Truth, page, sheet, skipped, strip, table};
use crate::console::Console;
use crate::error::CliError;
use crate::measure::Stand;
use crate::output::OutputFolder;
use crate::picture::shading::Shading;
use crate::techniques::Chosen;
use crate::{backend, ground_truth, picture, scene_source, techniques};

/// Runs of which the fastest counts.
const RUNS: usize = 3;

pub(crate) fn run(args: &CompareArgs, console: &Console) -> Result<(), CliError> {
    let chosen = techniques::chosen(&args.techniques, args.variants, args.scene.seed)?;
    let gpu = backend::open(&args.backend)?;
    let plan = plan(chosen, &args.backend, gpu.is_some())?;
    let view = scene_source::view(&args.scene, console)?;
    let out = OutputFolder::check(&args.out.clone().unwrap_or_else(|| default_out(&view.setup.name)))?;

    let gbuffer = render_gbuffer(&view.setup.scene, &view.setup.camera);
    let (truth, truth_report) = ground_truth::trace(&view, &gbuffer, &args.truth, args.scene.seed, console)?;
    if !truth.valid.contains(&true) {
        console.note("note: no pixel can be compared: none sees a surface with the whole light above it");
    }
    let shading = Shading::new(&gbuffer, &view.setup.camera, view.light());
    let truth_row = Truth::new(&truth, truth_report, &shading)?;
    let (mut entries, mut refused) = (Vec::new(), Vec::new());
    let mut stand = Stand::new(&view, &gbuffer, gpu.as_ref());
    for Planned { label, technique, backend, side } in plan {
        let Some(side) = side else {
            refused
                .push(Refused { technique: label, why: "it has no GPU path with these settings".to_owned() });
            continue;
        };
        let _working = console.working(label.clone());
        match stand.run(technique.as_ref(), (backend, side), RUNS, console) {
            Ok(run) => entries.push(Entry::new(label, run, &truth, &shading, args.error_scale)?),
            Err(CliError::Technique(TechniqueError::Unsupported { input, why, .. })) => {
                refused.push(Refused { technique: label, why: format!("it does not take {input}: {why}") });
            }
            Err(error) => return Err(error),
        }
    }
    let comparison = Comparison { truth: truth_row, entries, refused, error_scale: args.error_scale };

    {
        let _working = console.working("drawing");
        let sheet = picture::png(sheet::sheet(&comparison))?;
        let strip = picture::small_png(&strip::strip(&comparison))?;
        let table = table::csv(&comparison)?;
        let page = page::page(&comparison)?;
        out.write(|to| {
            write::bytes(&to.join("contact-sheet.png"), &sheet)?;
            write::bytes(&to.join("strip.png"), &strip)?;
            write::bytes(&to.join("table.csv"), &table)?;
            write::json(&to.join("report.json"), &comparison.report())?;
            write::bytes(&to.join("index.html"), &page)
        })?;
    }
    for refused in &comparison.refused {
        console.note(&format!("not run: {}: {}", refused.technique, refused.why));
    }
    console.note(&format!("wrote {}", out.path().join("index.html").display()));
    let (facts, table, skipped) =
        (comparison.facts(), table::text(&comparison), skipped::footer(&comparison));
    console.result(&comparison.report(), &format!("{facts}\n\n{table}{skipped}"))
}

/// A technique and where it runs.
struct Planned {
    label: String,
    technique: Rc<dyn ShadowTechnique>,
    backend: Backend,
    /// None if it has no such path.
    side: Option<Side>,
}

/// What runs where: every technique once on each side that `backends` come down to.
///
/// # Errors
/// If nothing could run because a GPU is asked for and no technique has a path on it.
fn plan(chosen: Vec<Chosen>, backends: &[Backend], has_gpu: bool) -> Result<Vec<Planned>, CliError> {
    let mut plan: Vec<Planned> = Vec::new();
    for Chosen { label, technique } in chosen {
        let technique: Rc<dyn ShadowTechnique> = Rc::from(technique);
        for (backend, side) in backend::sides(technique.as_ref(), backends, has_gpu) {
            let label = if side == Some(Side::Cpu) { label.clone() } else { format!("{label} (gpu)") };
            plan.push(Planned { label, technique: Rc::clone(&technique), backend, side });
        }
    }
    match plan.first() {
        Some(first) if plan.iter().all(|planned| planned.side.is_none()) => {
            Err(CliError::NoGpuPath { technique: first.technique.name() })
        }
        _ => Ok(plan),
    }
}

/// `out/` and the scene's name, reduced to what any file system takes.
fn default_out(scene: &str) -> PathBuf {
    let plain = |c: char| if c.is_alphanumeric() || c == '-' || c == '_' || c == '.' { c } else { '-' };
    let name: String = scene.chars().map(plain).take(100).collect();
    let name = name.trim_matches(['.', '-']);
    Path::new("out").join(if name.is_empty() { "scene" } else { name })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folders_stay_below_out() {
        for (scene, folder) in [
            ("dragon", "dragon"),
            ("../../etc", "etc"),
            ("quads:count=5", "quads-count-5"),
            ("", "scene"),
            ("..", "scene"),
        ] {
            assert_eq!(default_out(scene), Path::new("out").join(folder));
        }
    }
}
