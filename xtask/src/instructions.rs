//! `cargo xtask instructions [--accept]`: how many instructions the techniques take.
//!
//! Milliseconds of a shared machine guard nothing; instructions of one thread do. `valgrind --tool=callgrind` counts those between the
//! ends of one run, prepare and shade, of each technique's default on a small picture; `xtask/instructions.json` keeps them. More than
//! [`GROWTH`] of them is a failure, and so are much fewer, until they are accepted: a gain is guarded, too. So is vector code that the
//! compiler has not inlined: it then calls a function for each operation, and is several times as slow, whatever it was before.

use std::collections::{BTreeMap, HashSet};
use std::fs;
use std::path::PathBuf;
use std::process::Command;

use crate::apt;
use crate::shell::{CheckError, cargo, output_of, root, target};

/// By how much counts may differ from what is kept: compilers of one version, and processors with other vectors, come closer.
const GROWTH: f64 = 1.05;

/// The function whose instructions count, with all that it calls.
const COUNTED: &str = "*Stand*on_cpu*";

/// In the names of the vector library's functions of one operation each.
const OPERATION: &str = "fearless_simd_kernel";

/// In the names of the functions that use the vector unit. Operations that these call are fast all the same.
const VECTORIZED: &str = "vectorize";

/// The part of all instructions that operations may take that others call: what is seldom run may do so.
const APART: f64 = 0.01;

/// Scenes that are counted on. One is enough to tell a slip, and takes under a minute in all.
const SCENES: [&str; 1] = ["ball"];

/// Builds the command as the tests do, then counts.
pub(crate) fn run(accept: bool) -> Result<(), CheckError> {
    // Incremental builds cut the program into other pieces and inline less: their counts are not those of a clean build.
    let clean = [("CARGO_INCREMENTAL", "0")];
    cargo(&["test", "--profile", "ci", "--workspace", "--test", "cli", "--no-run"], &clean)?;
    run_built(accept)
}

/// [`run`] with the command that the tests have built.
pub(crate) fn run_built(accept: bool) -> Result<(), CheckError> {
    install()?;
    let counted = count_all()?;
    let path = kept_path();
    if accept {
        let text =
            serde_json::to_string_pretty(&counted).map_err(|e| CheckError::Failed(e.to_string()))? + "\n";
        return fs::write(&path, text).map_err(|source| CheckError::Write { path, source });
    }
    let text = fs::read_to_string(&path).map_err(|source| CheckError::Read { path: path.clone(), source })?;
    let kept: BTreeMap<String, u64> = serde_json::from_str(&text)
        .map_err(|error| CheckError::Failed(format!("{}: {error}", path.display())))?;
    let faults = faults(&kept, &counted);
    if faults.is_empty() { Ok(()) } else { Err(CheckError::Rules(faults)) }
}

fn kept_path() -> PathBuf {
    root().join("xtask/instructions.json")
}

/// What differs, a line each.
fn faults(kept: &BTreeMap<String, u64>, counted: &BTreeMap<String, u64>) -> Vec<String> {
    let mut faults = Vec::new();
    for (kernel, &now) in counted {
        let Some(&before) = kept.get(kernel) else {
            faults.push(format!("{kernel}: no count is kept"));
            continue;
        };
        let ratio = now as f64 / before.max(1) as f64;
        if !(1.0 / GROWTH..=GROWTH).contains(&ratio) {
            faults.push(format!("{kernel}: {now} instructions, {before} are kept: {ratio:.2} times as many"));
        }
    }
    faults.extend(
        kept.keys()
            .filter(|kernel| !counted.contains_key(*kernel))
            .map(|k| format!("{k}: not counted any more")),
    );
    if !faults.is_empty() {
        faults.push("if that is as it should be: `cargo xtask instructions --accept`".to_owned());
    }
    faults
}

/// Every technique on every scene.
fn count_all() -> Result<BTreeMap<String, u64>, CheckError> {
    let program =
        target().join("ci").join(format!("gnomon{}", std::env::consts::EXE_SUFFIX)).display().to_string();
    let listed = output_of(&program, &["techniques", "--json"])?;
    let listed: serde_json::Value = serde_json::from_str(&listed)
        .map_err(|error| CheckError::Failed(format!("gnomon techniques --json: {error}")))?;
    let names = listed["techniques"]
        .as_array()
        .into_iter()
        .flatten()
        .filter_map(|technique| technique["name"].as_str());
    let mut counts = BTreeMap::new();
    for name in names {
        for scene in SCENES {
            let count = count(&program, name, scene)?;
            eprintln!("    {name} on {scene}: {count} instructions");
            counts.insert(format!("{name} on {scene}"), count);
        }
    }
    if counts.is_empty() {
        return Err(CheckError::Failed("gnomon techniques --json lists none".to_owned()));
    }
    Ok(counts)
}

