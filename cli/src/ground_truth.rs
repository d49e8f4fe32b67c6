//! Ground truth of a view, and what it says about its pixels.

use scene_core::{GBuffer, VisibilityImage};
use serde::Serialize;

/// V, the standard error of each pixel's V, and which pixels may be compared.
pub(crate) struct GroundTruth {
    pub(crate) visibility: VisibilityImage,
    pub(crate) std_error: Vec<f32>,
    pub(crate) valid: Vec<bool>,
}
