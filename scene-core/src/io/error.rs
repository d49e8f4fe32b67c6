//! Why something could not be loaded: always the file, and the place in it.

use std::path::PathBuf;

use thiserror::Error;

use super::obj::ObjFault;

/// Why a scene, mesh or texture was refused. Every message opens with the file's path and names the line,
/// field or element where there is one.
#[derive(Debug, Error)]
pub enum LoadError {
    /// The file cannot be read: it is missing, a directory, not permitted.
    #[error("{}: {}", path.display(), reading(source))]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// The name's ending says nothing that can be loaded.
    #[error("{}: {} is not a scene: give a .toml, .json, .obj, .gltf or .glb file", path.display(), ending(extension))]
    Extension {
        /// The file.
        path: PathBuf,
        /// The ending without its dot; empty if there is none.
        extension: String,
    },
    /// More than [`Limits`](super::Limits) allow.
    #[error("{}: {count} {what}: the limit is {limit}", path.display())]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// What there is too much of.
        what: &'static str,
        /// How much there is.
        count: u64,
        /// How much is allowed.
        limit: u64,
    },
    /// An OBJ file is broken at a line.
    #[error("{}:{line}: {fault}", path.display())]
    Obj {
        /// The file.
        path: PathBuf,
        /// The line, from 1.
        line: usize,
        /// What is wrong there.
        fault: ObjFault,
    },
    /// A text does not follow its format, or holds a key or type that its format does not know.
    #[error("{}:{line}:{column}: {message}", path.display())]
    Syntax {
        /// The file.
        path: PathBuf,
        /// The line, from 1.
        line: usize,
        /// The column in characters, from 1.
        column: usize,
        /// What is wrong, with the field where that is known.
        message: String,
    },
    /// A field or element is well-formed, but what it says cannot be.
    #[error("{}: {element}: {message}", path.display())]
    Element {
        /// The file.
        path: PathBuf,
        /// The field of a scene file ("meshes\[1\].scale"), or an element of a glTF file ("nodes\[3\]").
        element: String,
        /// What is wrong with it.
        message: String,
    },
    /// The file as a whole makes no scene.
    #[error("{}: {message}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// Why.
        message: String,
    },
    /// A file that another one refers to was refused.
    #[error("{}: {element}: {source}", path.display())]
    Within {
        /// The file that refers.
        path: PathBuf,
        /// The field, element or line that refers.
        element: String,
        /// Why the other was refused.
        source: Box<LoadError>,
    },
}

/// Says what to do about the commonest faults; the system's words for the rest.
fn reading(error: &std::io::Error) -> String {
    match error.kind() {
        std::io::ErrorKind::NotFound => "there is no such file".to_owned(),
        std::io::ErrorKind::IsADirectory => "this is a folder, not a file".to_owned(),
        _ => format!("cannot be read: {error}"),
    }
}

/// "'.stl'", or words for a name without ending.
fn ending(extension: &str) -> String {
    if extension.is_empty() { "a file without an ending".to_owned() } else { format!("'.{extension}'") }
}
