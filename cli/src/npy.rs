//! Per-pixel values as NumPy files, row by row from the top left.

use npyz::WriterBuilder;
use scene_core::{GBuffer, VisibilityImage};

use crate::error::CliError;

/// float32, H×W.
pub(crate) fn visibility(image: &VisibilityImage) -> Result<Vec<u8>, CliError> {
    encode(&[image.height, image.width], image.values.iter().copied())
}

/// float32, H×W: one value a pixel of the G-buffer.
pub(crate) fn plane(gbuffer: &GBuffer, values: &[f32]) -> Result<Vec<u8>, CliError> {
    encode(&[gbuffer.height, gbuffer.width], values.iter().copied())
}

/// bool, H×W: one value a pixel of the G-buffer.
pub(crate) fn mask(gbuffer: &GBuffer, values: &[bool]) -> Result<Vec<u8>, CliError> {
    encode(&[gbuffer.height, gbuffer.width], values.iter().copied())
}

/// float32, H×W×3: world-space positions, NaN where nothing is seen.
pub(crate) fn positions(gbuffer: &GBuffer) -> Result<Vec<u8>, CliError> {
    encode(&[gbuffer.height, gbuffer.width, 3], gbuffer.position.iter().flat_map(|p| p.to_array()))
}

fn encode<T: npyz::AutoSerialize>(
    shape: &[u32],
    values: impl Iterator<Item = T>,
) -> Result<Vec<u8>, CliError> {
    let shape: Vec<u64> = shape.iter().map(|&side| u64::from(side)).collect();
    let write = || {
        let mut bytes = Vec::new();
        let mut writer =
            npyz::WriteOptions::new().default_dtype().shape(&shape).writer(&mut bytes).begin_nd()?;
        writer.extend(values)?;
        writer.finish()?;
        Ok(bytes)
    };
    write().map_err(|error: std::io::Error| CliError::Encode { what: "an .npy array", source: error.into() })
}
