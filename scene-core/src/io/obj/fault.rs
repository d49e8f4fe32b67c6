//! What can be wrong with a line of an OBJ or MTL file.

use thiserror::Error;

use crate::geometry::PolygonFault;

/// What is wrong with a line. Counts and indices are as the file writes them, from 1.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum ObjFault {
    /// A byte that no text holds.
    #[error("byte {0:#04x}: this is not a text file")]
    NotText(u8),
    /// A word that should be a number.
    #[error("'{0}' is not a number")]
    Number(String),
    /// NaN, infinity, or more than f32 holds.
    #[error("{0} is not a finite number")]
    NotFinite(String),
    /// Too few or too many numbers.
    #[error("'{keyword}' needs {expected}, and has {found}")]
    Count {
        /// The line's first word.
        keyword: &'static str,
        /// What it needs.
        expected: &'static str,
        /// Numbers it has.
        found: usize,
    },
    /// A vertex's weight is zero.
    #[error("the vertex's fourth number, its weight, is zero")]
    ZeroWeight,
    /// A face with fewer than three corners.
    #[error("a face needs at least 3 corners, and this one has {0}")]
    Corners(usize),
    /// A corner that is not an index or a triple of them.
    #[error("'{0}' is no corner: write v, v/vt, v//vn or v/vt/vn")]
    Corner(String),
    /// An index of something that does not exist (yet).
    #[error("the face refers to {what} {index}, but there {}", before(*count))]
    OutOfRange {
        /// "vertex", "texture coordinate" or "normal".
        what: &'static str,
        /// The index in the file; negative ones count back from the line.
        index: String,
        /// How many there are above the line.
        count: usize,
    },
    /// A statement that needs a name has none.
    #[error("'{0}' needs a name")]
    Name(&'static str),
    /// A polygon that has no inside.
    #[error(transparent)]
    Polygon(#[from] PolygonFault),
    /// A statement in a form that is not understood.
    #[error("'{0}' is not understood")]
    Statement(String),
}

fn before(count: usize) -> String {
    match count {
        0 => "are none above it".to_owned(),
        1 => "is 1 above it".to_owned(),
        _ => format!("are {count} above it"),
    }
}
