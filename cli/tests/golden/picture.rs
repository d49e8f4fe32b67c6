//! Visibility in a PNG file: 16-bit grey, linear in V, and transparent where nothing is seen.
//!
//! 16 bits round V by at most 2⁻¹⁷, far below what a comparison allows.

use std::fs;
use std::path::Path;

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ImageBuffer, LumaA};

/// An image of visibility.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Picture {
    pub(crate) width: u32,
    pub(crate) height: u32,
    /// V; NaN where nothing is seen.
    pub(crate) values: Vec<f32>,
}

impl Picture {
    /// Reads a golden picture.
    pub(crate) fn read(path: &Path) -> Result<Self, String> {
        let image = image::open(path).map_err(|error| format!("{}: {error}", path.display()))?;
        let image = image.into_luma_alpha16();
        let value = |LumaA([v, alpha]): &LumaA<u16>| {
            if *alpha == 0 { f32::NAN } else { f32::from(*v) / 65535.0 }
        };
        Ok(Self { width: image.width(), height: image.height(), values: image.pixels().map(value).collect() })
    }

    /// Reads what the command writes.
    pub(crate) fn read_npy(path: &Path) -> Result<Self, libtest_mimic::Failed> {
        let bytes = fs::read(path)?;
        let file = npyz::NpyFile::new(&bytes[..])?;
        let &[height, width] = file.shape() else {
            return Err(format!("visibility.npy has the shape {:?}", file.shape()).into());
        };
        Ok(Self { width: u32::try_from(width)?, height: u32::try_from(height)?, values: file.into_vec()? })
    }

    /// The file of a golden picture.
    pub(crate) fn png(&self) -> Vec<u8> {
        let image = ImageBuffer::from_fn(self.width, self.height, |x, y| {
            let v = self.values[(y * self.width + x) as usize];
            LumaA(if v.is_nan() { [0, 0] } else { [(v.clamp(0.0, 1.0) * 65535.0 + 0.5) as u16, u16::MAX] })
        });
        let mut bytes = Vec::new();
        let encoder = PngEncoder::new_with_quality(&mut bytes, CompressionType::Best, FilterType::Adaptive);
        image.write_with_encoder(encoder).expect("memory takes a small picture");
        bytes
    }
}
