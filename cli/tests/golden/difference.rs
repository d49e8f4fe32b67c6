//! The comparator: how far two images of visibility may lie apart.

use crate::picture::Picture;

/// A pixel is wrong beyond this difference: one step of an 8-bit image, the finest that a screen shows, plus what a
/// golden picture's 16 bits round off.
pub(crate) const STEP: f32 = 1.0 / 255.0 + 0.5 / 65535.0;

/// Share of the pixels that may be wrong. A pixel on an edge of the scene or of a shadow map's texel is a tie that rounding
/// decides, and processors with and without fused multiplication, and GPUs, round differently: the project allows
/// backends one pixel in a thousand.
pub(crate) const WRONG_SHARE: f64 = 1e-3;

/// Largest mean of |difference|: every wrong pixel wrong by 1, and on the others the rounding of an average of up to
/// 1,024 taps, at most 1,024 × 2⁻²⁴ = 2⁻¹⁴. It notices what shifts all pixels a little, which no single pixel shows.
pub(crate) const MAX_MAE: f64 = WRONG_SHARE + 1.0 / 16384.0;

/// What was found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Figures {
    pub(crate) pixels: usize,
    /// Pixels beyond [`STEP`], and those where one of the two sees a surface and the other none.
    pub(crate) wrong: usize,
    /// Mean of |difference| over pixels where both see a surface.
    pub(crate) mae: f64,
    /// The largest |difference| of those.
    pub(crate) max: f32,
}

/// Compares two images; their figures if they agree.
///
/// # Errors
/// A sentence about what is out of tolerance.
pub(crate) fn check(expected: &Picture, actual: &Picture) -> Result<Figures, String> {
    if (expected.width, expected.height) != (actual.width, actual.height) {
        return Err(format!(
            "the golden picture has {}x{} pixels, the image {}x{}",
            expected.width, expected.height, actual.width, actual.height
        ));
    }
    let figures = figures(expected, actual);
    let may_be_wrong = (figures.pixels as f64 * WRONG_SHARE) as usize;
    if figures.wrong > may_be_wrong {
        let Figures { wrong, pixels, max, .. } = figures;
        return Err(format!(
            "{wrong} of {pixels} pixels differ by more than {STEP:.4}, at most {may_be_wrong} may; the largest difference is {max:.3}"
        ));
    }
    if figures.mae > MAX_MAE {
        return Err(format!("the mean difference is {:.5}, at most {MAX_MAE:.5}", figures.mae));
    }
    Ok(figures)
}

/// The figures of two images of the same size.
pub(crate) fn figures(expected: &Picture, actual: &Picture) -> Figures {
    let (mut wrong, mut sum, mut max, mut both) = (0, 0.0, 0.0f32, 0usize);
    for (&e, &a) in expected.values.iter().zip(&actual.values) {
        if e.is_nan() || a.is_nan() {
            wrong += usize::from(e.is_nan() != a.is_nan());
            continue;
        }
        let difference = (e - a).abs();
        wrong += usize::from(difference > STEP);
        sum += f64::from(difference);
        max = max.max(difference);
        both += 1;
    }
    Figures { pixels: expected.values.len(), wrong, mae: sum / both.max(1) as f64, max }
}
