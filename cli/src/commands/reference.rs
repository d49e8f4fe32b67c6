//! `gnomon reference`: ground truth.

use scene_core::metrics;
use scene_core::raster::render_gbuffer;

use crate::args::ReferenceArgs;
use crate::compare::percent;
use crate::compare::table::{error_text, milliseconds};
use crate::console::Console;
use crate::error::CliError;
use crate::output::OutputFolder;
use crate::picture::shading::Shading;
use crate::report::json_file;
use crate::{ground_truth, npy, picture, scene_source};

pub(crate) fn run(args: &ReferenceArgs, console: &Console) -> Result<(), CliError> {
    let out = OutputFolder::check(&args.out)?;
    let view = scene_source::view(&args.scene, console)?;
    let gbuffer = render_gbuffer(&view.setup.scene, &view.setup.camera);
    let (truth, report) = ground_truth::trace(&view, &gbuffer, &args.truth, args.scene.seed, console)?;
    {
        let _working = console.working("writing");
        let shading = Shading::new(&gbuffer, &view.setup.camera, view.light());
        let files = [
            ("image.png", picture::png(shading.picture(&truth.visibility))?),
            ("visibility.png", picture::png(picture::grey(&truth.visibility))?),
            ("visibility.npy", npy::visibility(&truth.visibility)?),
            ("std_error.npy", npy::plane(&gbuffer, &truth.std_error)?),
            ("valid.npy", npy::mask(&gbuffer, &truth.valid)?),
            ("position.npy", npy::positions(&gbuffer)?),
            ("report.json", json_file(&report)),
        ];
        out.write(&files)?;
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
