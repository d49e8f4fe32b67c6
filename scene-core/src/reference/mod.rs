//! Ray-traced ground truth, and which pixels may be compared.
//!
//! [`reference`] is what every technique is held against: V by many shadow rays a pixel, with an estimate of
//! its own error. [`valid_pixels`] says where a comparison means anything.

mod exact;
mod occlusion;
mod sampled;
mod tiles;
mod valid;

pub use exact::{CasterSearch, ExactError, exact_reference};
pub use occlusion::Occlusion;
pub use sampled::{ReferenceSettings, reference};
pub use tiles::{Cancelled, Reference, no_progress};
pub use valid::valid_pixels;

/// Stand-in.
fn shadow_origin(position: glam::Vec3, normal: glam::Vec3, magnitude: f32) -> glam::Vec3 {
    let largest = position.abs().max_element().max(magnitude);
    position + normal * (largest / (1 << 21) as f32)
}
