//! Errors against ground truth, and how much of an image is lit, penumbra and umbra.

use scene_core::{VisibilityImage, metrics};
use serde::Serialize;

use crate::ground_truth::GroundTruth;

/// Below this V a pixel counts as umbra, above its complement as lit: the bounds of `pen_rmse`.
const EDGE: f32 = 0.001;

/// Shares of valid pixels; NaN if there is none.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(crate) struct Shares {
    pub(crate) lit: f64,
    pub(crate) penumbra: f64,
    pub(crate) umbra: f64,
}

impl Shares {
    /// Counts the valid pixels of an image.
    pub(crate) fn new(visibility: &VisibilityImage, valid: &[bool]) -> Self {
        let values = || visibility.values.iter().zip(valid).filter(|(_, valid)| **valid).map(|(v, _)| *v);
        let count = values().count() as f64;
        let lit = values().filter(|&v| v >= 1.0 - EDGE).count() as f64 / count;
        let umbra = values().filter(|&v| v <= EDGE).count() as f64 / count;
        Self { lit, penumbra: 1.0 - lit - umbra, umbra }
    }
}

/// Errors over valid pixels; NaN if there is none, `pen_rmse` also where there is no penumbra.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(crate) struct Errors {
    pub(crate) mae: f64,
    pub(crate) rmse: f64,
    pub(crate) p99: f64,
    pub(crate) pen_rmse: f64,
}

impl Errors {
    /// The errors of an image of ground truth's size.
    pub(crate) fn new(visibility: &VisibilityImage, truth: &GroundTruth) -> Self {
        let (reference, valid) = (&truth.visibility, &truth.valid[..]);
        Self {
            mae: f64::from(metrics::mae(visibility, reference, valid)),
            rmse: f64::from(metrics::rmse(visibility, reference, valid)),
            p99: f64::from(metrics::p99(visibility, reference, valid)),
            pen_rmse: f64::from(metrics::pen_rmse(visibility, reference, valid)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_add_up_over_valid_pixels() {
        let values = vec![0.0, 0.0005, 0.4, 1.0, 0.9995, f32::NAN, 0.5, 1.0];
        let image = VisibilityImage { width: 8, height: 1, values };
        let valid = [true, true, true, true, true, false, false, false];
        let shares = Shares::new(&image, &valid);
        assert!((shares.umbra - 0.4).abs() < 1e-9 && (shares.lit - 0.4).abs() < 1e-9);
        assert!((shares.penumbra - 0.2).abs() < 1e-9);
        assert!(Shares::new(&image, &[false; 8]).lit.is_nan());
    }
}
