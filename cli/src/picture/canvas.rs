//! A picture to lay images and text out on.

use image::{Rgb as Pixel, RgbImage};
use noto_sans_mono_bitmap::{FontWeight, RasterHeight, get_raster, get_raster_width};

use super::colour::Rgb;

/// How text looks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum TextStyle {
    /// Figures and captions.
    Body,
    /// Names.
    Strong,
    /// The heading of a sheet.
    Title,
}

impl TextStyle {
    fn font(self) -> (FontWeight, RasterHeight) {
        match self {
            Self::Body => (FontWeight::Regular, RasterHeight::Size16),
            Self::Strong => (FontWeight::Bold, RasterHeight::Size16),
            Self::Title => (FontWeight::Bold, RasterHeight::Size24),
        }
    }

    /// Pixels from one line to the next.
    pub(crate) fn line_height(self) -> u32 {
        self.font().1.val() as u32 + 6
    }

    /// Pixels that `text` takes in a row.
    pub(crate) fn width(self, text: &str) -> u32 {
        let (weight, height) = self.font();
        (get_raster_width(weight, height) * text.chars().count()) as u32
    }

    /// As much of `text` as fits into `pixels`, with two dots at its end if something was cut.
    pub(crate) fn fit(self, text: &str, pixels: u32) -> String {
        let fits = (pixels / self.width("m").max(1)) as usize;
        if text.chars().count() <= fits {
            return text.to_owned();
        }
        text.chars().take(fits.saturating_sub(2)).chain("..".chars()).collect()
    }
}

/// An RGB picture. Whatever would fall outside is cut off.
#[derive(Clone, Debug)]
pub(crate) struct Canvas {
    image: RgbImage,
}

impl Canvas {
    /// A canvas of one colour.
    pub(crate) fn new(width: u32, height: u32, background: Rgb) -> Self {
        Self { image: RgbImage::from_pixel(width, height, Pixel(background)) }
    }

    /// Fills a rectangle with its top left corner at (x, y).
    pub(crate) fn fill(&mut self, x: u32, y: u32, width: u32, height: u32, colour: Rgb) {
        let (right, bottom) = (x.saturating_add(width), y.saturating_add(height));
        for row in y..bottom.min(self.image.height()) {
            for column in x..right.min(self.image.width()) {
                self.image.put_pixel(column, row, Pixel(colour));
            }
        }
    }

    /// Copies an image with its top left corner to (x, y).
    pub(crate) fn blit(&mut self, image: &RgbImage, x: u32, y: u32) {
        image::imageops::replace(&mut self.image, image, i64::from(x), i64::from(y));
    }

    /// Writes one line of text with its top left corner at (x, y). Characters that the font lacks are
    /// written as '?'.
    pub(crate) fn text(&mut self, x: u32, y: u32, text: &str, style: TextStyle, colour: Rgb) {
        let (weight, height) = style.font();
        let advance = get_raster_width(weight, height) as u32;
        for (i, character) in text.chars().enumerate() {
            let Some(glyph) =
                get_raster(character, weight, height).or_else(|| get_raster('?', weight, height))
            else {
                continue;
            };
            let left = x + i as u32 * advance;
            for (dy, row) in glyph.rows().enumerate() {
                for (dx, &coverage) in row.iter().enumerate() {
                    self.blend(left + dx as u32, y + dy as u32, colour, coverage);
                }
            }
        }
    }

    fn blend(&mut self, x: u32, y: u32, colour: Rgb, coverage: u8) {
        if coverage == 0 || x >= self.image.width() || y >= self.image.height() {
            return;
        }
        let pixel = self.image.get_pixel_mut(x, y);
        for (channel, new) in pixel.0.iter_mut().zip(colour) {
            let (old, new, alpha) = (u32::from(*channel), u32::from(new), u32::from(coverage));
            *channel = ((old * (255 - alpha) + new * alpha + 127) / 255) as u8;
        }
    }

    /// The picture.
    pub(crate) fn into_image(self) -> RgbImage {
        self.image
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_is_drawn_inside_its_measure_and_cut_at_the_border() {
        let mut canvas = Canvas::new(200, 40, [255; 3]);
        canvas.text(10, 5, "rmse ± 0.1", TextStyle::Body, [0; 3]);
        let right = 10 + TextStyle::Body.width("rmse ± 0.1");
        let image = canvas.clone().into_image();
        let dark = |x: u32| (0..40).any(|y| image.get_pixel(x, y).0[0] < 128);
        assert!((10..right).any(dark));
        assert!(!(0..10).any(dark) && !(right..200).any(dark));
        canvas.text(190, 35, "outside", TextStyle::Title, [0; 3]);
        canvas.fill(190, 30, u32::MAX, 20, [1, 2, 3]);
        assert_eq!(canvas.into_image().get_pixel(199, 39).0, [1, 2, 3]);
    }

    #[test]
    fn long_text_is_shortened_visibly() {
        let style = TextStyle::Body;
        assert_eq!(style.fit("short", 1000), "short");
        let cut = style.fit("a very long heading", style.width("0123456789"));
        assert_eq!(cut, "a very l..");
    }
}