fn count(program: &str, technique: &str, scene: &str) -> Result<u64, CheckError> {
    let out = target().join("instructions");
    let place = out.display().to_string();
    fs::create_dir_all(&out).map_err(|source| CheckError::Write { path: out.clone(), source })?;
    let file = out.join("callgrind.out");
    let file_option = format!("--callgrind-out-file={}", file.display());
    let collect = format!("--toggle-collect={COUNTED}");
    let render = ["render", scene, "--technique", technique, "--size", "64x48", "--backend", "cpu"];
    let one = ["--threads", "1", "--out", &place];
    let valgrind = ["--quiet", "--tool=callgrind", &file_option, &collect, program];
    output_of("valgrind", &[&valgrind[..], &render[..], &one[..]].concat())?;
    let profile =
        fs::read_to_string(&file).map_err(|source| CheckError::Read { path: file.clone(), source })?;
    let total = total(&profile)
        .filter(|&total| total > 0)
        .ok_or_else(|| CheckError::Failed(format!("{} counts nothing in {COUNTED}", file.display())))?;
    let apart = apart(&profile);
    if apart as f64 > APART * total as f64 {
        return Err(CheckError::Failed(format!(
            "{technique} on {scene}: {apart} of {total} instructions are vector operations that are not inlined: mark what \
             lies between `dispatch!` and them #[inline(always)], closures too"
        )));
    }
    Ok(total)
}

/// Instructions of vector operations that are called from where the vector unit is not used.
fn apart(profile: &str) -> u64 {
    let (mut operations, mut vectorized) = (HashSet::new(), HashSet::new());
    let (mut is_apart, mut calls_operation, mut is_of_call, mut sum) = (false, false, false, 0);
    for line in profile.lines() {
        // A name is written out where it comes first, and is a number from then on.
        let mut number_of = |text: &str| {
            let (number, name) = text.split_once(' ').map_or((text, ""), |(number, name)| (number, name));
            if name.contains(OPERATION) {
                operations.insert(number.to_owned());
            } else if name.contains(VECTORIZED) {
                vectorized.insert(number.to_owned());
            }
            number.to_owned()
        };
        if let Some(name) = line.strip_prefix("fn=") {
            let number = number_of(name);
            is_apart = !operations.contains(&number) && !vectorized.contains(&number);
        } else if let Some(name) = line.strip_prefix("cfn=") {
            let number = number_of(name);
            calls_operation = operations.contains(&number);
        } else if line.starts_with("calls=") {
            is_of_call = true;
        } else if line.starts_with(|c: char| c.is_ascii_digit() || "+-*".contains(c)) {
            if is_of_call && is_apart && calls_operation {
                sum +=
                    line.split_whitespace().nth(1).and_then(|count| count.parse::<u64>().ok()).unwrap_or(0);
            }
            is_of_call = false;
        }
    }
    sum
}

/// The total of a profile.
fn total(profile: &str) -> Option<u64> {
    profile.lines().find_map(|line| line.strip_prefix("totals:")?.trim().parse().ok())
}

/// Installs valgrind where it is not there and that is possible.
fn install() -> Result<(), CheckError> {
    let is_there = Command::new("valgrind").arg("--version").output().is_ok_and(|out| out.status.success());
    if is_there {
        return Ok(());
    }
    apt::install("valgrind", "instructions are counted by valgrind: install the package valgrind")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_or_much_fewer_instructions_are_a_fault() {
        let map = |a: u64| BTreeMap::from([("a".to_owned(), a)]);
        assert!(faults(&map(1000), &map(1020)).is_empty());
        for now in [1100, 900] {
            assert_eq!(faults(&map(1000), &map(now)).len(), 2, "{now}");
        }
        assert_eq!(faults(&BTreeMap::new(), &map(1)).len(), 2);
        assert_eq!(faults(&map(1), &BTreeMap::new()).len(), 2);
    }

    #[test]
    fn operations_apart_are_told_by_their_names() {
        let profile = "fn=(1) shade\n1 20\ncfn=(2) Avx2::add_f32x8::kernel::__fearless_simd_kernel\ncalls=1 3\n1 300\n\
                       fn=(2)\n+2 7\ncfn=(2)\ncalls=2 3\n* 40\n-1 2\nfn=(3) Avx2::vectorize::vectorize_avx2\n\
                       cfn=(2)\ncalls=9 9\n1 70\nfn=(1)\n1 5\ncfn=(3)\ncalls=1 1\n1 900\ntotals: 34\n";
        assert_eq!(apart(profile), 300);
        assert_eq!(apart("fn=(1) shade\n1 20\n"), 0);
    }

    #[test]
    fn a_profile_has_a_total() {
        assert_eq!(total("events: Ir\nfn=(1)\n1 2\ntotals: 8895770\n"), Some(8_895_770));
        assert_eq!(total("events: Ir\n"), None);
    }
}
