//! The table of a comparison: for a terminal, and as `table.csv`.

use scene_core::metrics::{Errors, Shares};
use serde::Serialize;

use super::{Comparison, percent};
use crate::error::CliError;
use crate::report::RunReport;

/// A row of `table.csv`. Empty cells have no value: ground truth has no error, a scene without penumbrae no `pen_rmse`.
#[derive(Serialize)]
struct CsvRow<'a> {
    technique: &'a str,
    variant: &'a str,
    label: &'a str,
    backend: &'a str,
    prepare_ms: f64,
    shade_ms: f64,
    mae: Option<f64>,
    rmse: Option<f64>,
    p99: Option<f64>,
    pen_rmse: Option<f64>,
    bytes: u64,
    lit: Option<f64>,
    penumbra: Option<f64>,
    umbra: Option<f64>,
}

impl<'a> CsvRow<'a> {
    fn new(row: &Row<'a>) -> Self {
        Self {
            technique: &row.report.technique,
            variant: &row.report.variant,
            label: row.label,
            backend: row.report.backend,
            prepare_ms: row.report.prepare_ms,
            shade_ms: row.report.shade_ms,
            mae: row.error(|e| e.mae),
            rmse: row.error(|e| e.rmse),
            p99: row.error(|e| e.p99),
            pen_rmse: row.pen_rmse(),
            bytes: row.report.bytes,
            lit: row.share(|s| s.lit),
            penumbra: row.share(|s| s.penumbra),
            umbra: row.share(|s| s.umbra),
        }
    }
}

/// `table.csv`: ground truth first, then the techniques.
pub(crate) fn csv(comparison: &Comparison) -> Result<Vec<u8>, CliError> {
    let encode =
        |source: Box<dyn std::error::Error + Send + Sync>| CliError::Encode { what: "table.csv", source };
    let mut writer = csv::Writer::from_writer(Vec::new());
    for row in rows(comparison) {
        writer.serialize(CsvRow::new(&row)).map_err(|error| encode(error.into()))?;
    }
    writer.into_inner().map_err(|error| encode(error.to_string().into()))
}

/// What every table shows, one row a run.
pub(crate) struct Row<'a> {
    pub(crate) label: &'a str,
    pub(crate) report: &'a RunReport,
    /// None for ground truth.
    pub(crate) errors: Option<Errors>,
    /// None if there is nothing to share.
    shares: Option<Shares>,
}

impl Row<'_> {
    /// An error; none for ground truth, or if no pixel was compared.
    pub(crate) fn error(&self, pick: fn(&Errors) -> f64) -> Option<f64> {
        self.errors.as_ref().filter(|errors| errors.valid > 0).map(pick)
    }

    /// The error in penumbrae; none if there are none.
    pub(crate) fn pen_rmse(&self) -> Option<f64> {
        self.errors.as_ref().filter(|errors| errors.penumbra > 0).map(|errors| errors.pen_rmse)
    }

    /// A share of compared pixels.
    pub(crate) fn share(&self, pick: fn(&Shares) -> f64) -> Option<f64> {
        self.shares.as_ref().map(pick)
    }
}

/// Ground truth first, then the techniques.
pub(crate) fn rows(comparison: &Comparison) -> impl Iterator<Item = Row<'_>> {
    let truth = &comparison.truth;
    let shares = move |shares| (truth.valid > 0).then_some(shares).flatten();
    let first = Row {
        label: "ground truth",
        report: &truth.report,
        errors: None,
        shares: shares(Some(truth.shares)),
    };
    std::iter::once(first).chain(comparison.entries.iter().map(move |entry| Row {
        label: &entry.label,
        report: &entry.report,
        errors: Some(entry.errors),
        shares: shares(entry.shares),
    }))
}

