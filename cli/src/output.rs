//! The files of a command: all of them, or none.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use scene_core::io::write::WriteError;
use tempfile::TempDir;

use crate::error::CliError;

/// A folder that a command will write to.
#[derive(Debug)]
pub(crate) struct OutputFolder {
    path: PathBuf,
}

impl OutputFolder {
    /// Checks that `path` can be written to, so that a long computation is not lost at its end. Leaves
    /// nothing behind.
    pub(crate) fn check(path: &Path) -> Result<Self, CliError> {
        let folder = Self { path: path.to_owned() };
        if path.exists() && !path.is_dir() {
            return Err(folder.fault(io::Error::new(io::ErrorKind::NotADirectory, "it is not a folder")));
        }
        folder.stage()?;
        Ok(folder)
    }

    /// The folder.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// Lets `fill` write files into an empty folder, then moves them to their place: a new folder appears whole,
    /// in one that exists each file appears whole.
    pub(crate) fn write(&self, fill: impl FnOnce(&Path) -> Result<(), WriteError>) -> Result<(), CliError> {
        let staging = self.stage()?;
        // A folder inside, because the temporary one is closed to other users and its name is not ours.
        let whole = staging.path().join("files");
        fs::create_dir(&whole).map_err(|source| self.fault(source))?;
        fill(&whole).map_err(|error| match error {
            // Nobody knows the place where it was tried.
            WriteError::Io { path, source } => self.fault_of(&path, source),
            size @ WriteError::Size { .. } => size.into(),
        })?;
        if !self.path.exists() {
            if let Some(parent) = self.path.parent() {
                fs::create_dir_all(parent).map_err(|source| self.fault(source))?;
            }
            return fs::rename(&whole, &self.path).map_err(|source| self.fault(source));
        }
        for file in fs::read_dir(&whole).map_err(|source| self.fault(source))? {
            let file = file.map_err(|source| self.fault(source))?;
            let place = self.path.join(file.file_name());
            fs::rename(file.path(), place).map_err(|source| self.fault_of(&file.path(), source))?;
        }
        Ok(())
    }

    /// A temporary folder on the file system of the folder: in itself, or in its nearest ancestor that exists.
    fn stage(&self) -> Result<TempDir, CliError> {
        let ancestor = self
            .path
            .ancestors()
            .map(|a| if a.as_os_str().is_empty() { Path::new(".") } else { a })
            .find(|a| a.exists())
            .unwrap_or(Path::new("."));
        tempfile::Builder::new().prefix(".gnomon-").tempdir_in(ancestor).map_err(|source| self.fault(source))
    }

    fn fault(&self, source: io::Error) -> CliError {
        CliError::Write { path: self.path.clone(), source }
    }

    fn fault_of(&self, staged: &Path, source: io::Error) -> CliError {
        CliError::Write { path: self.path.join(staged.file_name().unwrap_or_default()), source }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use scene_core::io::write::bytes;

    fn names(path: &Path) -> Vec<String> {
        let mut names: Vec<_> =
            fs::read_dir(path).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    #[test]
    fn a_new_folder_appears_whole_and_an_old_one_keeps_its_other_files() {
        let root = tempfile::tempdir().unwrap();
        let path = root.path().join("a/b");
        let folder = OutputFolder::check(&path).unwrap();
        assert!(names(root.path()).is_empty(), "checking left something behind");
        folder
            .write(|to| {
                bytes(&to.join("one"), b"1")?;
                bytes(&to.join("two"), b"2")
            })
            .unwrap();
        assert_eq!(
            (names(root.path()), names(&path)),
            (vec!["a".to_owned()], vec!["one".into(), "two".into()])
        );
        fs::write(path.join("mine"), "kept").unwrap();
        folder.write(|to| bytes(&to.join("two"), b"3")).unwrap();
        assert_eq!(names(&path), ["mine", "one", "two"]);
        assert_eq!(fs::read(path.join("two")).unwrap(), b"3");
    }

    #[test]
    fn a_file_in_the_way_is_told_and_nothing_is_left() {
        let root = tempfile::tempdir().unwrap();
        let path = root.path().join("file");
        fs::write(&path, "x").unwrap();
        assert!(OutputFolder::check(&path).is_err());
        assert!(OutputFolder::check(&path.join("below")).is_err());
        let folder = OutputFolder::check(&root.path().join("out")).unwrap();
        let error = folder.write(|to| {
            bytes(&to.join("one"), b"1")?;
            // A folder that is not there makes the second file fail.
            bytes(&to.join("no/such"), b"2")
        });
        let Err(CliError::Write { path, .. }) = error else { panic!("{error:?}") };
        assert_eq!(path, root.path().join("out/such"));
        assert_eq!(names(root.path()), ["file"]);
    }
}
