//! Why no volumes were made.

use scene_core::geometry::TopologyError;
use thiserror::Error;

/// Why no volumes were made.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum VolumeError {
    /// The edges could not be numbered.
    #[error(transparent)]
    Topology(#[from] TopologyError),
    /// A caster has holes that its triangles do not know of.
    #[error(
        "caster '{object}' has a cut-out mask: the outline of its holes is in a texture, where there are no edges to make a volume of"
    )]
    Masked {
        /// The object's name.
        object: String,
    },
}
