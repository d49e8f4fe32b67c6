//! What a scene looks like with every technique's defaults: shaded, and its error, side by side.

use std::path::{Path, PathBuf};

use image::RgbImage;
use image::imageops::{FilterType, resize};
use scene_core::io::write;
use scene_core::metrics;

use crate::error::CliError;
use crate::ground_truth::GroundTruth;
use crate::measure::Run;
use crate::picture;
use crate::picture::error_map::error_map;
use crate::picture::shading::Shading;

/// Width of each of the two images.
const WIDTH: u32 = 240;
/// Error at which the error maps saturate.
pub(crate) const ERROR_SCALE: f32 = 0.5;

/// The file of a picture: `key` with what a file name may hold.
pub(crate) fn path(folder: &Path, key: &str) -> PathBuf {
    let plain: String = key.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '-' }).collect();
    folder.join(format!("{plain}.png"))
}

/// Writes ground truth alone.
pub(crate) fn write_truth(path: &Path, truth: &GroundTruth, shading: &Shading) -> Result<(), CliError> {
    put(path, &small(&shading.picture(&truth.visibility)))
}

/// Writes a run and its error.
pub(crate) fn write_run(
    path: &Path,
    run: &Run,
    truth: &GroundTruth,
    shading: &Shading,
) -> Result<(), CliError> {
    let signed = metrics::signed_error(&run.visibility, &truth.visibility, &truth.valid)?;
    let (left, right) = (
        small(&shading.picture(&run.visibility)),
        small(&error_map(&signed, &truth.visibility, ERROR_SCALE)),
    );
    let mut both = RgbImage::new(left.width() + right.width(), left.height());
    image::imageops::replace(&mut both, &left, 0, 0);
    image::imageops::replace(&mut both, &right, i64::from(left.width()), 0);
    put(path, &both)
}

fn small(image: &RgbImage) -> RgbImage {
    let width = WIDTH.min(image.width());
    let height = (image.height() * width / image.width().max(1)).max(1);
    resize(image, width, height, FilterType::Triangle)
}

fn put(path: &Path, image: &RgbImage) -> Result<(), CliError> {
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder)
            .map_err(|source| CliError::Write { path: folder.to_owned(), source })?;
    }
    Ok(write::bytes(path, &picture::small_png(image)?)?)
}
