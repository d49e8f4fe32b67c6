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

/// What every technique crate has. A file may be a folder of the same name.
const SISTER_FILES: [&str; 11] = [
    "Cargo.toml",
    "README.md",
    "figure.png",
    "src/lib.rs",
    "src/params.rs",
    "src/cpu.rs",
    "src/technique.rs",
    "tests/closed_form.rs",
    "tests/degenerate.rs",
    "tests/skip.rs",
    "benches/stages.rs",
];

/// What a technique crate with a GPU path has besides.
const GPU_FILES: [&str; 3] = ["build.rs", "shaders", "tests/parity.rs"];

/// Pictures beside the sources are read in reviews and kept for ever.
const MAX_PICTURE_BYTES: u64 = 64 << 10;

/// Technique crates that are there, in the order of the tables.
pub(crate) fn technique_folders(root: &Path) -> Vec<&'static str> {
    TECHNIQUES.into_iter().filter(|folder| root.join(folder).is_dir()).collect()
}

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
    for technique in technique_folders(root()) {
        let folder = root().join(technique);
        broken.extend(missing_sisters(technique, |file| {
            folder.join(file).exists() || folder.join(file.trim_end_matches(".rs")).is_dir()
        }));
        let text = |file: &str| fs::read_to_string(root().join(file)).unwrap_or_default();
        broken.extend(rules_of_technique(
            technique,
            &text(&format!("{technique}/README.md")),
            &text("cli/src/techniques.rs"),
        ));
    }
    broken.extend(same_examples(&files));
    let mut pictures = Vec::new();
    collect_with(root(), &[".png", ".jpg", ".svg", ".webp"], &mut pictures)?;
    for path in &pictures {
        let bytes =
            fs::metadata(path).map_err(|source| CheckError::Read { path: path.clone(), source })?.len();
        broken
            .extend(rule_of_picture(&path.strip_prefix(root()).unwrap_or(path).display().to_string(), bytes));
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
    collect_with(folder, &[".rs", ".wesl", ".wgsl"], files)
}

/// Files below `folder` with one of these endings, build output left out.
fn collect_with(folder: &Path, endings: &[&str], files: &mut Vec<PathBuf>) -> Result<(), CheckError> {
    let fail = |source| CheckError::Read { path: folder.to_owned(), source };
    for entry in fs::read_dir(folder).map_err(fail)? {
        let path = entry.map_err(fail)?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        if path.is_dir() {
            if name != "target" && name != "out" && !name.starts_with('.') {
                collect_with(&path, endings, files)?;
            }
        } else if endings.iter().any(|ending| name.ends_with(ending)) {
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
    let mut wanted = SISTER_FILES.to_vec();
    if exists("src/gpu.rs") {
        wanted.extend(GPU_FILES);
    }
    wanted
        .into_iter()
        .filter(|file| !exists(file))
        .map(|file| format!("{technique} has no {file}, as its sisters have"))
        .collect()
}

/// A technique crate's page opens with its figure, and the command knows the crate.
fn rules_of_technique(technique: &str, readme: &str, registry: &str) -> Vec<String> {
    let mut broken = Vec::new();
    let first = readme.lines().find(|line| !line.is_empty() && !line.starts_with('#')).unwrap_or_default();
    if !(first.starts_with("![") && first.ends_with("](figure.png)")) {
        broken.push(format!("{technique}/README.md does not open with its figure, ![…](figure.png)"));
    }
    let factory = format!("gnomon_{}::", technique.replace('-', "_"));
    if !registry.contains(&factory) {
        broken.push(format!("{technique} is not in the command's list, cli/src/techniques.rs"));
    }
    broken
}

fn rule_of_picture(name: &str, bytes: u64) -> Option<String> {
    (bytes > MAX_PICTURE_BYTES).then(|| format!("{name}: {bytes} bytes, at most {MAX_PICTURE_BYTES}"))
}

/// Examples of one name: all crates build into one folder, and the last one built would be the one that runs.
fn same_examples(files: &[PathBuf]) -> Vec<String> {
    let mut examples: Vec<&PathBuf> = files
        .iter()
        .filter(|path| path.parent().is_some_and(|folder| folder.ends_with("examples")))
        .collect();
    examples.sort_by_key(|path| path.file_name());
    let twice = examples.windows(2).filter(|pair| pair[0].file_name() == pair[1].file_name());
    twice
        .map(|pair| format!("{} and {}: two examples of one name", pair[0].display(), pair[1].display()))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn examples_of_one_name_are_refused() {
        let files = |names: &[&str]| names.iter().map(PathBuf::from).collect::<Vec<_>>();
        assert!(
            same_examples(&files(&["a/examples/x.rs", "b/examples/y.rs", "b/src/x.rs", "a/tests/x.rs"]))
                .is_empty()
        );
        assert_eq!(same_examples(&files(&["a/examples/x.rs", "c/src/z.rs", "b/examples/x.rs"])).len(), 1);
    }

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
        // Without a GPU path nothing of it is asked for; with one, all of it.
        let on_cpu = |file: &str| !GPU_FILES.contains(&file);
        assert!(missing_sisters("psm", |file| on_cpu(file) && file != "src/gpu.rs").is_empty());
        assert_eq!(missing_sisters("psm", on_cpu).len(), GPU_FILES.len());
    }

    #[test]
    fn pages_open_with_their_figure_and_crates_are_registered() {
        let (page, list) = ("# a\n\n![What it shows](figure.png)\n", "&gnomon_pen_w::Factory");
        assert!(rules_of_technique("pen-w", page, list).is_empty());
        assert_eq!(rules_of_technique("pen-w", "# a\n\nText.\n\n![x](figure.png)\n", list).len(), 1);
        assert_eq!(rules_of_technique("pen-w", page, "&gnomon_pen::Factory").len(), 1);
    }

    #[test]
    fn pictures_are_small() {
        assert_eq!(rule_of_picture("a.png", MAX_PICTURE_BYTES), None);
        assert!(rule_of_picture("a.png", MAX_PICTURE_BYTES + 1).is_some());
    }
}
