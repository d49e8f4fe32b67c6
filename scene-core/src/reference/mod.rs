//! Ray-traced ground truth, and which pixels may be compared.
//!
//! [`reference`] is what every technique is held against: V by many shadow rays a pixel, with an estimate of
//! its own error. [`valid_pixels`] says where a comparison means anything.

mod occlusion;
mod sampled;
mod valid;

pub use occlusion::Occlusion;
pub use sampled::{Cancelled, Reference, ReferenceSettings, no_progress, reference};
pub use valid::valid_pixels;
