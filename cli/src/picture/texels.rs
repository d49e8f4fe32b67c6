//! Where the texels of a shadow map go, in colour: how many pixels wide each is, from green over yellow to red.

use glam::Vec3;
use image::{Rgb as Pixel, RgbImage};
use scene_core::VisibilityImage;

use super::canvas::{Canvas, TextStyle};
use super::colour::{Rgb, linear_from_oklch, srgb_from_linear};
use super::error_map::NOTHING;

/// A surface where no texel is looked up: turned from the light.
const NOT_LOOKED_UP: Rgb = [104, 106, 110];
/// Text of the legend.
const INK: Rgb = [228, 230, 233];
/// Width in pixels that is drawn as the coarsest.
const COARSEST: f32 = 64.0;

/// The colour of a texel that is `d` pixels wide; all up to 1 look alike, and all from 64. Steps of a factor look equal.
fn colour(d: f32) -> Rgb {
    let t = (d.max(1.0).ln() / COARSEST.ln()).min(1.0);
    let linear = linear_from_oklch(0.88 - 0.42 * t, 0.13 + 0.05 * t, 150.0 - 128.0 * t);
    srgb_from_linear(linear.clamp(Vec3::ZERO, Vec3::ONE))
}

/// The picture of an image that holds 1/d, 0 where nothing is looked up and NaN where nothing is seen, with a legend below.
pub(crate) fn picture(shown: &VisibilityImage) -> RgbImage {
    const BAR: u32 = 14;
    let style = TextStyle::Body;
    let (width, height) = (shown.width, shown.height);
    let mut canvas = Canvas::new(width, height + BAR + style.line_height() + 4, NOTHING);
    let pixels = RgbImage::from_fn(width, height, |x, y| {
        let v = shown.at(x, y);
        Pixel(if v.is_nan() {
            NOTHING
        } else if v <= 0.0 {
            NOT_LOOKED_UP
        } else {
            colour(1.0 / v)
        })
    });
    canvas.blit(&pixels, 0, 0);
    for column in 0..width {
        let exponent = (column as f32 + 0.5) / width as f32;
        canvas.fill(column, height, 1, BAR, colour(COARSEST.powf(exponent)));
    }
    for (fraction, label) in [(0.0, "1"), (0.5, "8"), (1.0, "64 pixels a texel")] {
        let left = (width.saturating_sub(style.width(label)) as f32 * fraction) as u32;
        canvas.text(left, height + BAR + 2, label, style, INK);
    }
    canvas.into_image()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finer_is_greener_and_coarser_redder() {
        let [red, green, _] = colour(1.0);
        assert!(green > red);
        let [red, green, _] = colour(64.0);
        assert!(red > green);
        assert_eq!(colour(0.1), colour(1.0));
        assert_eq!(colour(f32::INFINITY), colour(64.0));
        for d in [1.0f32, 2.0, 8.0, 32.0] {
            assert_ne!(colour(d), colour(d * 2.0));
        }
    }

    #[test]
    fn pixels_are_above_the_legend() {
        let shown = VisibilityImage { width: 4, height: 1, values: vec![1.0, 0.125, 0.0, f32::NAN] };
        let image = picture(&shown);
        let at = |x| image.get_pixel(x, 0).0;
        assert_eq!([0, 1, 2, 3].map(at), [colour(1.0), colour(8.0), NOT_LOOKED_UP, NOTHING]);
        assert!(image.height() > 14);
        assert_eq!(image.get_pixel(0, 1).0, colour(64f32.powf(0.125)));
    }
}
