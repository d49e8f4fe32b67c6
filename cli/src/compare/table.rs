//! The table of a comparison: for a terminal, and as `table.csv`.

use serde::Serialize;

use super::statistics::{Errors, Shares};
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
    fn new(label: &'a str, report: &'a RunReport, errors: Option<Errors>, shares: Shares) -> Self {
        let number = |value: f64| (!value.is_nan()).then_some(value);
        let error = |pick: fn(&Errors) -> f64| errors.as_ref().map(pick).and_then(number);
        Self {
            technique: &report.technique,
            variant: &report.variant,
            label,
            backend: report.backend,
            prepare_ms: report.prepare_ms,
            shade_ms: report.shade_ms,
            mae: error(|e| e.mae),
            rmse: error(|e| e.rmse),
            p99: error(|e| e.p99),
            pen_rmse: error(|e| e.pen_rmse),
            bytes: report.bytes,
            lit: number(shares.lit),
            penumbra: number(shares.penumbra),
            umbra: number(shares.umbra),
        }
    }
}

/// `table.csv`: ground truth first, then the techniques.
pub(crate) fn csv(comparison: &Comparison) -> Result<Vec<u8>, CliError> {
    let encode = |source: Box<dyn std::error::Error + Send + Sync>| CliError::Encode { what: "table.csv", source };
    let mut writer = csv::Writer::from_writer(Vec::new());
    for row in rows(comparison) {
        let row = CsvRow::new(row.label, row.report, row.errors, row.shares);
        writer.serialize(row).map_err(|error| encode(error.into()))?;
    }
    writer.into_inner().map_err(|error| encode(error.to_string().into()))
}

/// What every table shows, one row a run.
pub(crate) struct Row<'a> {
    pub(crate) label: &'a str,
    pub(crate) report: &'a RunReport,
    pub(crate) errors: Option<Errors>,
    pub(crate) shares: Shares,
}

/// Ground truth first, then the techniques.
pub(crate) fn rows<'a>(comparison: &'a Comparison) -> impl Iterator<Item = Row<'a>> {
    let truth = &comparison.truth;
    let first = Row { label: "ground truth", report: &truth.report, errors: None, shares: truth.shares };
    std::iter::once(first).chain(comparison.entries.iter().map(|entry| Row {
        label: &entry.label,
        report: &entry.report,
        errors: Some(entry.errors),
        shares: entry.shares,
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

/// The cells of a row under [`COLUMNS`].
pub(crate) fn cells(row: &Row<'_>) -> [String; COLUMNS.len()] {
    let error = |pick: fn(&Errors) -> f64| row.errors.as_ref().map_or("-".to_owned(), |e| error_text(pick(e)));
    [
        row.label.to_owned(),
        milliseconds(row.report.prepare_ms),
        milliseconds(row.report.shade_ms),
        error(|e| e.mae),
        error(|e| e.rmse),
        error(|e| e.p99),
        error(|e| e.pen_rmse),
        format!("{:.1}", row.report.bytes as f64 / 1_048_576.0),
        percent(row.shares.lit),
        percent(row.shares.penumbra),
        percent(row.shares.umbra),
    ]
}

/// An error with the digits that ground truth supports; a dash for none.
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
fn aligned<const N: usize>(lines: &[[String; N]]) -> String {
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
