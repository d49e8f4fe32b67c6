//! Golden pictures: the visibility of every variant of every technique, on every backend it has, beside a small PNG.
//!
//! | module | what it holds |
//! | --- | --- |
//! | [`catalogue`] | what there is to compare: asked from the command, so that a new variant cannot be forgotten |
//! | [`picture`] | visibility in a PNG file |
//! | [`difference`] | the comparator and its tolerance |
//! | [`failure`] | what is left behind of a comparison that failed |
//! | [`controls`] | proofs that the comparator can fail |
//!
//! Pictures lie in `tests/golden/pictures/TECHNIQUE/VARIANT-SCENE.png`; each is for all backends, made on the CPU. No test
//! writes there: `cargo xtask snapshots --accept` does.

mod catalogue;
mod controls;
mod difference;
mod failure;
mod picture;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use libtest_mimic::{Arguments, Failed, Trial};

use crate::catalogue::{Case, SIZE, cases, gnomon, left_over};
use crate::failure::Failure;
use crate::picture::Picture;

/// No golden picture is larger: they are read in reviews and kept for ever.
const MAX_BYTES: u64 = 64 << 10;

fn main() -> ExitCode {
    let arguments = Arguments::from_args();
    let mut trials: Vec<Trial> = cases().into_iter().map(trial).collect();
    trials.push(Trial::test("pictures::each_belongs_to_a_variant", || {
        let left_over = left_over(&cases(), &folder());
        for path in &left_over {
            Failure::left_over(path).write();
        }
        if left_over.is_empty() { Ok(()) } else { Err(format!("no variant has these: {left_over:?}").into()) }
    }));
    trials.extend(controls::trials());
    libtest_mimic::run(&arguments, trials).exit_code()
}

/// Where the pictures lie.
fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden/pictures")
}

fn trial(case: Case) -> Trial {
    // Without a device there is nothing to compare; the tests of the passes fail where it should be there.
    let is_off =
        case.backend == "gpu" && std::env::var("GNOMON_GPU").is_ok_and(|v| v.eq_ignore_ascii_case("off"));
    Trial::test(case.name(), move || compare(&case)).with_ignored_flag(is_off)
}

fn compare(case: &Case) -> Result<(), Failed> {
    let actual = render(case)?;
    let path = case.picture(&folder());
    let fail = |expected: Option<Picture>, why: String| {
        let failure = Failure { case, golden: &path, expected, actual: &actual, why };
        Err(Failed::from(failure.write()))
    };
    if !path.exists() {
        return fail(None, "it has no golden picture".to_owned());
    }
    let expected = Picture::read(&path)?;
    let bytes = std::fs::metadata(&path)?.len();
    if bytes > MAX_BYTES {
        return fail(Some(expected), format!("the picture has {bytes} bytes, at most {MAX_BYTES}"));
    }
    match difference::check(&expected, &actual) {
        Ok(_) => Ok(()),
        Err(why) => fail(Some(expected), why),
    }
}

/// The visibility that the command writes.
fn render(case: &Case) -> Result<Picture, Failed> {
    let folder = tempfile::tempdir()?;
    let variant = format!("variant={}", case.variant);
    let out = folder.path().to_string_lossy();
    let size = format!("{}x{}", SIZE.0, SIZE.1);
    let mut arguments = vec!["render", case.scene, "--technique", &case.technique, "--size", &size];
    arguments.extend(["--backend", case.backend, "--json", "--out", &out]);
    if case.has_setting {
        arguments.extend(["--set", &variant]);
    }
    let report = gnomon(&arguments)?;
    // What was asked for is what was run: a picture of something else would prove nothing.
    let ran = (report["variant"].as_str(), report["backend"].as_str(), report["technique"].as_str());
    let asked = (Some(&*case.variant), Some(case.backend), Some(&*case.technique));
    if ran != asked {
        return Err(format!("asked for {asked:?}, the report says {ran:?}").into());
    }
    let light = (report["light"]["kind"].as_str(), report["light"]["extended"].as_bool());
    if light != (Some(case.light.kind()), Some(case.light.is_extended())) {
        return Err(format!("{} has another light than the table says: {light:?}", case.scene).into());
    }
    Picture::read_npy(&folder.path().join("visibility.npy"))
}
