//! `gnomon reference`: ground truth.

use scene_core::io::write;
use scene_core::metrics;
use scene_core::raster::render_gbuffer;

use crate::args::ReferenceArgs;
use crate::compare::percent;
use crate::compare::table::{error_text, milliseconds};
use crate::console::Console;
use crate::error::CliError;
use crate::output::OutputFolder;
use crate::picture::shading::Shading;
use crate::{ground_truth, picture, scene_source};

pub(crate) fn run(args: &ReferenceArgs, console: &Console) -> Result<(), CliError> {
    let out = OutputFolder::check(&args.out)?;
    let view = scene_source::view(&args.scene, console)?;
    let gbuffer = render_gbuffer(&view.setup.scene, &view.setup.camera);
    let (truth, report) = ground_truth::trace(&view, &gbuffer, &args.truth, args.scene.seed, console)?;
    {
        let _working = console.working("writing");
        let shading = Shading::new(&gbuffer, &view.setup.camera, view.light());
        let image = picture::png(shading.picture(&truth.visibility))?;
        let (width, height) = (gbuffer.width, gbuffer.height);
        out.write(|to| {
            write::bytes(&to.join("image.png"), &image)?;
            write::visibility_png(&to.join("visibility.png"), &truth.visibility)?;
            write::npy_f32(&to.join("visibility.npy"), &truth.visibility.values, width, height)?;
            write::npy_f32(&to.join("std_error.npy"), &truth.std_error, width, height)?;
            write::npy_bool(&to.join("valid.npy"), &truth.valid, width, height)?;
            write::npy_vec3(&to.join("position.npy"), &gbuffer.position, width, height)?;
            write::json(&to.join("report.json"), &report)
        })?;
    }
    let shares = metrics::shares(&truth.visibility, &truth.valid)?;
    let text = format!(
        "{}: {} ms, standard error {}; lit {}, penumbra {}, umbra {}\n",
        out.path().display(),
        milliseconds(report.prepare_ms + report.shade_ms),
        error_text(truth.noise()),
        percent(shares.lit),
        percent(shares.penumbra),
        percent(shares.umbra),
    );
    console.result(&report, &text)
}
