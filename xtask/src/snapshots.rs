//! `cargo xtask snapshots [--accept]`: golden pictures and text snapshots.
//!
//! Tests never write a snapshot. They leave what they found in `target/snapshots`; this command makes a page of it,
//! expected | actual | difference, and with `--accept` puts it into the tree, file by file, each named on the way. A
//! snapshot that is missing, and one that no test asks for any more, is a failure too.

mod findings;
mod page;

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use self::findings::{Finding, findings};
use crate::shell::{CheckError, cargo, root, target};
use crate::vulkan;

pub(crate) fn run(accept: bool) -> Result<(), CheckError> {
    let tests = tests(root())?;
    let outcome = run_tests(&tests, accept)?;
    if outcome.found.is_empty() {
        return outcome.tests;
    }
    if !accept {
        return Err(outcome.refusal());
    }
    for finding in &outcome.found {
        eprintln!("    {}", finding.accept()?);
    }
    // What was accepted has to pass, and so has all that no acceptance can mend.
    let again = run_tests(&tests, accept)?;
    if again.found.is_empty() { again.tests } else { Err(again.refusal()) }
}

/// Names of the test targets that use `insta`, or compare golden pictures.
fn tests(root: &Path) -> Result<BTreeSet<String>, CheckError> {
    let mut files = Vec::new();
    crate::tidy::collect(root, &mut files)?;
    let mut tests = BTreeSet::new();
    for file in files {
        let name = file.strip_prefix(root).unwrap_or(&file);
        let parts: Vec<_> = name.iter().map(|part| part.to_string_lossy()).collect();
        let [member, folder, target, ..] = &parts[..] else { continue };
        let text =
            fs::read_to_string(&file).map_err(|source| CheckError::Read { path: file.clone(), source })?;
        let asks = ["insta::assert", "tests/golden/pictures"].iter().any(|word| text.contains(word));
        if folder == "tests" && member != "xtask" && asks {
            tests.insert(target.trim_end_matches(".rs").to_owned());
        }
    }
    Ok(tests)
}

/// What running the tests came to.
struct Outcome {
    found: Vec<Finding>,
    tests: Result<(), CheckError>,
    page: PathBuf,
}

impl Outcome {
    fn refusal(&self) -> CheckError {
        CheckError::Failed(format!(
            "{} snapshots differ: see {}, then accept them by `cargo xtask snapshots --accept` or mend the code",
            self.found.len(),
            self.page.display()
        ))
    }
}

fn run_tests(tests: &BTreeSet<String>, accept: bool) -> Result<Outcome, CheckError> {
    let report = Report::new()?;
    // The whole workspace, as CI builds it: alone the packages would get dependencies with other features, anew.
    let mut arguments = vec!["test", "--profile", "ci", "--no-fail-fast", "--workspace"];
    arguments.extend(tests.iter().flat_map(|target| ["--test", target]));
    let gpu = vulkan::environment()?;
    let environment = report.environment().into_iter().chain(gpu.iter().map(|(n, v)| (*n, v.clone())));
    let environment: Vec<_> = environment.collect();
    let environment: Vec<_> = environment.iter().map(|(name, value)| (*name, value.as_str())).collect();
    let result = cargo(&arguments, &environment);
    let found = report.write(true)?;
    if !accept && found.is_empty() {
        eprintln!("==> snapshots: all as expected");
    }
    Ok(Outcome { found, tests: result, page: report.page() })
}

/// The folder that tests leave their findings in.
pub(crate) struct Report {
    folder: PathBuf,
}

impl Report {
    /// An empty one.
    pub(crate) fn new() -> Result<Self, CheckError> {
        let folder = target().join("snapshots");
        let fail = |source| CheckError::Write { path: folder.clone(), source };
        if folder.exists() {
            fs::remove_dir_all(&folder).map_err(fail)?;
        }
        for below in ["pictures", "text"] {
            fs::create_dir_all(folder.join(below)).map_err(fail)?;
        }
        Ok(Self { folder })
    }

    /// Variables that make tests leave their findings here and write nothing elsewhere.
    pub(crate) fn environment(&self) -> Vec<(&'static str, String)> {
        let path = |below: &str| self.folder.join(below).display().to_string();
        vec![
            ("INSTA_UPDATE", "new".to_owned()),
            ("INSTA_FORCE_PASS", "0".to_owned()),
            ("INSTA_PENDING_DIR", path("text")),
            ("INSTA_SNAPSHOT_REFERENCES_FILE", path("asked-for.txt")),
            ("GNOMON_GOLDEN_REPORT", path("pictures")),
        ]
    }

    fn page(&self) -> PathBuf {
        self.folder.join("index.html")
    }

    /// Makes the page of what the tests left; what they left. If all tests have run, snapshots that none asked for are
    /// found too.
    pub(crate) fn write(&self, all_have_run: bool) -> Result<Vec<Finding>, CheckError> {
        let found = findings(&self.folder, root(), all_have_run)?;
        let page = self.page();
        if !found.is_empty() {
            fs::write(&page, page::page(&found))
                .map_err(|source| CheckError::Write { path: page, source })?;
            for finding in &found {
                eprintln!("    {}: {}", finding.name(), finding.why());
            }
            eprintln!("==> snapshots: see {}", self.page().display());
        }
        Ok(found)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tests_that_ask_for_snapshots_are_found() {
        let tree = tempfile::tempdir().unwrap();
        for (name, text) in [
            ("cli/tests/cli/help.rs", "insta::assert_snapshot!(x);"),
            ("cli/tests/golden/main.rs", "\"tests/golden/pictures\""),
            ("psm/tests/errors.rs", "insta::assert_snapshot!(x);"),
            ("psm/tests/degenerate.rs", "assert!(true);"),
            ("psm/src/lib.rs", "insta::assert_snapshot!(x);"),
        ] {
            fs::create_dir_all(tree.path().join(name).parent().unwrap()).unwrap();
            fs::write(tree.path().join(name), text).unwrap();
        }
        let found = tests(tree.path()).unwrap();
        assert_eq!(found, BTreeSet::from(["cli".into(), "errors".into(), "golden".into()]));
    }
}
