//! Why no volumes were made.

use scene_core::geometry::TopologyError;
use thiserror::Error;

/// Why no volumes were made.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum VolumeError {
    /// The edges could not be numbered.
    #[error(transparent)]
    Topology(#[from] TopologyError),
}
