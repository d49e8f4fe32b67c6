//! `gnomon compare`: every technique beside ground truth.

use std::path::{Path, PathBuf};

use scene_core::io::write;
use scene_core::raster::render_gbuffer;
use scene_core::technique::TechniqueError;

use crate::args::CompareArgs;
use crate::compare::{Comparison, Entry, Refused, Truth, page, sheet, table};
use crate::console::Console;
use crate::error::CliError;
use crate::output::OutputFolder;
use crate::picture::shading::Shading;
use crate::{ground_truth, measure, picture, scene_source, techniques};

pub(crate) fn run(args: &CompareArgs, console: &Console) -> Result<(), CliError> {
    let chosen = techniques::chosen(&args.techniques, args.scene.seed)?;
    for chosen in &chosen {
        measure::check_backend(chosen.technique.as_ref(), args.backend)?;
    }
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
    for chosen in chosen {
        let _working = console.working(chosen.label.clone());
        match measure::fastest(chosen.technique.as_ref(), &view, &gbuffer) {
            Ok(run) => entries.push(Entry::new(chosen.label, run, &truth, &shading, args.error_scale)?),
            Err(CliError::Technique(TechniqueError::Unsupported { input, why, .. })) => {
                refused.push(Refused {
                    technique: chosen.label,
                    why: format!("it does not take {input}: {why}"),
                });
            }
            Err(error) => return Err(error),
        }
    }
    let comparison = Comparison { truth: truth_row, entries, refused, error_scale: args.error_scale };

    {
        let _working = console.working("drawing");
        let sheet = picture::png(sheet::sheet(&comparison))?;
        let table = table::csv(&comparison)?;
        let page = page::page(&comparison)?;
        out.write(|to| {
            write::bytes(&to.join("contact-sheet.png"), &sheet)?;
            write::bytes(&to.join("table.csv"), &table)?;
            write::json(&to.join("report.json"), &comparison.report())?;
            write::bytes(&to.join("index.html"), &page)
        })?;
    }
    for refused in &comparison.refused {
        console.note(&format!("not run: {}: {}", refused.technique, refused.why));
    }
    console.note(&format!("wrote {}", out.path().join("index.html").display()));
    console.result(&comparison.report(), &format!("{}\n\n{}", comparison.facts(), table::text(&comparison)))
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
