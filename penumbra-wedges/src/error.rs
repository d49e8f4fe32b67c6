//! Why no wedges were made.

use scene_core::geometry::TopologyError;
use scene_core::technique::{Params as _, TechniqueError};
use thiserror::Error;

use crate::WedgeParams;

/// Why no wedges were made.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum WedgeError {
    /// The edges could not be numbered.
    #[error(transparent)]
    Topology(#[from] TopologyError),
    /// A caster has holes that its triangles do not know of, and the variant knows no rays.
    #[error(
        "caster '{object}' has a cut-out mask, and the outline of its holes is in a texture, where there are no edges to make wedges of: only the variant `exact` takes it, by shadow rays"
    )]
    Masked {
        /// The object's name.
        object: String,
    },
}

impl From<WedgeError> for TechniqueError {
    fn from(error: WedgeError) -> Self {
        match error {
            WedgeError::Masked { .. } => Self::Unsupported {
                technique: WedgeParams::TECHNIQUE,
                input: "casters with cut-out masks".to_owned(),
                why: error.to_string(),
            },
            WedgeError::Topology(_) => Self::Other(Box::new(error)),
        }
    }
}
