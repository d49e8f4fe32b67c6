//! Reading whole files within limits.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use super::{Limits, LoadError};

/// Reads `path` whole.
///
/// # Errors
/// [`LoadError::Read`] for what cannot be opened or is a folder, [`LoadError::TooLarge`] before anything is
/// allocated, or as soon as a file without a known size (a pipe, a device) has given more than the limit.
pub(super) fn read(path: &Path, limits: &Limits) -> Result<Vec<u8>, LoadError> {
    let unreadable = |source| LoadError::Read { path: path.to_owned(), source };
    let file = File::open(path).map_err(unreadable)?;
    let metadata = file.metadata().map_err(unreadable)?;
    if metadata.is_dir() {
        return Err(unreadable(std::io::ErrorKind::IsADirectory.into()));
    }
    let limit = limits.file_bytes;
    let too_large = |count| LoadError::TooLarge { path: path.to_owned(), what: "bytes", count, limit };
    if metadata.len() > limit {
        return Err(too_large(metadata.len()));
    }
    let mut bytes = Vec::with_capacity(metadata.len() as usize);
    file.take(limit.saturating_add(1)).read_to_end(&mut bytes).map_err(unreadable)?;
    if bytes.len() as u64 > limit {
        return Err(too_large(bytes.len() as u64));
    }
    Ok(bytes)
}

/// The file's name without folders, for headings and notes.
pub(super) fn name(path: &Path) -> String {
    path.file_name().map_or_else(|| path.display().to_string(), |n| n.to_string_lossy().into_owned())
}

/// The file's name without folders and ending.
pub(super) fn stem(path: &Path) -> String {
    path.file_stem().map_or_else(|| name(path), |n| n.to_string_lossy().into_owned())
}

/// What comes after the last dot, in lower case.
pub(super) fn extension(path: &Path) -> String {
    path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default()
}
