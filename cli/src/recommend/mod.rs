//! Which technique for which scene: picked by a model fitted on what `gnomon bench` measured.
//!
//! 1. [`preview`]: the scene in a small picture with ground truth. Its [`features`] are cheap: triangles, pixels, how wrong a
//!    hard shadow is, how much of the picture is penumbra, and how wide that is.
//! 2. [`model`]: for each contender of the [`data`] two ridge regressions, of the logarithms of time and error, on the logarithms
//!    of the features. It names a short list.
//! 3. The short list is tried on the preview, and two further regressions, which know what a contender took and missed there, have
//!    the last word ([`choice`]).
//!
//! The data are measurements, not coefficients: fitting takes less time than reading them. How often the pick is right is
//! measured with every scene left out in turn ([`check`]).

pub(crate) mod check;
pub(crate) mod choice;
pub(crate) mod data;
pub(crate) mod features;
pub(crate) mod model;
pub(crate) mod preview;
pub(crate) mod regression;
