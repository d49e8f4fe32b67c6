//! `cargo xtask gallery [--check]`: the figures of the READMEs, made by the command.
//!
//! A figure is the `strip.png` of `gnomon compare`: ground truth and a technique's variants, or every technique, shaded,
//! each with its error below and no times. With `--check` each is made again and held against the file: one that is
//! missing, differs by more than [`stale`] allows, or leaves a variant out, is a failure. Figures are small, so that all
//! of them take seconds.

mod stale;

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::shell::{CheckError, cargo, root, run_program, target};
use crate::tidy::technique_folders;

/// No picture beside the sources is larger.
const MAX_BYTES: usize = 64 << 10;

/// A figure that is not a technique crate's.
const PROJECT: Figure = Figure {
    file: "docs/compare.png",
    scene: "knot",
    size: "180x135",
    techniques: &[],
    variants: false,
    left_out: &[],
};

/// Figures of technique crates, whose light their variants take. A crate that is not listed gets [`OTHERS`].
const TECHNIQUES: [Figure; 3] = [
    Figure {
        file: "shadow-map/figure.png",
        scene: "ball",
        size: "160x120",
        techniques: &["shadow-map"],
        variants: true,
        left_out: &[],
    },
    Figure {
        file: "psm/figure.png",
        scene: "street",
        size: "160x120",
        techniques: &["psm"],
        variants: true,
        left_out: &[],
    },
    Figure {
        file: "stencil-volumes/figure.png",
        scene: "knot",
        size: "200x150",
        techniques: &["stencil-volumes"],
        variants: true,
        left_out: &[],
    },
];

/// Scene and size of a technique crate's figure that has no row.
const OTHERS: (&str, &str) = ("ball", "160x120");

/// What a figure shows.
#[derive(Clone, Copy, Debug)]
struct Figure {
    file: &'static str,
    scene: &'static str,
    size: &'static str,
    /// Words of `--techniques`; none for all.
    techniques: &'static [&'static str],
    variants: bool,
    /// Variants that do not take the scene's light, and are said not to.
    left_out: &'static [&'static str],
}

/// A figure to make.
#[derive(Debug)]
struct Job {
    file: PathBuf,
    left_out: &'static [&'static str],
    arguments: Vec<String>,
}

/// Builds the command, then makes or checks the figures.
pub(crate) fn run(check: bool) -> Result<(), CheckError> {
    // As the tests build it: alone the command would get dependencies with other features, anew.
    cargo(&["test", "--profile", "ci", "--workspace", "--test", "cli", "--no-run"], &[])?;
    run_built(check)
}

/// [`run`] with the command that the tests have built.
pub(crate) fn run_built(check: bool) -> Result<(), CheckError> {
    let mut faults = Vec::new();
    for job in jobs(root())? {
        let name = job.file.display().to_string();
        let made = make(&job)?;
        if let Some(fault) = made.incomplete() {
            faults.push(format!("{name}: {fault}"));
            continue;
        }
        let file = root().join(&job.file);
        let kept = fs::read(&file).ok();
        match stale::why(kept.as_deref(), &made.png, made.captions) {
            None => eprintln!("    {name} is up to date"),
            Some(why) if check => faults.push(format!("{name}: {why}: `cargo xtask gallery` makes it anew")),
            Some(why) => {
                fs::write(&file, &made.png).map_err(|source| CheckError::Write { path: file, source })?;
                eprintln!("    wrote {name}, {} bytes: {why}", made.png.len());
            }
        }
    }
    if faults.is_empty() { Ok(()) } else { Err(CheckError::Rules(faults)) }
}

/// The project's figure and one for each technique crate there is.
fn jobs(root: &Path) -> Result<Vec<Job>, CheckError> {
    let mut jobs = vec![job(&PROJECT)];
    for folder in technique_folders(root) {
        let file = format!("{folder}/figure.png");
        let listed = TECHNIQUES.iter().find(|figure| figure.file == file);
        jobs.push(listed.map_or_else(
            || Job {
                file: file.clone().into(),
                left_out: &[],
                arguments: arguments(OTHERS.0, OTHERS.1, &[folder], true),
            },
            job,
        ));
    }
    Ok(jobs)
}

