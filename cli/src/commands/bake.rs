//! `gnomon bake`: what can be computed once and for all, in a file.

use gnomon_pdsm::{Pdsm, PdsmParams};
use scene_core::Report;
use scene_core::technique::Params as _;
use serde::Serialize;
use serde_json::Value;

use crate::args::BakeArgs;
use crate::compare::table::milliseconds;
use crate::console::Console;
use crate::error::CliError;
use crate::{scene_source, techniques};

/// What was baked.
#[derive(Debug, Serialize)]
struct BakeReport {
    scene: String,
    light: usize,
    technique: &'static str,
    file: String,
    file_bytes: u64,
    settings: Value,
    prepare_ms: f64,
    #[serde(flatten)]
    report: Report,
}

pub(crate) fn run(args: &BakeArgs, console: &Console) -> Result<(), CliError> {
    let overrides = techniques::with_seed(&gnomon_pdsm::Factory, &args.set, args.scene.seed);
    let params = PdsmParams::from_overrides(args.preset.as_deref(), &overrides)?;
    // A long computation is not lost for want of a folder.
    let folder = args.out.parent().filter(|folder| !folder.as_os_str().is_empty());
    if let Some(folder) = folder {
        std::fs::create_dir_all(folder)
            .map_err(|source| CliError::Write { path: folder.to_owned(), source })?;
    }
    if args.out.is_dir() {
        let source = std::io::ErrorKind::IsADirectory.into();
        return Err(CliError::Write { path: args.out.clone(), source });
    }
    let view = scene_source::view(&args.scene, console)?;
    let (baked, report) = {
        let _working = console.working(format!("baking {}", args.scene.scene));
        Pdsm::new(params).bake(&view.setup.scene, view.light())
    };
    if baked.is_empty() {
        console.note("note: nothing that stands still throws a shadow, so the file is empty; what may move throws its own when it is rendered");
    }
    let bytes = baked.to_bytes();
    scene_core::io::write::bytes(&args.out, &bytes)?;
    let report = BakeReport {
        scene: view.setup.name.clone(),
        light: view.light_index,
        technique: PdsmParams::TECHNIQUE,
        file: args.out.display().to_string(),
        file_bytes: bytes.len() as u64,
        settings: params.to_json(),
        prepare_ms: report.total_ms("prepare."),
        report,
    };
    let text = format!(
        "{}: {:.1} MiB, prepare {} ms\n",
        report.file,
        report.file_bytes as f64 / f64::from(1 << 20),
        milliseconds(report.prepare_ms),
    );
    console.result(&report, &text)
}
