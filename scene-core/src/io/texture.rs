//! Textures, read for their cut-outs alone.

use std::io::Cursor;
use std::path::Path;

use image::{DynamicImage, ImageReader};

use super::{Limits, LoadError, file};
use crate::geometry::{AlphaMask, Wrap};

/// Deflate holds at most 1032 bytes in one, and a byte eight texels of one bit; JPEG holds fewer. So what a
/// decoder allocates is bounded by what it is given.
const MOST_TEXELS_PER_BYTE: u64 = 8 * 1032;

/// Which channel of a texture says what is solid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Channel {
    /// The alpha channel; solid everywhere without one. glTF.
    Alpha,
    /// The alpha channel if there is one, else the luminance. MTL.
    AlphaOrLuminance,
}

/// One channel of a picture, 8 bits a texel, row by row from the top.
#[derive(Clone, Debug)]
pub(super) struct Texture {
    width: u32,
    height: u32,
    values: Vec<u8>,
}

impl Texture {
    /// Reads a PNG or JPEG file.
    pub(super) fn load(path: &Path, channel: Channel, limits: &Limits) -> Result<Self, LoadError> {
        let bytes = file::read(path, limits)?;
        Self::decode(&bytes, channel, limits)
            .map_err(|message| LoadError::File { path: path.to_owned(), message })
    }

    /// Decodes a PNG or JPEG picture; an error is a sentence without place.
    pub(super) fn decode(bytes: &[u8], channel: Channel, limits: &Limits) -> Result<Self, String> {
        let broken = |error: &dyn std::fmt::Display| format!("the picture cannot be read: {error}");
        let reader = ImageReader::new(Cursor::new(bytes)).with_guessed_format().map_err(|e| broken(&e))?;
        if !matches!(reader.format(), Some(image::ImageFormat::Png | image::ImageFormat::Jpeg)) {
            return Err("the picture is neither PNG nor JPEG".to_owned());
        }
        let decoder = || ImageReader::new(Cursor::new(bytes)).with_guessed_format();
        // The size first: a file of a few bytes can promise gigabytes.
        let (width, height) = decoder().map_err(|e| broken(&e))?.into_dimensions().map_err(|e| broken(&e))?;
        let texels = u64::from(width) * u64::from(height);
        if texels == 0 {
            return Err(format!("the picture is {width} × {height}: it has no texels"));
        }
        if texels > limits.texels {
            return Err(format!(
                "the picture is {width} × {height}, {texels} texels: the limit is {}",
                limits.texels
            ));
        }
        if texels > MOST_TEXELS_PER_BYTE * bytes.len() as u64 {
            return Err(format!(
                "the picture is {width} × {height}: more than its {} bytes can hold",
                bytes.len()
            ));
        }
        let picture = reader.decode().map_err(|e| broken(&e))?;
        let values = match channel {
            _ if picture.color().has_alpha() => alpha(&picture),
            Channel::Alpha => vec![255; texels as usize],
            Channel::AlphaOrLuminance => picture.to_luma8().into_raw(),
        };
        Ok(Self { width, height, values })
    }

    /// Solid where the channel's value, in [0, 1], times `factor` reaches `cutoff`; `None` if all of it is.
    pub(super) fn mask(&self, factor: f32, cutoff: f32, wrap: [Wrap; 2]) -> Option<AlphaMask> {
        let solid = |&v: &u8| f32::from(v) * factor >= cutoff * 255.0;
        AlphaMask::from_solid(self.width, self.height, self.values.iter().map(solid).collect(), wrap)
            .filter(|mask| !mask.is_opaque())
    }
}

fn alpha(picture: &DynamicImage) -> Vec<u8> {
    match picture {
        DynamicImage::ImageLumaA8(pixels) => pixels.pixels().map(|p| p.0[1]).collect(),
        DynamicImage::ImageRgba8(pixels) => pixels.pixels().map(|p| p.0[3]).collect(),
        other => other.to_rgba8().pixels().map(|p| p.0[3]).collect(),
    }
}
