//! What a failed comparison leaves behind: expected, actual and difference as pictures, and what was found as JSON.
//!
//! The folder is `GNOMON_GOLDEN_REPORT`, or one below the build's. `cargo xtask snapshots` makes a page of it, and
//! with `--accept` takes `actual.png` for the golden picture.

use std::path::{Path, PathBuf};
use std::{env, fs};

use image::{Rgb, RgbImage};
use serde_json::json;

use crate::catalogue::Case;
use crate::difference::{MAX_MAE, WRONG_SHARE, figures};
use crate::picture::Picture;

/// A comparison that failed.
pub(crate) struct Failure<'a> {
    pub(crate) case: &'a Case,
    pub(crate) golden: &'a Path,
    /// None if there is no golden picture.
    pub(crate) expected: Option<Picture>,
    pub(crate) actual: &'a Picture,
    pub(crate) why: String,
}

impl Failure<'_> {
    /// Writes the folder; the sentence to fail with.
    pub(crate) fn write(&self) -> String {
        let folder = report_folder().join(self.case.name().replace("::", "-"));
        let mut report = json!({
            "name": self.case.name(),
            "backend": self.case.backend,
            "golden": self.golden,
            "scene": self.case.scene,
            "why": self.why,
        });
        let mut files = vec![("actual.png", self.actual.png())];
        if let Some(expected) = &self.expected {
            files.push(("expected.png", expected.png()));
            if (expected.width, expected.height) == (self.actual.width, self.actual.height) {
                let figures = figures(expected, self.actual);
                report["figures"] = json!({
                    "pixels": figures.pixels,
                    "wrong": figures.wrong,
                    "wrong_share_allowed": WRONG_SHARE,
                    "mae": figures.mae,
                    "mae_allowed": MAX_MAE,
                    "max": figures.max,
                });
                files.push(("difference.png", difference(expected, self.actual)));
            }
        }
        files.push(("failure.json", report.to_string().into_bytes()));
        let place = write(&folder, &files);
        format!("{}: {}; {place}; `cargo xtask snapshots` shows it", self.case.name(), self.why)
    }
}

/// A golden picture that belongs to no variant.
pub(crate) struct LeftOver<'a>(&'a Path);

impl Failure<'_> {
    /// `path` belongs to no variant.
    pub(crate) fn left_over(path: &Path) -> LeftOver<'_> {
        LeftOver(path)
    }
}

impl LeftOver<'_> {
    /// Writes the folder.
    pub(crate) fn write(&self) {
        let stem = |path: Option<&Path>| {
            path.and_then(Path::file_stem).unwrap_or_default().to_string_lossy().into_owned()
        };
        let name = format!("left-over-{}-{}", stem(self.0.parent()), stem(Some(self.0)));
        let report = json!({ "name": name, "backend": "none", "golden": self.0, "why": "no variant has it" });
        write(&report_folder().join(&name), &[("failure.json", report.to_string().into_bytes())]);
    }
}

fn report_folder() -> PathBuf {
    env::var_os("GNOMON_GOLDEN_REPORT")
        .map_or_else(|| Path::new(env!("CARGO_TARGET_TMPDIR")).join("golden"), PathBuf::from)
}

/// Writes files to a new folder in place of an old one; where they are, or why they are not.
fn write(folder: &Path, files: &[(&str, Vec<u8>)]) -> String {
    let all = || {
        // An old one may hold pictures that this failure does not have.
        if folder.exists() {
            fs::remove_dir_all(folder)?;
        }
        fs::create_dir_all(folder)?;
        files.iter().try_for_each(|(name, bytes)| fs::write(folder.join(name), bytes))
    };
    match all() {
        Ok(()) => format!("see {}", folder.display()),
        Err(error) => format!("its pictures could not be written to {}: {error}", folder.display()),
    }
}

/// Blue where the image is darker than the golden picture, red where it is lighter, yellow where one of them sees
/// nothing. A difference shows from its smallest: the colour is that of its square root.
fn difference(expected: &Picture, actual: &Picture) -> Vec<u8> {
    let image = RgbImage::from_fn(expected.width, expected.height, |x, y| {
        let pixel = (y * expected.width + x) as usize;
        let (e, a) = (expected.values[pixel], actual.values[pixel]);
        if e.is_nan() != a.is_nan() {
            return Rgb([255, 200, 0]);
        }
        let off = if e.is_nan() { 0.0 } else { a - e };
        let rest = 255 - (off.abs().min(1.0).sqrt() * 255.0) as u8;
        Rgb(if off < 0.0 { [rest, rest, 255] } else { [255, rest, rest] })
    });
    let mut bytes = std::io::Cursor::new(Vec::new());
    image.write_to(&mut bytes, image::ImageFormat::Png).expect("memory takes a small picture");
    bytes.into_inner()
}
