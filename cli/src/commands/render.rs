//! `gnomon render`: the shadows of one light by one technique, or as they were baked.

use gnomon_pdsm::baked::Baked;
use scene_core::ShadowTechnique;
use scene_core::io::write;
use scene_core::raster::render_gbuffer;

use crate::args::RenderArgs;
use crate::compare::table::milliseconds;
use crate::console::Console;
use crate::error::CliError;
use crate::measure::Stand;
use crate::output::OutputFolder;
use crate::picture::shading::Shading;
use crate::{backend, picture, scene_source, techniques};

pub(crate) fn run(args: &RenderArgs, console: &Console) -> Result<(), CliError> {
    let technique = technique(args)?;
    let gpu = backend::open(&[args.backend])?;
    let side = backend::side(technique.as_ref(), args.backend, gpu.is_some())
        .ok_or(CliError::NoGpuPath { technique: technique.name() })?;
    let out = OutputFolder::check(&args.out)?;
    let view = scene_source::view(&args.scene, console)?;

    let run = {
        let _working = console.working(format!("rendering with {}", technique.name()));
        let gbuffer = render_gbuffer(&view.setup.scene, &view.setup.camera);
        let mut stand = Stand::new(&view, &gbuffer, gpu.as_ref());
        let run = stand.run(technique.as_ref(), (args.backend, side), 1, console)?;
        let shows_texels = technique.settings().get("show").is_some_and(|show| show == "texels");
        let image = picture::png(if shows_texels {
            picture::texels::picture(&run.visibility)
        } else {
            Shading::new(&gbuffer, &view.setup.camera, view.light()).picture(&run.visibility)
        })?;
        let visibility = &run.visibility;
        out.write(|to| {
            write::bytes(&to.join("image.png"), &image)?;
            write::visibility_png(&to.join("visibility.png"), visibility)?;
            write::npy_f32(
                &to.join("visibility.npy"),
                &visibility.values,
                visibility.width,
                visibility.height,
            )?;
            write::json(&to.join("report.json"), &run.report)
        })?;
        run
    };
    let report = &run.report;
    let text = format!(
        "{}: {} {} on the {}, prepare {} ms, shade {} ms\n",
        out.path().display(),
        report.technique,
        report.variant,
        report.adapter.as_deref().map_or_else(|| "CPU".to_owned(), |adapter| format!("GPU {adapter}")),
        milliseconds(report.prepare_ms),
        milliseconds(report.shade_ms),
    );
    console.result(report, &text)
}

/// What is asked for by name, or what a file holds.
fn technique(args: &RenderArgs) -> Result<Box<dyn ShadowTechnique>, CliError> {
    if let Some(path) = &args.baked {
        let baked = Baked::read(path).map_err(|source| CliError::Baked { path: path.clone(), source })?;
        return Ok(Box::new(baked));
    }
    let factory = techniques::find(args.technique.as_deref().unwrap_or_default())?;
    let overrides = techniques::with_seed(factory, &args.set, args.scene.seed);
    Ok(factory.create(args.preset.as_deref(), &overrides)?)
}
