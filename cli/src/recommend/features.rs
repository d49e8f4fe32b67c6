//! What a scene is like, as far as cost and error of shadows depend on it.

use scene_core::VisibilityImage;
use scene_core::metrics;
use serde::{Deserialize, Serialize};

use crate::error::CliError;
use crate::ground_truth::GroundTruth;

/// Figures of a scene, a light and a camera, measured on a small picture.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Features {
    /// Triangles that cast shadows.
    pub(crate) triangles: f64,
    /// Pixels that see a surface, in the picture asked for.
    pub(crate) pixels: f64,
    /// Root mean square error of shadows from the light's middle alone.
    pub(crate) hard_rmse: f64,
    /// Share of compared pixels in penumbra.
    pub(crate) penumbra: f64,
    /// Pixels of penumbra for each pixel side that a hard shadow's edge runs along: its width, in pixels of the picture asked for.
    pub(crate) width: f64,
}

impl Features {
    /// `hard` is the shadow from the light's middle, `pixels_a_pixel` how many pixels a side of the picture asked for a pixel of
    /// these images stands for.
    pub(crate) fn new(
        triangles: usize,
        seen: usize,
        hard: &VisibilityImage,
        truth: &GroundTruth,
        pixels_a_pixel: f64,
    ) -> Result<Self, CliError> {
        let shares = metrics::shares(&truth.visibility, &truth.valid)?;
        let errors = metrics::errors(hard, &truth.visibility, &truth.valid)?;
        let edge = edge_length(hard, &truth.valid);
        let in_penumbra = shares.penumbra * errors.valid as f64;
        Ok(Self {
            triangles: triangles as f64,
            pixels: seen as f64 * pixels_a_pixel.powi(2),
            hard_rmse: errors.rmse,
            penumbra: shares.penumbra,
            width: pixels_a_pixel * in_penumbra / edge.max(1) as f64,
        })
    }

    /// Their logarithms, what a model is linear in. What is added keeps what may be zero finite: an error of a thousandth, a
    /// thousandth of the pixels, a tenth of a pixel.
    pub(crate) fn logarithms(&self) -> Vec<f64> {
        vec![
            self.triangles.max(1.0).ln(),
            self.pixels.max(1.0).ln(),
            (self.hard_rmse + 1e-3).ln(),
            (self.penumbra + 1e-3).ln(),
            (self.width + 0.1).ln(),
        ]
    }
}

/// Sides between neighbouring valid pixels of which one is lit and one is not.
fn edge_length(hard: &VisibilityImage, valid: &[bool]) -> usize {
    let width = hard.width as usize;
    let differ =
        |a: usize, b: usize| valid[a] && valid[b] && (hard.values[a] < 0.5) != (hard.values[b] < 0.5);
    let to_the_right = (0..valid.len()).filter(|pixel| (pixel + 1) % width != 0 && differ(*pixel, pixel + 1));
    let below = (0..valid.len().saturating_sub(width)).filter(|pixel| differ(*pixel, pixel + width));
    to_the_right.count() + below.count()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_penumbra_has_its_width() {
        // Rows of 8 pixels: lit, four of penumbra, dark.
        let soft = [1.0, 1.0, 0.8, 0.6, 0.4, 0.2, 0.0, 0.0];
        let image = |row: [f32; 8]| VisibilityImage { width: 8, height: 3, values: row.repeat(3) };
        let truth = GroundTruth { visibility: image(soft), std_error: vec![0.0; 24], valid: vec![true; 24] };
        let hard = image(soft.map(f32::round));
        let features = Features::new(12, 24, &hard, &truth, 2.0).unwrap();
        assert_eq!((features.width, features.penumbra, features.pixels), (8.0, 0.5, 96.0));
        assert!((features.hard_rmse - (0.4f64 / 8.0).sqrt()).abs() < 1e-6, "{}", features.hard_rmse);
        assert!(features.logarithms().iter().all(|x| x.is_finite()));
    }
}
