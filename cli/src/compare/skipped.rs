//! What each run left out because it could not matter, in words.

use super::table::rows;
use super::{Comparison, thousands};
use crate::report::RunReport;

/// What was left out, as "1,234 wholly lit pixels, 5 casters"; "nothing" where it was tried and found nothing, none
/// where nothing was tried.
pub(crate) fn in_words(run: &RunReport) -> Option<String> {
    let skipped = &run.skipped;
    let some = skipped.iter().filter(|(_, count)| **count > 0);
    let words: Vec<_> = some.map(|(what, &count)| format!("{} {what}", thousands(count as usize))).collect();
    match (skipped.is_empty(), words.is_empty()) {
        (true, _) => None,
        (false, true) => Some("nothing".to_owned()),
        (false, false) => Some(words.join(", ")),
    }
}

/// A line for each run that tried to leave something out: its label, and what it left out.
pub(crate) fn lines(comparison: &Comparison) -> Vec<(&str, String)> {
    rows(comparison).filter_map(|row| in_words(row.report).map(|words| (row.label, words))).collect()
}

/// [`lines`] for a terminal, under the table.
pub(crate) fn footer(comparison: &Comparison) -> String {
    let line = |(label, words): (&str, String)| format!("  {label}: {words}\n");
    let lines: String = lines(comparison).into_iter().map(line).collect();
    if lines.is_empty() { lines } else { format!("\nleft out because it cannot change the image:\n{lines}") }
}
