//! Ground truth that is traced once for a view and kept as `NumPy` files beside the results.
//!
//! The name is a hash of all that V depends on: triangles, masks, camera, light, samples, seed and version. Files that do
//! not fit are traced again.

use std::fs::File;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::io::BufReader;
use std::path::Path;

use scene_core::io::write;
use scene_core::reference::valid_pixels;
use scene_core::{GBuffer, VisibilityImage};

use crate::args::TruthArgs;
use crate::console::Console;
use crate::error::CliError;
use crate::ground_truth::{self, GroundTruth};
use crate::scene_source::View;

/// Ground truth of `view`, from `folder` or traced and put there.
pub(crate) fn truth(
    view: &View,
    gbuffer: &GBuffer,
    args: &TruthArgs,
    seed: u64,
    folder: &Path,
    console: &Console,
) -> Result<GroundTruth, CliError> {
    let name = format!("{:016x}", hash(view, args, seed));
    let paths = ["visibility", "std_error"].map(|what| folder.join(format!("{name}.{what}.npy")));
    let [visibility, std_error] = [&paths[0], &paths[1]].map(|path| load(path, gbuffer.pixel_count()));
    if let (Some(values), Some(std_error)) = (visibility, std_error) {
        let visibility = VisibilityImage { width: gbuffer.width, height: gbuffer.height, values };
        return Ok(GroundTruth { visibility, std_error, valid: valid_pixels(gbuffer, view.light()) });
    }
    let (truth, _) = ground_truth::trace(view, gbuffer, args, seed, console)?;
    std::fs::create_dir_all(folder).map_err(|source| CliError::Write { path: folder.to_owned(), source })?;
    for (path, values) in paths.iter().zip([&truth.visibility.values, &truth.std_error]) {
        write::npy_f32(path, values, gbuffer.width, gbuffer.height)?;
    }
    Ok(truth)
}

/// The values of a file, if it holds as many as expected.
fn load(path: &Path, count: usize) -> Option<Vec<f32>> {
    let file = npyz::NpyFile::new(BufReader::new(File::open(path).ok()?)).ok()?;
    let values: Vec<f32> = file.into_vec().ok()?;
    (values.len() == count).then_some(values)
}

fn hash(view: &View, args: &TruthArgs, seed: u64) -> u64 {
    let mut hasher = DefaultHasher::new();
    let scene = &view.setup.scene;
    (env!("CARGO_PKG_VERSION"), args.samples, args.exact, args.max_error.map(f32::to_bits), seed)
        .hash(&mut hasher);
    for position in scene.positions() {
        position.to_array().map(f32::to_bits).hash(&mut hasher);
    }
    scene.triangles().hash(&mut hasher);
    for uv in scene.uvs() {
        uv.to_array().map(f32::to_bits).hash(&mut hasher);
    }
    for object in scene.objects() {
        format!("{:?}", object.flags).hash(&mut hasher);
        if let Some(mask) = &object.alpha {
            (mask.width(), mask.height(), mask.texels()).hash(&mut hasher);
        }
    }
    // Floats print as themselves: equal text is equal camera and light.
    format!("{:?} {:?}", view.setup.camera, view.light()).hash(&mut hasher);
    hasher.finish()
}