/// Headings of the tables for people, with what each means.
pub(crate) const COLUMNS: [(&str, &str); 11] = [
    ("technique", "technique and variant"),
    ("prepare ms", "milliseconds for what depends on scene and light"),
    ("shade ms", "milliseconds to fill the image"),
    ("mae", "mean of |error|"),
    ("rmse", "root mean square error"),
    ("p99", "99th percentile of |error|"),
    ("pen_rmse", "root mean square error in and around penumbrae"),
    ("MiB", "memory held for this light, in units of 1,048,576 bytes"),
    ("lit", "share of compared pixels that see the whole light"),
    ("penumbra", "share of compared pixels that see a part of it"),
    ("umbra", "share of compared pixels that see nothing of it"),
];

/// The cells of a row under [`COLUMNS`]; a dash where there is no value.
pub(crate) fn cells(row: &Row<'_>) -> [String; COLUMNS.len()] {
    let dash = |text: Option<String>| text.unwrap_or_else(|| "-".to_owned());
    let error = |error: Option<f64>| dash(error.map(error_text));
    let share = |share: Option<f64>| dash(share.map(percent));
    [
        row.label.to_owned(),
        milliseconds(row.report.prepare_ms),
        milliseconds(row.report.shade_ms),
        error(row.error(|e| e.mae)),
        error(row.error(|e| e.rmse)),
        error(row.error(|e| e.p99)),
        error(row.pen_rmse()),
        format!("{:.1}", row.report.bytes as f64 / 1_048_576.0),
        share(row.share(|s| s.lit)),
        share(row.share(|s| s.penumbra)),
        share(row.share(|s| s.umbra)),
    ]
}

/// What the cells after the first are sorted by.
pub(crate) fn sort_keys(row: &Row<'_>) -> [Option<f64>; COLUMNS.len() - 1] {
    [
        Some(row.report.prepare_ms),
        Some(row.report.shade_ms),
        row.error(|e| e.mae),
        row.error(|e| e.rmse),
        row.error(|e| e.p99),
        row.pen_rmse(),
        Some(row.report.bytes as f64),
        row.share(|s| s.lit),
        row.share(|s| s.penumbra),
        row.share(|s| s.umbra),
    ]
}

/// An error with the digits that ground truth supports; a dash for NaN.
pub(crate) fn error_text(error: f64) -> String {
    if error.is_nan() { "-".to_owned() } else { format!("{error:.4}") }
}

/// Milliseconds with three significant digits or so.
pub(crate) fn milliseconds(ms: f64) -> String {
    match ms {
        ms if ms < 10.0 => format!("{ms:.2}"),
        ms if ms < 100.0 => format!("{ms:.1}"),
        ms => format!("{ms:.0}"),
    }
}

/// The table for a terminal.
pub(crate) fn text(comparison: &Comparison) -> String {
    let mut lines = vec![COLUMNS.map(|(heading, _)| heading.to_owned())];
    lines.extend(rows(comparison).map(|row| cells(&row)));
    aligned(&lines)
}

/// Rows in aligned columns, the first to the left, figures to the right.
pub(crate) fn aligned<const N: usize>(lines: &[[String; N]]) -> String {
    let width = |column: usize| lines.iter().map(|line| line[column].chars().count()).max().unwrap_or(0);
    let widths: [usize; N] = std::array::from_fn(width);
    let mut text = String::new();
    for line in lines {
        for (column, (cell, width)) in line.iter().zip(widths).enumerate() {
            if column == 0 {
                text.push_str(&format!("{cell:<width$}"));
            } else {
                text.push_str(&format!("  {cell:>width$}"));
            }
        }
        text.push('\n');
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_aligned() {
        let line = |a: &str, b: &str| [a.to_owned(), b.to_owned()];
        let text = aligned(&[line("technique", "ms"), line("a", "12.5"), line("bb", "3")]);
        assert_eq!(text, "technique    ms\na          12.5\nbb            3\n");
    }

    #[test]
    fn figures_keep_their_digits() {
        assert_eq!([0.123, 12.34, 1234.5].map(milliseconds), ["0.12", "12.3", "1234"]);
        assert_eq!((error_text(0.01234), error_text(f64::NAN)), ("0.0123".to_owned(), "-".to_owned()));
    }
}
