//! `contact-sheet.png`: ground truth, then each technique with its error map, its figures below.

use image::imageops::{self, FilterType};
use image::{DynamicImage, Rgb as Pixel, RgbImage};

use super::skipped::in_words;
use super::table::{error_text, milliseconds};
use super::{Comparison, Entry, percent, thousands};
use crate::picture::canvas::{Canvas, TextStyle};
use crate::picture::colour::Rgb;
use crate::picture::error_map::{LEGEND_HEIGHT, LEGEND_WIDTH, NOTHING, draw_legend};
use crate::report::RunReport;

const PAPER: Rgb = [250, 250, 248];
const INK: Rgb = [28, 30, 34];
const FAINT: Rgb = [104, 108, 114];
const RULE: Rgb = [222, 222, 218];
const MARGIN: u32 = 24;
const GAP: u32 = 12;
/// Columns: shaded, visibility, error.
const COLUMNS: u32 = 3;
/// A cell's width in pixels, whatever the image's.
const CELL_WIDTHS: std::ops::RangeInclusive<u32> = 256..=512;

/// Draws the sheet.
pub(crate) fn sheet(comparison: &Comparison) -> RgbImage {
    let shaded = &comparison.truth.pictures.shaded;
    let (cell_width, cell_height) = cell_size(shaded.width(), shaded.height());
    let caption = TextStyle::Strong.line_height() + 6;
    let row_height = caption + cell_height + 3 * TextStyle::Body.line_height() + GAP;
    let head = MARGIN + TextStyle::Title.line_height() + 2 * TextStyle::Body.line_height() + 6;
    let rows = 1 + comparison.entries.len() as u32;
    let foot = LEGEND_HEIGHT + comparison.refused.len() as u32 * TextStyle::Body.line_height();
    let inner = (COLUMNS * cell_width + (COLUMNS - 1) * GAP).max(LEGEND_WIDTH);
    let mut canvas = Canvas::new(inner + 2 * MARGIN, head + rows * row_height + foot + MARGIN, PAPER);
    let layout = Layout { cell_width, cell_height, caption, inner };
    draw_head(&mut canvas, comparison, inner);
    layout.truth(&mut canvas, comparison, head);
    for (i, entry) in comparison.entries.iter().enumerate() {
        layout.entry(&mut canvas, entry, head + (i as u32 + 1) * row_height);
    }
    let mut y = head + rows * row_height;
    draw_legend(&mut canvas, MARGIN, y, comparison.error_scale, INK);
    y += LEGEND_HEIGHT;
    for refused in &comparison.refused {
        let line = format!("not run: {}: {}", refused.technique, refused.why);
        canvas.text(MARGIN, y, &TextStyle::Body.fit(&line, inner), TextStyle::Body, FAINT);
        y += TextStyle::Body.line_height();
    }
    canvas.into_image()
}

/// The size at which an image is shown: its own within [`CELL_WIDTHS`], else scaled to the nearer bound.
fn cell_size(width: u32, height: u32) -> (u32, u32) {
    let cell = width.clamp(*CELL_WIDTHS.start(), *CELL_WIDTHS.end());
    let scaled = (f64::from(height) * f64::from(cell) / f64::from(width)).round().max(1.0) as u32;
    // A very tall image is bounded by its height instead.
    let tallest = 2 * cell;
    if scaled <= tallest {
        return (cell, scaled);
    }
    ((f64::from(width) * f64::from(tallest) / f64::from(height)).round().max(1.0) as u32, tallest)
}

fn draw_head(canvas: &mut Canvas, comparison: &Comparison, width: u32) {
    let run = &comparison.truth.report;
    let mut y = MARGIN;
    let style = TextStyle::Title;
    canvas.text(MARGIN, y, &style.fit(&run.scene, width), style, INK);
    y += style.line_height();
    let style = TextStyle::Body;
    let soft = if run.light.extended { "" } else { " (no extent)" };
    let scene = format!(
        "{} triangles   {}x{} pixels   light {}: {}{soft}",
        thousands(run.triangles),
        run.width,
        run.height,
        run.light.index,
        run.light.kind
    );
    canvas.text(MARGIN, y, &style.fit(&scene, width), style, FAINT);
    y += style.line_height();
    canvas.fill(MARGIN, y + 4, width, 1, RULE);
}

struct Layout {
    cell_width: u32,
    cell_height: u32,
    caption: u32,
    inner: u32,
}

impl Layout {
    fn x(&self, column: u32) -> u32 {
        MARGIN + column * (self.cell_width + GAP)
    }

