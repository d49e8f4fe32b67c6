//! `contact-sheet.png`: ground truth, then each technique with its error map, its figures below.
//!
//! Ground truth and each technique are a block of three images; many blocks stand in several columns.

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
/// Images of a block: shaded, visibility, error.
const IMAGES: u32 = 3;
/// A cell's narrowest and widest in pixels, whatever the image's.
const NARROWEST: u32 = 256;
const WIDEST: u32 = 512;
/// The widest where there are several columns.
const WIDEST_OF_MANY: u32 = 320;

/// Draws the sheet.
pub(crate) fn sheet(comparison: &Comparison) -> RgbImage {
    let count = 1 + comparison.entries.len() as u32;
    let layout = Layout::new(comparison.truth.pictures.shaded.dimensions(), count);
    let head = MARGIN + TextStyle::Title.line_height() + 2 * TextStyle::Body.line_height() + 6;
    let rows = count.div_ceil(layout.across);
    let foot = LEGEND_HEIGHT + comparison.refused.len() as u32 * TextStyle::Body.line_height();
    let inner = layout.across * (layout.inner + MARGIN) - MARGIN;
    let height = head + rows * layout.height + foot + MARGIN;
    let mut canvas = Canvas::new(inner + 2 * MARGIN, height, PAPER);
    draw_head(&mut canvas, comparison, inner);
    let place = |block: u32| {
        let (column, row) = (block % layout.across, block / layout.across);
        (MARGIN + column * (layout.inner + MARGIN), head + row * layout.height)
    };
    layout.truth(&mut canvas, comparison, place(0));
    for (block, entry) in (1..).zip(&comparison.entries) {
        layout.entry(&mut canvas, entry, place(block));
    }
    let mut y = head + rows * layout.height;
    draw_legend(&mut canvas, MARGIN, y, comparison.error_scale, INK);
    y += LEGEND_HEIGHT;
    for refused in &comparison.refused {
        let line = format!("not run: {}: {}", refused.technique, refused.why);
        canvas.text(MARGIN, y, &TextStyle::Body.fit(&line, inner), TextStyle::Body, FAINT);
        y += TextStyle::Body.line_height();
    }
    canvas.into_image()
}

/// The size at which an image is shown: its own between [`NARROWEST`] and `widest`, else scaled to the nearer bound.
fn cell_size((width, height): (u32, u32), widest: u32) -> (u32, u32) {
    let cell = width.clamp(NARROWEST, widest);
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

/// Measures of a block, and how many stand in a row.
struct Layout {
    cell_width: u32,
    cell_height: u32,
    caption: u32,
    /// A block's width.
    inner: u32,
    /// From one row of blocks to the next.
    height: u32,
    across: u32,
}

impl Layout {
    fn new(image: (u32, u32), blocks: u32) -> Self {
        let caption = TextStyle::Strong.line_height() + 6;
        let with = |(cell_width, cell_height): (u32, u32)| {
            let inner = (IMAGES * cell_width + (IMAGES - 1) * GAP).max(LEGEND_WIDTH);
            let height = caption + cell_height + 3 * TextStyle::Body.line_height() + GAP;
            Self { cell_width, cell_height, caption, inner, height, across: across(blocks, inner, height) }
        };
        let layout = with(cell_size(image, WIDEST));
        if layout.across == 1 { layout } else { with(cell_size(image, WIDEST_OF_MANY)) }
    }

    fn truth(&self, canvas: &mut Canvas, comparison: &Comparison, (x, y): (u32, u32)) {
        let truth = &comparison.truth;
        self.caption(canvas, x, y, &format!("ground truth, {}", truth.report.variant));
        let (top, step) = (y + self.caption, self.cell_width + GAP);
        self.image(canvas, x, top, &truth.pictures.shaded);
        self.image(canvas, x + step, top, &opaque(&truth.pictures.visibility));
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
                canvas.text(x + 2 * step + GAP, y, &line, TextStyle::Body, INK);
            }
        }
        let total = truth.report.prepare_ms + truth.report.shade_ms;
        self.figures(canvas, x, top, &format!("{} ms", milliseconds(total)), &truth.report);
    }

    fn entry(&self, canvas: &mut Canvas, entry: &Entry, (x, y): (u32, u32)) {
        self.caption(canvas, x, y, &entry.label);
        let (top, step) = (y + self.caption, self.cell_width + GAP);
        self.image(canvas, x, top, &entry.pictures.shaded);
        self.image(canvas, x + step, top, &opaque(&entry.pictures.visibility));
        self.image(canvas, x + 2 * step, top, &entry.error_map);
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
        self.figures(canvas, x, top, &figures, report);
    }

    fn caption(&self, canvas: &mut Canvas, x: u32, y: u32, text: &str) {
        let style = TextStyle::Strong;
        canvas.text(x, y, &style.fit(text, self.inner), style, INK);
    }

    /// Two lines: the figures, and what was left out.
    fn figures(&self, canvas: &mut Canvas, x: u32, top: u32, text: &str, report: &RunReport) {
        let style = TextStyle::Body;
        let mut y = top + self.cell_height + 6;
        canvas.text(x, y, &style.fit(text, self.inner), style, FAINT);
        if let Some(skipped) = in_words(report) {
            y += style.line_height();
            canvas.text(x, y, &style.fit(&format!("left out: {skipped}"), self.inner), style, FAINT);
        }
    }

    /// Scales up by repeating pixels, so that they can be told apart, and down by averaging.
    fn image(&self, canvas: &mut Canvas, x: u32, top: u32, image: &RgbImage) {
        let filter = if image.width() < self.cell_width { FilterType::Nearest } else { FilterType::Triangle };
        if image.dimensions() == (self.cell_width, self.cell_height) {
            canvas.blit(image, x, top);
        } else {
            canvas.blit(&imageops::resize(image, self.cell_width, self.cell_height, filter), x, top);
        }
    }
}

/// Blocks a row, so that the sheet is as nearly square as it can be.
fn across(blocks: u32, width: u32, height: u32) -> u32 {
    let off_square = |across: u32| {
        let (width, height) = (across * width, blocks.div_ceil(across) * height);
        (f64::from(width) / f64::from(height)).ln().abs()
    };
    (1..=blocks.max(1)).min_by(|&a, &b| off_square(a).total_cmp(&off_square(b))).unwrap_or(1)
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
        let cell_size = |width, height| cell_size((width, height), WIDEST);
        assert_eq!(cell_size(512, 512), (512, 512));
        assert_eq!(cell_size(300, 200), (300, 200));
        assert_eq!(cell_size(16, 8), (256, 128));
        assert_eq!(cell_size(1920, 1080), (512, 288));
        assert_eq!(cell_size(16_384, 1), (512, 1));
        assert_eq!(cell_size(1, 16_384), (1, 512));
    }

    #[test]
    fn many_blocks_stand_in_columns() {
        for (blocks, columns) in [(1, 1), (2, 1), (3, 1), (21, 3)] {
            assert_eq!(Layout::new((256, 256), blocks).across, columns, "{blocks}");
        }
        let many = Layout::new((1024, 1024), 21);
        assert!(many.across > 1 && many.cell_width == WIDEST_OF_MANY);
        assert_eq!(Layout::new((1024, 1024), 2).cell_width, WIDEST);
    }
}
