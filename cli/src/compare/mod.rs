//! Every technique beside ground truth: the figures, and the ways they are shown.

pub(crate) mod html;
pub(crate) mod page;
pub(crate) mod sheet;
pub(crate) mod skipped;
pub(crate) mod strip;
pub(crate) mod table;

use image::RgbImage;
use scene_core::metrics::{self, Errors, MetricsError, Shares};
use serde::Serialize;

use crate::ground_truth::GroundTruth;
use crate::picture::error_map::error_map;
use crate::picture::shading::Shading;
use crate::report::RunReport;

/// All that a comparison found out.
pub(crate) struct Comparison {
    /// Ground truth.
    pub(crate) truth: Truth,
    /// One for each technique that ran.
    pub(crate) entries: Vec<Entry>,
    /// Techniques that do not take this input.
    pub(crate) refused: Vec<Refused>,
    /// The error at which error maps saturate.
    pub(crate) error_scale: f32,
}

/// Ground truth with its pictures.
pub(crate) struct Truth {
    pub(crate) report: RunReport,
    pub(crate) shares: Shares,
    /// Pixels that see a surface.
    pub(crate) seen: usize,
    /// Pixels that are compared.
    pub(crate) valid: usize,
    /// Root mean square of the standard error over valid pixels: errors below it are noise of the truth. NaN for
    /// no valid pixel.
    pub(crate) noise: f64,
    pub(crate) pictures: Pictures,
}

/// A technique's run held against ground truth.
pub(crate) struct Entry {
    /// A name that differs from every other entry's.
    pub(crate) label: String,
    pub(crate) report: RunReport,
    pub(crate) errors: Errors,
    /// None if a valid pixel was left without a value.
    pub(crate) shares: Option<Shares>,
    pub(crate) pictures: Pictures,
    pub(crate) error_map: RgbImage,
}

/// A technique that was not run.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Refused {
    pub(crate) technique: String,
    pub(crate) why: String,
}

/// The two pictures of a visibility image.
pub(crate) struct Pictures {
    pub(crate) shaded: RgbImage,
    pub(crate) visibility: image::GrayAlphaImage,
}

impl Pictures {
    /// Draws both.
    pub(crate) fn new(shading: &Shading, visibility: &scene_core::VisibilityImage) -> Self {
        Self { shaded: shading.picture(visibility), visibility: crate::picture::grey(visibility) }
    }
}

impl Truth {
    /// Ground truth as the first row of every table.
    pub(crate) fn new(
        truth: &GroundTruth,
        report: RunReport,
        shading: &Shading,
    ) -> Result<Self, MetricsError> {
        Ok(Self {
            report,
            shares: metrics::shares(&truth.visibility, &truth.valid)?,
            seen: truth.visibility.values.iter().filter(|v| !v.is_nan()).count(),
            valid: truth.valid.iter().filter(|&&valid| valid).count(),
            noise: truth.noise(),
            pictures: Pictures::new(shading, &truth.visibility),
        })
    }
}

impl Entry {
    /// A finished run beside ground truth.
    pub(crate) fn new(
        label: String,
        run: crate::measure::Run,
        truth: &GroundTruth,
        shading: &Shading,
        error_scale: f32,
    ) -> Result<Self, MetricsError> {
        let signed = metrics::signed_error(&run.visibility, &truth.visibility, &truth.valid)?;
        Ok(Self {
            label,
            errors: metrics::errors(&run.visibility, &truth.visibility, &truth.valid)?,
            shares: metrics::shares(&run.visibility, &truth.valid).ok(),
            pictures: Pictures::new(shading, &run.visibility),
            error_map: error_map(&signed, &truth.visibility, error_scale),
            report: run.report,
        })
    }
}

/// `report.json` of a comparison.
#[derive(Serialize)]
pub(crate) struct ComparisonReport<'a> {
    scene: &'a str,
    light: &'a crate::report::LightReport,
    width: u32,
    height: u32,
    triangles: usize,
    seen_pixels: usize,
    valid_pixels: usize,
    reference: ReferenceReport<'a>,
    techniques: Vec<EntryReport<'a>>,
    refused: &'a [Refused],
}

#[derive(Serialize)]
struct ReferenceReport<'a> {
    #[serde(flatten)]
    run: &'a RunReport,
    shares: Shares,
    /// Root mean square of the standard error over valid pixels.
    noise_rmse: f64,
}

#[derive(Serialize)]
struct EntryReport<'a> {
    label: &'a str,
    #[serde(flatten)]
    run: &'a RunReport,
    errors: Errors,
    shares: Option<Shares>,
}

impl Comparison {
    /// What goes into `report.json`.
    pub(crate) fn report(&self) -> ComparisonReport<'_> {
        let run = &self.truth.report;
        ComparisonReport {
            scene: &run.scene,
            light: &run.light,
            width: run.width,
            height: run.height,
            triangles: run.triangles,
            seen_pixels: self.truth.seen,
            valid_pixels: self.truth.valid,
            reference: ReferenceReport { run, shares: self.truth.shares, noise_rmse: self.truth.noise },
            techniques: self
                .entries
                .iter()
                .map(|entry| EntryReport {
                    label: &entry.label,
                    run: &entry.report,
                    errors: entry.errors,
                    shares: entry.shares,
                })
                .collect(),
            refused: &self.refused,
        }
    }

    /// The scene's facts in one line.
    pub(crate) fn facts(&self) -> String {
        let run = &self.truth.report;
        let soft = if run.light.extended { "" } else { ", without extent" };
        format!(
            "{} triangles, {}x{} pixels, {} light{soft}; of {} compared pixels {} lit, {} penumbra, {} umbra",
            thousands(run.triangles),
            run.width,
            run.height,
            run.light.kind,
            thousands(self.truth.valid),
            percent(self.truth.shares.lit),
            percent(self.truth.shares.penumbra),
            percent(self.truth.shares.umbra),
        )
    }
}

/// A share as a percentage.
pub(crate) fn percent(share: f64) -> String {
    format!("{:.1}%", share * 100.0)
}

/// 202520 → "202,520".
pub(crate) fn thousands(number: usize) -> String {
    let digits = number.to_string();
    let mut text = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_for_people() {
        assert_eq!(thousands(0), "0");
        assert_eq!(thousands(999), "999");
        assert_eq!(thousands(1000), "1,000");
        assert_eq!(thousands(1_234_567), "1,234,567");
        assert_eq!(percent(0.1234), "12.3%");
    }
}
