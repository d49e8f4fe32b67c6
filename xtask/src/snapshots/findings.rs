//! What tests left behind: pictures and texts that differ, are new, or are asked for by nobody.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::shell::CheckError;

/// One snapshot that is not as it should be.
#[derive(Debug)]
pub(crate) enum Finding {
    /// A picture that differs from its golden one, or has none.
    Picture {
        name: String,
        why: String,
        /// Where `actual.png` and, if there is one, `expected.png` and `difference.png` are.
        folder: PathBuf,
        golden: PathBuf,
        /// The CPU's is the one truth: a picture of another backend can only be shown.
        may_be_accepted: bool,
    },
    /// A text that differs from its snapshot, or has none.
    Text { name: String, snapshot: PathBuf, pending: PathBuf, expected: Option<String>, actual: String },
    /// A file that no test asks for.
    LeftOver { file: PathBuf },
}

impl Finding {
    pub(crate) fn name(&self) -> String {
        match self {
            Self::Picture { name, .. } | Self::Text { name, .. } => name.clone(),
            Self::LeftOver { file } => file.display().to_string(),
        }
    }

    pub(crate) fn why(&self) -> String {
        match self {
            Self::Picture { why, .. } => why.clone(),
            Self::Text { expected: None, .. } => "it has no snapshot".to_owned(),
            Self::Text { .. } => "the text differs".to_owned(),
            Self::LeftOver { .. } => "no test asks for it".to_owned(),
        }
    }

    /// Puts it into the tree; a line about what was done.
    pub(crate) fn accept(&self) -> Result<String, CheckError> {
        let written = |path: &Path, bytes: &[u8]| {
            let folder = path.parent().unwrap_or(path);
            fs::create_dir_all(folder)
                .and_then(|()| fs::write(path, bytes))
                .map_err(|source| CheckError::Write { path: path.to_owned(), source })?;
            Ok(format!("wrote {}", path.display()))
        };
        match self {
            Self::Picture { golden, folder, may_be_accepted: true, .. } => {
                written(golden, &read(&folder.join("actual.png"))?)
            }
            Self::Picture { name, .. } => Ok(format!("left {name}: the CPU's picture is the reference")),
            Self::Text { snapshot, pending, .. } if snapshot.extension().is_some_and(|e| e == "snap") => {
                let text = String::from_utf8_lossy(&read(pending)?).into_owned();
                written(snapshot, without_line_number(&text).as_bytes())
            }
            Self::Text { name, .. } => Ok(format!("left {name}: it stands in the test, change it there")),
            Self::LeftOver { file } => {
                fs::remove_file(file).map_err(|source| CheckError::Write { path: file.clone(), source })?;
                Ok(format!("removed {}", file.display()))
            }
        }
    }
}

/// All there is below a report's folder; `root` is the workspace's.
pub(super) fn findings(report: &Path, root: &Path, all_have_run: bool) -> Result<Vec<Finding>, CheckError> {
    let mut found = Vec::new();
    for file in files(&report.join("pictures"))? {
        if file.file_name().is_some_and(|name| name == "failure.json") {
            found.push(picture(&file)?);
        }
    }
    let text = report.join("text");
    for pending in files(&text)? {
        let place = root.join(pending.strip_prefix(&text).unwrap_or(&pending));
        // `a.snap.new` is to become `a.snap`; what stands in a test's source is pending by another name.
        let snapshot = place.with_extension("");
        let name = snapshot.strip_prefix(root).unwrap_or(&snapshot).display().to_string();
        let body = |bytes: Vec<u8>| body(&String::from_utf8_lossy(&bytes)).to_owned();
        let expected = if snapshot.exists() { Some(body(read(&snapshot)?)) } else { None };
        found.push(Finding::Text { name, expected, actual: body(read(&pending)?), snapshot, pending });
    }
    if all_have_run {
        let asked_for = fs::read_to_string(report.join("asked-for.txt")).unwrap_or_default();
        found.extend(left_over(root, &asked_for)?.into_iter().map(|file| Finding::LeftOver { file }));
    }
    Ok(found)
}

fn picture(file: &Path) -> Result<Finding, CheckError> {
    let report: Value = serde_json::from_slice(&read(file)?)
        .map_err(|error| CheckError::Failed(format!("{}: {error}", file.display())))?;
    let text = |key: &str| report[key].as_str().unwrap_or_default().to_owned();
    let golden = PathBuf::from(text("golden"));
    Ok(match text("backend").as_str() {
        "none" => Finding::LeftOver { file: golden },
        backend => Finding::Picture {
            name: text("name"),
            why: text("why"),
            folder: file.parent().unwrap_or(file).to_owned(),
            golden,
            may_be_accepted: backend == "cpu",
        },
    })
}

