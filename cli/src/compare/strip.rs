//! `strip.png`: the shaded images side by side, ground truth first, for a page that shows what a technique looks like.
//!
//! It holds no times: the same scene and settings make the same picture on any machine, up to the rounding of floats.

use image::RgbImage;

use super::table::error_text;
use super::{Comparison, Entry};
use crate::picture::canvas::{Canvas, TextStyle};
use crate::picture::colour::Rgb;

const PAPER: Rgb = [250, 250, 248];
const INK: Rgb = [28, 30, 34];
const FAINT: Rgb = [104, 108, 114];
const MARGIN: u32 = 10;
const GAP: u32 = 10;
/// As wide as a page of text shows a picture without scaling it; a single image may be wider.
const WIDEST: u32 = 900;

/// Draws the strip, in as many rows as it needs.
pub(crate) fn strip(comparison: &Comparison) -> RgbImage {
    let truth = &comparison.truth.pictures.shaded;
    let (width, height) = truth.dimensions();
    let mut cells = vec![("ground truth".to_owned(), comparison.truth.report.variant.clone(), truth)];
    let labels: Vec<&str> = comparison.entries.iter().map(|entry| entry.label.as_str()).collect();
    for (entry, name) in comparison.entries.iter().zip(names(&labels)) {
        cells.push((name, figure(entry), &entry.pictures.shaded));
    }
    let count = cells.len() as u32;
    let across = across(count, width);
    let caption = TextStyle::Strong.line_height();
    let (step_x, step_y) = (width + GAP, caption + height + TextStyle::Body.line_height() + GAP);
    let mut canvas = Canvas::new(
        2 * MARGIN + across * step_x - GAP,
        2 * MARGIN + count.div_ceil(across) * step_y - GAP,
        PAPER,
    );
    for (i, (name, figure, image)) in (0..).zip(cells) {
        let (x, y) = (MARGIN + i % across * step_x, MARGIN + i / across * step_y);
        canvas.text(x, y, &TextStyle::Strong.fit(&name, width), TextStyle::Strong, INK);
        canvas.blit(image, x, y + caption);
        let below = y + caption + height + 4;
        canvas.text(x, below, &TextStyle::Body.fit(&figure, width), TextStyle::Body, FAINT);
    }
    canvas.into_image()
}

/// Names above the images: of several variants of one technique, what differs.
fn names(labels: &[&str]) -> Vec<String> {
    let first =
        labels.first().and_then(|label| label.split_once(' ')).map(|(technique, _)| format!("{technique} "));
    let shared =
        first.filter(|first| labels.len() > 1 && labels.iter().all(|label| label.starts_with(first)));
    labels.iter().map(|label| label[shared.as_ref().map_or(0, String::len)..].to_owned()).collect()
}

/// The error below an image: the one in penumbrae where there are some.
fn figure(entry: &Entry) -> String {
    let errors = &entry.errors;
    if errors.penumbra > 0 {
        format!("pen_rmse {}", error_text(errors.pen_rmse))
    } else {
        format!("rmse {}", error_text(errors.rmse))
    }
}

/// Images a row: as many as fit, spread evenly over the rows.
fn across(count: u32, width: u32) -> u32 {
    let fit = ((WIDEST - 2 * MARGIN + GAP) / (width + GAP)).max(1);
    let rows = count.div_ceil(fit).max(1);
    count.div_ceil(rows).max(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shared_name_is_left_out() {
        assert_eq!(names(&["a x", "a y"]), ["x", "y"]);
        assert_eq!(names(&["a x", "ab y"]), ["a x", "ab y"]);
        assert_eq!(names(&["a x"]), ["a x"]);
        assert!(names(&[]).is_empty());
    }

    #[test]
    fn images_are_spread_evenly_over_rows() {
        assert_eq!(across(2, 200), 2);
        assert_eq!(across(4, 200), 4);
        assert_eq!(across(5, 200), 3);
        assert_eq!(across(9, 200), 3);
        assert_eq!(across(7, 16_384), 1);
    }
}
