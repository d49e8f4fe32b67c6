//! The signed error of a visibility image in colour: blue too dark, white right, red too light.

use glam::Vec3;
use image::{Rgb as Pixel, RgbImage};
use scene_core::VisibilityImage;

use super::canvas::{Canvas, TextStyle};
use super::colour::{Rgb, linear_from_oklch, srgb_from_linear};

/// What a pixel shows where no surface is seen.
pub(crate) const NOTHING: Rgb = [38, 42, 48];
/// The two stripes of a pixel that sees a surface but is not valid for comparison.
const NOT_COMPARED: [Rgb; 2] = [[196, 197, 199], [172, 174, 177]];

/// The colour of an error from −1 (darkest blue) over 0 (white) to 1 (darkest red); beyond, and for NaN, it
/// is that of the ends and of 0.
pub(crate) fn diverging(error: f32) -> Rgb {
    let t = if error.is_nan() { 0.0 } else { error.clamp(-1.0, 1.0) };
    let hue_deg = if t < 0.0 { 255.0 } else { 28.0 };
    let t = t.abs();
    // Chroma rises fast and falls a little towards the dark end, where the gamut is narrow.
    let chroma = 0.17 * (t * (2.0 - t)).sqrt() * (1.0 - 0.25 * t * t);
    let linear = linear_from_oklch(0.985 - 0.60 * t, chroma, hue_deg);
    srgb_from_linear(linear.clamp(Vec3::ZERO, Vec3::ONE))
}

/// The map of signed errors, NaN at pixels that are not compared, saturated at ±`scale`. Those of them that see a
/// surface, by the reference, are striped grey.
pub(crate) fn error_map(signed: &[f32], reference: &VisibilityImage, scale: f32) -> RgbImage {
    RgbImage::from_fn(reference.width, reference.height, |x, y| {
        let pixel = y as usize * reference.width as usize + x as usize;
        Pixel(if !signed[pixel].is_nan() {
            diverging(signed[pixel] / scale)
        } else if reference.values[pixel].is_nan() {
            NOTHING
        } else {
            NOT_COMPARED[((x + y) / 3 % 2) as usize]
        })
    })
}

/// Size of [`draw_legend`] in pixels.
pub(crate) const LEGEND_WIDTH: u32 = 760;
pub(crate) const LEGEND_HEIGHT: u32 = 74;

/// Draws the colour scale with its figures, and the grey of pixels that are not compared.
pub(crate) fn draw_legend(canvas: &mut Canvas, x: u32, y: u32, scale: f32, text: Rgb) {
    const BAR: u32 = 360;
    let style = TextStyle::Body;
    canvas.text(x, y, "error: technique - reference", TextStyle::Strong, text);
    let top = y + style.line_height();
    for column in 0..BAR {
        let error = (column as f32 + 0.5) / BAR as f32 * 2.0 - 1.0;
        canvas.fill(x + column, top, 1, 18, diverging(error));
    }
    let labels = top + 22;
    for (fraction, label) in
        [(0.0, format!("-{scale} too dark")), (0.5, "0".to_owned()), (1.0, format!("too light +{scale}"))]
    {
        let left = x + ((BAR - style.width(&label)) as f32 * fraction) as u32;
        canvas.text(left, labels, &label, style, text);
    }
    let key = x + BAR + 32;
    for row in 0..18 {
        for column in 0..28 {
            canvas.fill(key + column, top + row, 1, 1, NOT_COMPARED[((column + row) / 3 % 2) as usize]);
        }
    }
    canvas.text(key + 36, top + 1, "seen, but not compared", style, text);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_scale_is_signed_and_darkens_evenly() {
        let [r, _, b] = diverging(-0.5);
        assert!(b > r);
        let [r, _, b] = diverging(0.5);
        assert!(r > b);
        let light = |e: f32| diverging(e).iter().map(|&c| u32::from(c)).sum::<u32>();
        for step in 0..10 {
            let (near, far) = (step as f32 / 10.0, (step + 1) as f32 / 10.0);
            assert!(light(near) > light(far) && light(-near) > light(-far), "{near}");
        }
        assert!(diverging(0.0).iter().all(|&c| c > 240));
        assert_eq!(diverging(7.0), diverging(1.0));
        assert_eq!(diverging(f32::NAN), diverging(0.0));
    }

    #[test]
    fn a_pixel_shows_its_kind() {
        let reference = VisibilityImage { width: 4, height: 1, values: vec![0.5, 0.5, 0.5, f32::NAN] };
        let map = error_map(&[0.0, 0.25, f32::NAN, f32::NAN], &reference, 0.25);
        let at = |x| map.get_pixel(x, 0).0;
        assert_eq!((at(0), at(1), at(3)), (diverging(0.0), diverging(1.0), NOTHING));
        assert!(NOT_COMPARED.contains(&at(2)));
    }
}