    fn truth(&self, canvas: &mut Canvas, comparison: &Comparison, y: u32) {
        let truth = &comparison.truth;
        self.caption(canvas, y, &format!("ground truth, {}", truth.report.variant));
        let top = y + self.caption;
        self.image(canvas, 0, top, &truth.pictures.shaded);
        self.image(canvas, 1, top, &opaque(&truth.pictures.visibility));
        let lines = [
            format!("{} of {} pixels", thousands(truth.valid), thousands(truth.seen)),
            "that see a surface are compared:".to_owned(),
            format!("  {:>6} lit", percent(truth.shares.lit)),
            format!("  {:>6} penumbra", percent(truth.shares.penumbra)),
            format!("  {:>6} umbra", percent(truth.shares.umbra)),
            String::new(),
            format!("noise of ground truth {}", error_text(truth.noise)),
        ];
        for (i, line) in lines.iter().enumerate() {
            let y = top + i as u32 * TextStyle::Body.line_height();
            if y + TextStyle::Body.line_height() <= top + self.cell_height {
                let line = TextStyle::Body.fit(line, self.cell_width);
                canvas.text(self.x(2) + GAP, y, &line, TextStyle::Body, INK);
            }
        }
        let total = truth.report.prepare_ms + truth.report.shade_ms;
        self.figures(canvas, top, &format!("{} ms", milliseconds(total)), &truth.report);
    }

    fn entry(&self, canvas: &mut Canvas, entry: &Entry, y: u32) {
        self.caption(canvas, y, &entry.label);
        let top = y + self.caption;
        self.image(canvas, 0, top, &entry.pictures.shaded);
        self.image(canvas, 1, top, &opaque(&entry.pictures.visibility));
        self.image(canvas, 2, top, &entry.error_map);
        let (report, errors) = (&entry.report, &entry.errors);
        let mut figures = format!(
            "{} ms = prepare {} + shade {}",
            milliseconds(report.prepare_ms + report.shade_ms),
            milliseconds(report.prepare_ms),
            milliseconds(report.shade_ms),
        );
        if errors.valid > 0 {
            figures += &format!("   rmse {}   p99 {}", error_text(errors.rmse), error_text(errors.p99));
        }
        if errors.penumbra > 0 {
            figures += &format!("   pen_rmse {}", error_text(errors.pen_rmse));
        }
        if errors.missing > 0 {
            figures += &format!("   {} pixels without a value", thousands(errors.missing));
        }
        self.figures(canvas, top, &figures, report);
    }

    fn caption(&self, canvas: &mut Canvas, y: u32, text: &str) {
        let style = TextStyle::Strong;
        canvas.text(MARGIN, y, &style.fit(text, self.inner), style, INK);
    }

    /// Two lines: the figures, and what was left out.
    fn figures(&self, canvas: &mut Canvas, top: u32, text: &str, report: &RunReport) {
        let style = TextStyle::Body;
        let mut y = top + self.cell_height + 6;
        canvas.text(MARGIN, y, &style.fit(text, self.inner), style, FAINT);
        if let Some(skipped) = in_words(report) {
            y += style.line_height();
            canvas.text(MARGIN, y, &style.fit(&format!("left out: {skipped}"), self.inner), style, FAINT);
        }
    }

    /// Scales up by repeating pixels, so that they can be told apart, and down by averaging.
    fn image(&self, canvas: &mut Canvas, column: u32, top: u32, image: &RgbImage) {
        let filter = if image.width() < self.cell_width { FilterType::Nearest } else { FilterType::Triangle };
        let x = self.x(column);
        if image.dimensions() == (self.cell_width, self.cell_height) {
            canvas.blit(image, x, top);
        } else {
            canvas.blit(&imageops::resize(image, self.cell_width, self.cell_height, filter), x, top);
        }
    }
}

/// A grey image over the colour of pixels that see nothing.
fn opaque(grey: &image::GrayAlphaImage) -> RgbImage {
    let mut rgb = DynamicImage::from(grey.clone()).into_rgb8();
    for (pixel, grey) in rgb.pixels_mut().zip(grey.pixels()) {
        if grey.0[1] == 0 {
            *pixel = Pixel(NOTHING);
        }
    }
    rgb
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_keep_their_shape_within_bounds() {
        assert_eq!(cell_size(512, 512), (512, 512));
        assert_eq!(cell_size(300, 200), (300, 200));
        assert_eq!(cell_size(16, 8), (256, 128));
        assert_eq!(cell_size(1920, 1080), (512, 288));
        assert_eq!(cell_size(16_384, 1), (512, 1));
        assert_eq!(cell_size(1, 16_384), (1, 512));
    }
}
