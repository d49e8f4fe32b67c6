//! Colours: sRGB coding, and OKLCH, in which equal steps look equal.

use glam::Vec3;

/// An 8-bit sRGB colour.
pub(crate) type Rgb = [u8; 3];

/// Codes linear light as 8-bit sRGB (IEC 61966-2-1); values outside [0, 1] are clamped, NaN becomes black.
pub(crate) fn srgb_from_linear(linear: Vec3) -> Rgb {
    let encode = |c: f32| {
        let c = c.clamp(0.0, 1.0);
        let coded = if c <= 0.003_130_8 { 12.92 * c } else { 1.055 * c.powf(1.0 / 2.4) - 0.055 };
        (coded * 255.0 + 0.5) as u8
    };
    linear.to_array().map(encode)
}

/// Linear sRGB of an OKLCH colour: `lightness` in [0, 1], `chroma` up to about 0.3, hue in degrees. Colours
/// outside the gamut have components below 0 or above 1.
///
/// The matrices are those of Björn Ottosson, "A perceptual color space for image processing" (2020).
pub(crate) fn linear_from_oklch(lightness: f32, chroma: f32, hue_deg: f32) -> Vec3 {
    let (sin, cos) = hue_deg.to_radians().sin_cos();
    let (a, b) = (chroma * cos, chroma * sin);
    let cone = Vec3::new(
        lightness + 0.396_337_78 * a + 0.215_803_76 * b,
        lightness - 0.105_561_346 * a - 0.063_854_17 * b,
        lightness - 0.089_484_18 * a - 1.291_485_5 * b,
    );
    let lms = cone * cone * cone;
    Vec3::new(
        Vec3::new(4.076_741_7, -3.307_711_6, 0.230_969_94).dot(lms),
        Vec3::new(-1.268_438, 2.609_757_4, -0.341_319_4).dot(lms),
        Vec3::new(-0.004_196_086_3, -0.703_418_6, 1.707_614_7).dot(lms),
    )
}

/// The muted albedo of an object, stable by its id: the first two, often a mesh and its ground, are nearly grey,
/// one warm, one cool; then hue goes in golden-angle steps and lightness in steps of the golden ratio, so that
/// neighbours in the list never look alike.
pub(crate) fn object_albedo(id: u32) -> Vec3 {
    const GOLDEN_ANGLE_DEG: f32 = 137.508;
    const GOLDEN_RATIO: f32 = 0.618_034;
    match id {
        0 => linear_from_oklch(0.80, 0.02, 75.0),
        1 => linear_from_oklch(0.74, 0.012, 250.0),
        _ => {
            // The palette repeats long after anyone could tell.
            let step = (id % 4096) as f32;
            let lightness = 0.64 + 0.20 * (step * GOLDEN_RATIO).fract();
            linear_from_oklch(lightness, 0.045, (80.0 + step * GOLDEN_ANGLE_DEG) % 360.0)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coding_meets_its_fixed_points() {
        assert_eq!(srgb_from_linear(Vec3::ZERO), [0; 3]);
        assert_eq!(srgb_from_linear(Vec3::ONE), [255; 3]);
        // Linear 18 % grey, the photographer's middle, is coded as 118.
        assert_eq!(srgb_from_linear(Vec3::splat(0.18)), [118; 3]);
        assert_eq!(srgb_from_linear(Vec3::new(-1.0, 2.0, f32::NAN)), [0, 255, 0]);
    }

    #[test]
    fn oklch_white_is_white_and_albedos_stay_in_gamut() {
        assert!((linear_from_oklch(1.0, 0.0, 0.0) - Vec3::ONE).abs().max_element() < 1e-3);
        for id in 0..1000 {
            let albedo = object_albedo(id);
            assert!(albedo.min_element() > 0.0 && albedo.max_element() < 0.9, "{id}: {albedo}");
        }
        assert_ne!(srgb_from_linear(object_albedo(1)), srgb_from_linear(object_albedo(2)));
    }
}
