//! Pictures for people: shaded images, visibility in grey, error maps, and what a contact sheet is drawn with.

pub(crate) mod canvas;
pub(crate) mod colour;
pub(crate) mod error_map;
pub(crate) mod shading;
pub(crate) mod texels;

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{DynamicImage, GrayAlphaImage, LumaA, RgbImage};
use scene_core::VisibilityImage;

use crate::error::CliError;

/// Visibility as grey, 0 black and 255 fully lit, linear in V; transparent where nothing is seen.
pub(crate) fn grey(visibility: &VisibilityImage) -> GrayAlphaImage {
    GrayAlphaImage::from_fn(visibility.width, visibility.height, |x, y| {
        let v = visibility.at(x, y);
        if v.is_nan() { LumaA([0, 0]) } else { LumaA([(v.clamp(0.0, 1.0) * 255.0 + 0.5) as u8, 255]) }
    })
}

/// A PNG file of the image. Encoding into memory cannot fail but for want of memory or an image without
/// pixels, which a camera never has.
pub(crate) fn png(image: impl Into<DynamicImage>) -> Result<Vec<u8>, CliError> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    image
        .into()
        .write_to(&mut bytes, image::ImageFormat::Png)
        .map_err(|error| CliError::Encode { what: "a PNG", source: error.into() })?;
    Ok(bytes.into_inner())
}

/// [`png`], encoded as small as it gets: for pictures that are kept beside sources. Takes several times as long.
pub(crate) fn small_png(image: &RgbImage) -> Result<Vec<u8>, CliError> {
    let mut bytes = Vec::new();
    image
        .write_with_encoder(PngEncoder::new_with_quality(
            &mut bytes,
            CompressionType::Best,
            FilterType::Adaptive,
        ))
        .map_err(|error| CliError::Encode { what: "a PNG", source: error.into() })?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grey_is_linear_and_transparent_where_nothing_is_seen() {
        let visibility = VisibilityImage { width: 4, height: 1, values: vec![0.0, 0.5, 1.0, f32::NAN] };
        let pixels: Vec<_> = grey(&visibility).pixels().map(|p| p.0).collect();
        assert_eq!(pixels, [[0, 255], [128, 255], [255, 255], [0, 0]]);
    }
}