fn job(figure: &Figure) -> Job {
    let arguments = arguments(figure.scene, figure.size, figure.techniques, figure.variants);
    Job { file: figure.file.into(), left_out: figure.left_out, arguments }
}

fn arguments(scene: &str, size: &str, techniques: &[&str], variants: bool) -> Vec<String> {
    let techniques = techniques.join(",");
    let mut words = vec!["compare", scene, "--size", size];
    if !techniques.is_empty() {
        words.extend(["--techniques", &techniques]);
    }
    if variants {
        words.push("--variants");
    }
    words.into_iter().map(str::to_owned).collect()
}

/// A figure as the command makes it.
struct Made {
    png: Vec<u8>,
    /// Images in it, each with a figure below.
    captions: usize,
    /// What was left out, and why.
    refused: Vec<String>,
}

impl Made {
    fn incomplete(&self) -> Option<String> {
        if !self.refused.is_empty() {
            return Some(format!("its scene does not suit all: {}", self.refused.join("; ")));
        }
        let bytes = self.png.len();
        (bytes > MAX_BYTES).then(|| format!("{bytes} bytes, at most {MAX_BYTES}: make its images smaller"))
    }
}

/// Runs the command.
fn make(job: &Job) -> Result<Made, CheckError> {
    let out = target().join("gallery").join(job.file.with_extension(""));
    let place = out.display().to_string();
    let mut arguments: Vec<&str> = job.arguments.iter().map(String::as_str).collect();
    arguments.extend(["--backend", "cpu", "--out", &place]);
    let program = target().join("ci").join(format!("gnomon{}", std::env::consts::EXE_SUFFIX));
    run_program(&program, &arguments)?;
    let read = |name: &str| {
        let path = out.join(name);
        fs::read(&path).map_err(|source| CheckError::Read { path, source })
    };
    let report: Value = serde_json::from_slice(&read("report.json")?)
        .map_err(|error| CheckError::Failed(format!("{place}/report.json: {error}")))?;
    let list = |key: &str| report[key].as_array().cloned().unwrap_or_default();
    let refused = |item: &Value| {
        let text = |key: &str| item[key].as_str().unwrap_or_default().to_owned();
        (text("technique"), text("why"))
    };
    // The project's figure shows what suits its scene; a crate's shows every variant.
    let is_whole = job.file != Path::new(PROJECT.file);
    let expected = |label: &str| job.left_out.iter().any(|variant| label.ends_with(&format!(" {variant}")));
    let refused = list("refused")
        .into_iter()
        .map(|item| refused(&item))
        .filter(|(label, _)| is_whole && !expected(label));
    let refused = refused.map(|(label, why)| format!("{label}: {why}")).collect();
    Ok(Made { png: read("strip.png")?, captions: 1 + list("techniques").len(), refused })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_technique_crate_has_a_figure() {
        let tree = tempfile::tempdir().unwrap();
        for folder in ["shadow-map", "pdsm"] {
            fs::create_dir_all(tree.path().join(folder)).unwrap();
        }
        let jobs = jobs(tree.path()).unwrap();
        let files: Vec<_> = jobs.iter().map(|job| job.file.display().to_string()).collect();
        assert_eq!(files, ["docs/compare.png", "shadow-map/figure.png", "pdsm/figure.png"]);
        let words = jobs[2].arguments.join(" ");
        assert_eq!(words, "compare ball --size 160x120 --techniques pdsm --variants");
    }

    #[test]
    fn a_figure_without_a_variant_or_too_large_is_refused() {
        let made = |bytes, refused: &[&str]| {
            let refused = refused.iter().map(|&r| r.to_owned()).collect();
            Made { png: vec![0; bytes], captions: 2, refused }.incomplete()
        };
        assert_eq!(made(MAX_BYTES, &[]), None);
        assert!(made(MAX_BYTES + 1, &[]).is_some());
        assert!(made(1, &["t a: no"]).is_some());
    }
}
