//! The workspace's test binaries, two at once. Cargo runs one after the other, and most of the long ones keep one core busy: a software
//! GPU compiles its shaders on one thread, and tests take turns on a device.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

use serde_json::Value;

use crate::shell::{CheckError, cargo_output, root};

/// How many run at once: each uses a thread a core besides, where it can.
const AT_ONCE: usize = 2;

/// Builds every test of the workspace in profile `ci` and runs them all, with this environment. What a binary prints follows its name
/// once it has ended.
pub(crate) fn run(environment: &[(&str, &str)]) -> Result<(), CheckError> {
    let build = ["test", "--workspace", "--profile", "ci", "--tests", "--no-run"];
    eprintln!("\n==> cargo {}", build.join(" "));
    let start = Instant::now();
    let messages = cargo_output(&[&build[..], &["--message-format", "json-render-diagnostics"]].concat())?;
    eprintln!("    {:.1} s\n\n==> test binaries, {AT_ONCE} at once", start.elapsed().as_secs_f64());
    let start = Instant::now();
    let outcome = run_all(&test_binaries(&messages), environment);
    eprintln!("    {:.1} s", start.elapsed().as_secs_f64());
    outcome
}

/// A test binary that cargo has built.
#[derive(Debug, PartialEq, Eq, PartialOrd, Ord)]
struct TestBinary {
    /// The file of its source, below the workspace.
    name: String,
    program: PathBuf,
    /// Its package's: what tests read lies there.
    folder: PathBuf,
}

/// Those that cargo's messages name, by name: the command's, which take longest, come early, and no two runs differ.
fn test_binaries(messages: &str) -> Vec<TestBinary> {
    let binary = |line: &str| {
        let message: Value = serde_json::from_str(line).ok()?;
        let is_test = message["profile"]["test"].as_bool()?;
        let (program, manifest) = (message["executable"].as_str()?, message["manifest_path"].as_str()?);
        let source = Path::new(message["target"]["src_path"].as_str()?);
        let name = source.strip_prefix(root()).unwrap_or(source).display().to_string();
        let folder = Path::new(manifest).parent()?.to_owned();
        is_test.then(|| TestBinary { name, program: program.into(), folder })
    };
    let mut binaries: Vec<_> = messages.lines().filter_map(binary).collect();
    binaries.sort();
    binaries
}

fn run_all(binaries: &[TestBinary], environment: &[(&str, &str)]) -> Result<(), CheckError> {
    if binaries.is_empty() {
        return Err(CheckError::Failed("cargo built no test".to_owned()));
    }
    let (waiting, faults) = (Mutex::new(binaries.iter()), Mutex::new(Vec::new()));
    let next = || waiting.lock().unwrap_or_else(PoisonError::into_inner).next();
    std::thread::scope(|scope| {
        for _ in 0..AT_ONCE {
            scope.spawn(|| {
                while let Some(binary) = next() {
                    if let Err(error) = run_one(binary, environment) {
                        faults.lock().unwrap_or_else(PoisonError::into_inner).push(error.to_string());
                    }
                }
            });
        }
    });
    let faults = faults.into_inner().unwrap_or_else(PoisonError::into_inner);
    if faults.is_empty() { Ok(()) } else { Err(CheckError::Failed(faults.join("\n"))) }
}

fn run_one(binary: &TestBinary, environment: &[(&str, &str)]) -> Result<(), CheckError> {
    let start = Instant::now();
    let Output { status, stdout, stderr } = Command::new(&binary.program)
        .envs(environment.iter().copied())
        .env("CARGO_MANIFEST_DIR", &binary.folder)
        .current_dir(&binary.folder)
        .output()
        .map_err(|source| CheckError::Start { program: binary.program.display().to_string(), source })?;
    let mut text = format!("\n--> {}, {:.1} s\n", binary.name, start.elapsed().as_secs_f64()).into_bytes();
    text.extend(stdout);
    text.extend(stderr);
    // In one piece, so that another's is not in between. Nobody may be listening any more.
    let _ = std::io::stderr().lock().write_all(&text);
    if status.success() { Ok(()) } else { Err(CheckError::Failed(format!("{}: {status}", binary.name))) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn test_binaries_are_those_that_cargo_names() {
        let place = |below: &str| root().join(below).display().to_string();
        let artifact = |source: &str, is_test: bool, program: Option<&str>| {
            let (source, manifest) = (place(source), place("psm/Cargo.toml"));
            serde_json::json!({
                "reason": "compiler-artifact",
                "manifest_path": manifest,
                "target": { "src_path": source },
                "profile": { "test": is_test },
                "executable": program,
            })
            .to_string()
        };
        let messages = [
            artifact("psm/src/lib.rs", false, None),
            artifact("psm/tests/skip.rs", true, Some("/t/skip-1")),
            r#"{"reason":"build-finished","success":true}"#.to_owned(),
            "no message".to_owned(),
            artifact("cli/src/main.rs", false, Some("/t/gnomon")),
            artifact("psm/tests/orbit.rs", true, Some("/t/orbit-1")),
        ];
        let binary = |name: &str, program: &str| TestBinary {
            name: name.to_owned(),
            program: program.into(),
            folder: root().join("psm"),
        };
        let expected = [binary("psm/tests/orbit.rs", "/t/orbit-1"), binary("psm/tests/skip.rs", "/t/skip-1")];
        assert_eq!(test_binaries(&messages.join("\n")), expected);
    }

    #[cfg(unix)]
    #[test]
    fn all_run_and_those_that_fail_are_named() {
        let binary = |program: &str| TestBinary {
            name: program.to_owned(),
            program: program.into(),
            folder: root().to_owned(),
        };
        assert!(run_all(&[binary("true"), binary("true"), binary("true")], &[]).is_ok());
        let failed = run_all(&[binary("true"), binary("false"), binary("no-such-program")], &[]);
        let text = failed.unwrap_err().to_string();
        assert!(text.contains("false: ") && text.contains("no-such-program"), "{text}");
        assert!(run_all(&[], &[]).is_err());
    }
}