/// Snapshots below `root` that are not among the lines of `asked_for`.
fn left_over(root: &Path, asked_for: &str) -> Result<Vec<PathBuf>, CheckError> {
    let canonical = |path: &Path| path.canonicalize().unwrap_or_else(|_| path.to_owned());
    let asked_for: BTreeSet<PathBuf> = asked_for.lines().map(|line| canonical(Path::new(line))).collect();
    let mut left_over = Vec::new();
    for member in
        fs::read_dir(root).map_err(|source| CheckError::Read { path: root.to_owned(), source })?.flatten()
    {
        for file in files(&member.path().join("tests"))? {
            let is_snapshot = file.extension().is_some_and(|ending| ending == "snap");
            if is_snapshot && !asked_for.contains(&canonical(&file)) {
                left_over.push(file);
            }
        }
    }
    Ok(left_over)
}

/// Files below a folder, sorted; none if there is no such folder.
fn files(folder: &Path) -> Result<Vec<PathBuf>, CheckError> {
    let mut files = Vec::new();
    if folder.is_dir() {
        for entry in
            fs::read_dir(folder).map_err(|source| CheckError::Read { path: folder.to_owned(), source })?
        {
            let path = entry.map_err(|source| CheckError::Read { path: folder.to_owned(), source })?.path();
            if path.is_dir() {
                files.extend(self::files(&path)?);
            } else {
                files.push(path);
            }
        }
    }
    files.sort();
    Ok(files)
}

fn read(path: &Path) -> Result<Vec<u8>, CheckError> {
    fs::read(path).map_err(|source| CheckError::Read { path: path.to_owned(), source })
}

/// A snapshot without the lines about it at its head.
fn body(text: &str) -> &str {
    text.strip_prefix("---\n").and_then(|rest| rest.split_once("\n---\n")).map_or(text, |(_, body)| body)
}

/// A pending snapshot as it is kept: the line of the test, which every edit moves, is left out.
fn without_line_number(text: &str) -> String {
    let head = text.len() - body(text).len();
    let keep = |line: &&str| !line.starts_with("assertion_line:");
    text[..head].split_inclusive('\n').filter(keep).collect::<String>() + &text[head..]
}

#[cfg(test)]
mod tests {
    use super::*;

    const PENDING: &str =
        "---\nsource: a/tests/b.rs\nassertion_line: 7\nexpression: x\n---\nnew\nassertion_line: 1\n";

    fn tree(files: &[(&str, &str)]) -> tempfile::TempDir {
        let tree = tempfile::tempdir().unwrap();
        for (name, text) in files {
            let path = tree.path().join(name);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, text).unwrap();
        }
        tree
    }

    #[test]
    fn texts_are_found_and_accepted_without_their_line() {
        let tree = tree(&[
            ("a/tests/snapshots/b.snap", "---\nsource: a/tests/b.rs\n---\nold\n"),
            ("report/text/a/tests/snapshots/b.snap.new", PENDING),
            ("report/text/a/tests/snapshots/c.snap.new", PENDING),
        ]);
        let found = findings(&tree.path().join("report"), tree.path(), false).unwrap();
        assert_eq!(
            found.iter().map(Finding::why).collect::<Vec<_>>(),
            ["the text differs", "it has no snapshot"]
        );
        for finding in &found {
            finding.accept().unwrap();
        }
        for name in ["b", "c"] {
            let text =
                fs::read_to_string(tree.path().join(format!("a/tests/snapshots/{name}.snap"))).unwrap();
            assert_eq!(text, "---\nsource: a/tests/b.rs\nexpression: x\n---\nnew\nassertion_line: 1\n");
        }
    }

    #[test]
    fn only_pictures_of_the_cpu_are_accepted() {
        for (backend, accepted) in [("cpu", true), ("gpu", false)] {
            let tree = tree(&[("report/pictures/p/actual.png", "new")]);
            let golden = tree.path().join("golden/p.png");
            let failure =
                serde_json::json!({ "name": "p", "backend": backend, "golden": golden, "why": "differs" });
            fs::write(tree.path().join("report/pictures/p/failure.json"), failure.to_string()).unwrap();
            let found = findings(&tree.path().join("report"), tree.path(), false).unwrap();
            assert_eq!((found.len(), found[0].why()), (1, "differs".to_owned()));
            found[0].accept().unwrap();
            assert_eq!(golden.exists(), accepted, "{backend}");
        }
    }

    #[test]
    fn snapshots_that_no_test_asks_for_are_found_and_removed() {
        let tree = tree(&[("a/tests/snapshots/b.snap", ""), ("a/tests/snapshots/c.snap", "")]);
        let asked_for = tree.path().join("a/tests/snapshots/b.snap");
        fs::create_dir_all(tree.path().join("report")).unwrap();
        fs::write(tree.path().join("report/asked-for.txt"), format!("{}\n", asked_for.display())).unwrap();
        let found = findings(&tree.path().join("report"), tree.path(), true).unwrap();
        assert_eq!(found.len(), 1, "{found:?}");
        found[0].accept().unwrap();
        assert!(asked_for.exists() && !tree.path().join("a/tests/snapshots/c.snap").exists());
    }

    #[test]
    fn nothing_is_found_where_all_is_well() {
        let tree = tree(&[("a/tests/snapshots/b.snap", "")]);
        assert!(findings(&tree.path().join("report"), tree.path(), false).unwrap().is_empty());
    }
}
