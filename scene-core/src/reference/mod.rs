//! Ray-traced ground truth, and which pixels may be compared.
//!
//! [`reference()`] is what every technique is held against: V by many shadow rays a pixel, with an estimate of
//! its own error; [`adaptive_reference`] takes as many as an error asks for, [`exact_reference`] takes areas instead. [`valid_pixels`] says where a comparison means anything.

mod adaptive;
mod exact;
mod occlusion;
pub(crate) mod outline;
mod proof;
mod sampled;
pub(crate) mod shaft;
mod tiles;
mod valid;

pub use adaptive::adaptive_reference;
pub use exact::{ExactError, exact_reference};
pub use occlusion::{CasterSearch, Occlusion};
pub use sampled::{ReferenceSettings, reference};
pub use tiles::{Cancelled, Reference, Work, no_progress};
pub use valid::valid_pixels;
