//! Why a shader could not be linked, with file and line.

use std::fmt;
use std::path::PathBuf;

use thiserror::Error;

/// A place in a source file. Lines and columns count from 1.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Place {
    /// The file.
    pub file: PathBuf,
    /// The line.
    pub line: usize,
    /// The column, in characters.
    pub column: usize,
}

impl Place {
    /// The place of byte `offset` of `source`, the text of `file`. An offset past the end is the end.
    pub fn of_offset(file: impl Into<PathBuf>, source: &str, offset: usize) -> Self {
        let before = source.get(..offset).unwrap_or(source);
        let line_start = before.rfind('\n').map_or(0, |newline| newline + 1);
        Self {
            file: file.into(),
            line: before.matches('\n').count() + 1,
            column: before[line_start..].chars().count() + 1,
        }
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}:{}", self.file.display(), self.line, self.column)
    }
}

/// Why linking failed.
#[derive(Debug, Error)]
pub enum LinkError {
    /// A module is broken: syntax, an import that does not exist.
    #[error("{place}: {message}")]
    Module {
        /// Where.
        place: Place,
        /// What.
        message: String,
    },
    /// A folder without a single module: a crate that asks for linking has shaders.
    #[error("{folder} holds no .wesl file")]
    Empty {
        /// The folder.
        folder: PathBuf,
    },
    /// A file or folder cannot be read or written.
    #[error("{path}: {source}")]
    File {
        /// The file.
        path: PathBuf,
        /// Why not.
        source: std::io::Error,
    },
    /// The name of a module is no identifier, so nothing could import it.
    #[error("{path}: a module's file name must be lower_snake_case.wesl")]
    Name {
        /// The file.
        path: PathBuf,
    },
    /// Called outside a build script, or without a dependency on gnomon-scene-core.
    #[error(
        "{name} is not set: this runs in build scripts, of crates with gnomon-scene-core among [dependencies]"
    )]
    NotABuildScript {
        /// The variable that Cargo would have set.
        name: &'static str,
    },
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn offsets_become_lines_and_columns() {
        let place = |offset| {
            let Place { line, column, .. } = Place::of_offset("f", "ab\ncd", offset);
            (line, column)
        };
        assert_eq!((place(0), place(1), place(3), place(4)), ((1, 1), (1, 2), (2, 1), (2, 2)));
        assert_eq!(place(99), (2, 3));
    }
}
