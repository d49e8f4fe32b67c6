//! `cargo xtask tidy`: project rules that no compiler knows.
//!
//! Each rule is a function from a file (or the tree) to sentences about what breaks it, and has a test that
//! accepts and a test that rejects.

use std::fs;
use std::path::{Path, PathBuf};

use crate::shell::{CheckError, root};

/// A file beyond this holds more than one idea.
const MAX_LINES: usize = 600;

/// Folders of technique crates: each looks like its sisters.
const TECHNIQUES: [&str; 7] =
    ["shadow-map", "psm", "stencil-volumes", "penumbra-wedges", "pdsm", "ddoc", "contact-hardening"];

/// What every technique crate has.
const SISTER_FILES: [&str; 6] =
    ["Cargo.toml", "README.md", "src/lib.rs", "src/params.rs", "src/cpu.rs", "src/technique.rs"];

pub(crate) fn run() -> Result<(), CheckError> {
    let mut broken = Vec::new();
    let mut files = Vec::new();
    collect(root(), &mut files)?;
    for path in &files {
        let text =
            fs::read_to_string(path).map_err(|source| CheckError::Read { path: path.clone(), source })?;
        let name = path.strip_prefix(root()).unwrap_or(path).display().to_string();
        broken.extend(rules_of_file(&name, &text));
    }
    for technique in TECHNIQUES {
        let folder = root().join(technique);
        if folder.is_dir() {
            broken.extend(missing_sisters(technique, |file| {
                folder.join(file).exists() || folder.join(file.trim_end_matches(".rs")).is_dir()
            }));
        }
    }
    if files.is_empty() {
        broken.push("no source file was found: is this the workspace?".to_owned());
    }
    if broken.is_empty() {
        eprintln!("==> tidy: {} files", files.len());
        Ok(())
    } else {
        Err(CheckError::Rules(broken))
    }
}

/// Source files below `folder`, build output left out.
pub(crate) fn collect(folder: &Path, files: &mut Vec<PathBuf>) -> Result<(), CheckError> {
    let fail = |source| CheckError::Read { path: folder.to_owned(), source };
    for entry in fs::read_dir(folder).map_err(fail)? {
        let path = entry.map_err(fail)?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        if path.is_dir() {
            if name != "target" && name != "out" && !name.starts_with('.') {
                collect(&path, files)?;
            }
        } else if [".rs", ".wesl", ".wgsl"].iter().any(|ending| name.ends_with(ending)) {
            files.push(path);
        }
    }
    files.sort();
    Ok(())
}

/// Rules about one source file.
fn rules_of_file(name: &str, text: &str) -> Vec<String> {
    let mut broken = Vec::new();
    let lines = text.lines().count();
    if lines > MAX_LINES {
        broken.push(format!("{name}: {lines} lines, at most {MAX_LINES}: split it by idea"));
    }
    // Spelled in two parts so that this file does not accuse itself.
    let leftovers = [concat!("TO", "DO"), concat!("FIX", "ME"), concat!("XX", "X"), concat!("#[ig", "nore")];
    for (index, line) in text.lines().enumerate() {
        for leftover in leftovers {
            if line.contains(leftover) {
                broken.push(format!("{name}:{}: leftover '{leftover}'", index + 1));
            }
        }
    }
    let needs_docs = name.contains("/src/") && name.ends_with(".rs");
    // A crate whose page is its README says so in its first line.
    let documented = ["//!", "#![doc ="].iter().any(|opening| text.starts_with(opening));
    if needs_docs && !documented {
        broken.push(format!("{name}: opens without module docs (//!)"));
    }
    broken
}

/// Files of a technique crate that its sisters have and it lacks.
fn missing_sisters(technique: &str, exists: impl Fn(&str) -> bool) -> Vec<String> {
    SISTER_FILES
        .into_iter()
        .filter(|file| !exists(file))
        .map(|file| format!("{technique} has no {file}, as its sisters have"))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_clean_file_passes() {
        assert!(rules_of_file("a/src/b.rs", "//! What it is.\nfn f() {}\n").is_empty());
    }

    #[test]
    fn each_rule_rejects() {
        let long = format!("//! d\n{}", "\n".repeat(MAX_LINES));
        assert_eq!(rules_of_file("a/src/b.rs", &long).len(), 1);
        assert_eq!(rules_of_file("a/src/b.rs", "fn f() {}\n").len(), 1);
        let leftover = concat!(
            "//! d
// FIX",
            "ME: later
"
        );
        assert_eq!(rules_of_file("a/src/b.rs", leftover).len(), 1);
    }

    #[test]
    fn sisters_are_compared() {
        assert!(missing_sisters("psm", |_| true).is_empty());
        assert_eq!(missing_sisters("psm", |file| file != "src/cpu.rs").len(), 1);
    }
}
