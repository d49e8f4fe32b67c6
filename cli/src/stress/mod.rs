//! Numerical stability: scenes that are hard on numbers, shaded by every technique and held against ray tracing.
//!
//! A [`trial`] is a scene. Some are another scene moved, scaled or cut up ([`change`]), which must not change the image: their error
//! may exceed that of the scene as it was by no more than [`verdict`] allows. The others need only stay finite and in [0, 1].

pub(crate) mod change;
pub(crate) mod trial;
pub(crate) mod verdict;
