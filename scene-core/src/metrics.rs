//! Errors of a visibility image against ground truth.
//!
//! Errors are taken over the *valid* pixels ([`valid_pixels`](crate::reference::valid_pixels)). A technique that
//! leaves a valid pixel without a finite value is not let off: the pixel counts as wrong by 1, and it is counted.

use serde::Serialize;
use thiserror::Error;

use crate::VisibilityImage;

/// The penumbra: where ground truth lies strictly between these.
const PENUMBRA: (f32, f32) = (0.001, 0.999);

/// By how many pixels the penumbra is widened for [`Errors::pen_rmse`]: its rim is where blurs leak.
const DILATION: usize = 2;

/// Why two images cannot be compared.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum MetricsError {
    /// Sizes differ, or an image holds another number of values than its size says.
    #[error("{what} is {got}, but the reference is {expected}")]
    Size {
        /// "the image" or "the mask of valid pixels".
        what: &'static str,
        /// Its size, for people.
        got: String,
        /// The reference's.
        expected: String,
    },
    /// Ground truth has no value in [0, 1] at a valid pixel: mask and reference do not belong together.
    #[error("the reference is {value} at the valid pixel ({x}, {y})")]
    Reference {
        /// Column.
        x: usize,
        /// Row.
        y: usize,
        /// The value.
        value: f32,
    },
}

/// Errors over valid pixels, in units of V. With no valid pixel (for `pen_rmse`: with no penumbra) they are 0;
/// the counts tell that from perfection.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Errors {
    /// Mean of |error|.
    pub mae: f64,
    /// Root of the mean squared error.
    pub rmse: f64,
    /// 99th percentile of |error|: of n sorted values the one at 0.99·(n − 1), linear between neighbours.
    pub p99: f64,
    /// `rmse` over the penumbra: the valid pixels within 2 pixels (in both x and y) of a valid pixel whose
    /// reference lies strictly between 0.001 and 0.999.
    pub pen_rmse: f64,
    /// Largest |error|.
    pub max: f64,
    /// Mean error: above 0 the image is too bright.
    pub bias: f64,
    /// Valid pixels.
    pub valid: usize,
    /// Pixels that `pen_rmse` is taken over.
    pub penumbra: usize,
    /// Valid pixels where the image is NaN or infinite; each is an error of 1 in all of the above.
    pub missing: usize,
}

/// How much of the valid pixels is lit, in penumbra and in umbra; the three add up to 1, or are 0 with no
/// valid pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Shares {
    /// V ≥ 0.999.
    pub lit: f64,
    /// 0.001 < V < 0.999.
    pub penumbra: f64,
    /// V ≤ 0.001.
    pub umbra: f64,
}

/// All errors of `image` against `reference` over the pixels marked in `valid`.
///
/// # Errors
/// Sizes that differ, or a reference without a value in [0, 1] at a valid pixel.
pub fn errors(
    image: &VisibilityImage,
    reference: &VisibilityImage,
    valid: &[bool],
) -> Result<Errors, MetricsError> {
    let signed = signed_error(image, reference, valid)?;
    let penumbra = penumbra_mask(reference, valid)?;
    let mut magnitudes = Vec::new();
    let (mut sum, mut squares, mut penumbra_squares, mut in_penumbra) = (0.0, 0.0, 0.0, 0);
    let mut missing = 0;
    for pixel in (0..valid.len()).filter(|&pixel| valid[pixel]) {
        let error = f64::from(signed[pixel]);
        missing += usize::from(!image.values[pixel].is_finite());
        sum += error;
        squares += error * error;
        magnitudes.push(error.abs());
        if penumbra[pixel] {
            penumbra_squares += error * error;
            in_penumbra += 1;
        }
    }
    let count = magnitudes.len();
    Ok(Errors {
        mae: mean(magnitudes.iter().sum(), count),
        rmse: mean(squares, count).sqrt(),
        p99: percentile(&mut magnitudes, 0.99),
        pen_rmse: mean(penumbra_squares, in_penumbra).sqrt(),
        max: magnitudes.iter().copied().fold(0.0, f64::max),
        bias: mean(sum, count),
        valid: count,
        penumbra: in_penumbra,
        missing,
    })
}

/// `image` − `reference` at valid pixels: above 0 the image is too bright. NaN at other pixels. Where the image
/// has no finite value the error is 1, upwards where the reference is dark and downwards where it is lit.
///
/// # Errors
/// As [`errors`].
pub fn signed_error(
    image: &VisibilityImage,
    reference: &VisibilityImage,
    valid: &[bool],
) -> Result<Vec<f32>, MetricsError> {
    check(reference, valid)?;
    let size = |i: &VisibilityImage| format!("{} × {} with {} values", i.width, i.height, i.values.len());
    if (image.width, image.height, image.values.len())
        != (reference.width, reference.height, reference.values.len())
    {
        return Err(MetricsError::Size { what: "the image", got: size(image), expected: size(reference) });
    }
    let error = |pixel: usize| match (valid[pixel], image.values[pixel], reference.values[pixel]) {
        (false, ..) => f32::NAN,
        (true, value, truth) if value.is_finite() => value - truth,
        (true, _, truth) => {
            if truth < 0.5 {
                1.0
            } else {
                -1.0
            }
        }
    };
    Ok((0..valid.len()).map(error).collect())
}

/// The pixels that [`Errors::pen_rmse`] is taken over: valid ones within 2 pixels, in both x and y, of a valid pixel
/// whose reference lies strictly between 0.001 and 0.999.
///
/// # Errors
/// As [`errors`].
pub fn penumbra_mask(reference: &VisibilityImage, valid: &[bool]) -> Result<Vec<bool>, MetricsError> {
    check(reference, valid)?;
    let (width, height) = (reference.width as usize, reference.height as usize);
    let core: Vec<bool> = valid.iter().zip(&reference.values).map(|(&ok, &v)| ok && is_penumbra(v)).collect();
    // A square is widened along rows, then along columns.
    let near = |i: usize, count: usize| i.saturating_sub(DILATION)..(i + DILATION + 1).min(count);
    let rows: Vec<bool> = (0..core.len())
        .map(|pixel| near(pixel % width, width).any(|x| core[pixel - pixel % width + x]))
        .collect();
    Ok((0..core.len())
        .map(|pixel| valid[pixel] && near(pixel / width, height).any(|y| rows[y * width + pixel % width]))
        .collect())
}

/// How much of `image` is lit, in penumbra and in umbra.
///
/// # Errors
/// A mask of another size, or no value in [0, 1] at a valid pixel.
pub fn shares(image: &VisibilityImage, valid: &[bool]) -> Result<Shares, MetricsError> {
    check(image, valid)?;
    let values = || valid.iter().zip(&image.values).filter(|(ok, _)| **ok).map(|(_, &v)| v);
    let share = |of: &dyn Fn(f32) -> bool| mean(values().filter(|&v| of(v)).count() as f64, values().count());
    Ok(Shares {
        lit: share(&|v| v >= PENUMBRA.1),
        penumbra: share(&is_penumbra),
        umbra: share(&|v| v <= PENUMBRA.0),
    })
}

fn is_penumbra(v: f32) -> bool {
    v > PENUMBRA.0 && v < PENUMBRA.1
}

/// That `valid` belongs to `reference`, and that there is truth at every valid pixel.
fn check(reference: &VisibilityImage, valid: &[bool]) -> Result<(), MetricsError> {
    let (width, height) = (reference.width as usize, reference.height as usize);
    for (what, count) in
        [("the reference's data", reference.values.len()), ("the mask of valid pixels", valid.len())]
    {
        if count != width * height {
            let (got, expected) = (format!("{count} values"), format!("{width} × {height}"));
            return Err(MetricsError::Size { what, got, expected });
        }
    }
    let faulty = |pixel: &usize| valid[*pixel] && !(0.0..=1.0).contains(&reference.values[*pixel]);
    match (0..valid.len()).find(faulty) {
        Some(pixel) => Err(MetricsError::Reference {
            x: pixel % width,
            y: pixel / width,
            value: reference.values[pixel],
        }),
        None => Ok(()),
    }
}

/// `sum` / `count`, and 0 of nothing.
fn mean(sum: f64, count: usize) -> f64 {
    if count == 0 { 0.0 } else { sum / count as f64 }
}

/// The value at `share` of the way through the sorted values, linear between neighbours; 0 of nothing.
/// Reorders `values`.
fn percentile(values: &mut [f64], share: f64) -> f64 {
    let Some(last) = values.len().checked_sub(1) else { return 0.0 };
    let place = share * last as f64;
    let (_, &mut lower, above) = values.select_nth_unstable_by(place as usize, f64::total_cmp);
    let upper = above.iter().copied().min_by(f64::total_cmp).unwrap_or(lower);
    lower + (upper - lower) * place.fract()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(width: u32, values: &[f32]) -> VisibilityImage {
        VisibilityImage { width, height: values.len() as u32 / width, values: values.to_vec() }
    }

    #[test]
    fn errors_follow_their_definitions() {
        let truth = image(4, &[0.0, 0.5, 1.0, f32::NAN]);
        let test = image(4, &[0.3, 0.1, 1.0, 0.7]);
        let e = errors(&test, &truth, &[true, true, true, false]).unwrap();
        assert!((e.mae - 0.7 / 3.0).abs() < 1e-7);
        assert!((e.rmse - (0.25f64 / 3.0).sqrt()).abs() < 1e-7);
        assert!((e.bias + 0.1 / 3.0).abs() < 1e-7);
        assert!((e.max - 0.4).abs() < 1e-7);
        // 0.99·2 = 1.98 between 0.3 and 0.4.
        assert!((e.p99 - 0.398).abs() < 1e-6, "{}", e.p99);
        // The middle pixel widens to all three.
        assert_eq!((e.valid, e.penumbra, e.missing), (3, 3, 0));
        assert_eq!(e.pen_rmse, e.rmse);
    }

    #[test]
    fn a_perfect_image_has_no_error_and_a_planted_one_shows() {
        let truth = image(8, &(0..64).map(|i| i as f32 / 63.0).collect::<Vec<_>>());
        let valid = vec![true; 64];
        let e = errors(&truth, &truth, &valid).unwrap();
        assert_eq!((e.mae, e.rmse, e.p99, e.pen_rmse, e.max), (0.0, 0.0, 0.0, 0.0, 0.0));
        let mut spoiled = truth.clone();
        spoiled.values[20] += 0.25;
        let e = errors(&spoiled, &truth, &valid).unwrap();
        assert!((e.max - 0.25).abs() < 1e-6);
        assert!((e.rmse - 0.25 / 8.0).abs() < 1e-6);
        assert!(e.p99 > 0.05 && e.pen_rmse > 0.0);
    }

    #[test]
    fn missing_values_count_as_wrong_by_one() {
        let truth = image(3, &[0.5, 0.2, 1.0]);
        let test = image(3, &[f32::NAN, f32::INFINITY, f32::NEG_INFINITY]);
        let e = errors(&test, &truth, &[true; 3]).unwrap();
        assert_eq!((e.missing, e.mae, e.rmse, e.p99, e.max, e.pen_rmse), (3, 1.0, 1.0, 1.0, 1.0, 1.0));
        assert_eq!(signed_error(&test, &truth, &[true, true, true]).unwrap(), [-1.0, 1.0, -1.0]);
    }

    #[test]
    fn nothing_valid_is_no_error() {
        let truth = image(2, &[f32::NAN; 4]);
        let e = errors(&truth, &truth, &[false; 4]).unwrap();
        assert_eq!(e, Errors::default());
        assert_eq!(shares(&truth, &[false; 4]).unwrap(), Shares::default());
        let empty = VisibilityImage::new(0, 0);
        assert_eq!(errors(&empty, &empty, &[]).unwrap(), Errors::default());
    }

    #[test]
    fn images_that_do_not_belong_together_are_refused() {
        let (a, b) = (image(2, &[1.0; 4]), image(4, &[1.0; 4]));
        assert!(matches!(errors(&a, &b, &[true; 4]), Err(MetricsError::Size { what: "the image", .. })));
        assert!(matches!(errors(&a, &a, &[true; 3]), Err(MetricsError::Size { .. })));
        let hole = image(2, &[1.0, 1.0, f32::NAN, 1.0]);
        let fault = errors(&a, &hole, &[true; 4]);
        assert!(matches!(fault, Err(MetricsError::Reference { x: 0, y: 1, .. })), "{fault:?}");
        assert!(errors(&a, &image(2, &[1.0, 1.5, 1.0, 1.0]), &[true; 4]).is_err());
    }

    #[test]
    fn the_penumbra_is_widened_by_two_pixels_within_valid_ones() {
        let mut truth = image(9, &[1.0; 81]);
        truth.values[4 * 9 + 4] = 0.5;
        truth.values[0] = 0.001;
        truth.values[80] = 0.999;
        let mut valid = vec![true; 81];
        valid[3 * 9 + 3] = false;
        let mask = penumbra_mask(&truth, &valid).unwrap();
        for (pixel, &marked) in mask.iter().enumerate() {
            let distance = (pixel % 9).abs_diff(4).max((pixel / 9).abs_diff(4));
            assert_eq!(marked, distance <= 2 && pixel != 3 * 9 + 3, "{pixel}");
        }
        // A penumbra that is not valid itself widens nothing.
        valid[4 * 9 + 4] = false;
        assert!(!penumbra_mask(&truth, &valid).unwrap().contains(&true));
        // Edges do not wrap from one row to the next.
        let mut corner = image(9, &[1.0; 81]);
        corner.values[8] = 0.5;
        let mask = penumbra_mask(&corner, &[true; 81]).unwrap();
        assert_eq!(mask.iter().filter(|&&m| m).count(), 9);
    }

    #[test]
    fn shares_add_up() {
        let truth = image(4, &[0.0, 0.001, 0.0011, 0.5, 0.999, 1.0, f32::NAN, 1.0]);
        let valid = [true, true, true, true, true, true, false, true];
        let s = shares(&truth, &valid).unwrap();
        assert_eq!((s.lit, s.penumbra, s.umbra), (3.0 / 7.0, 2.0 / 7.0, 2.0 / 7.0));
    }

    #[test]
    fn percentiles_interpolate() {
        let mut values: Vec<f64> = (0..101).rev().map(f64::from).collect();
        assert_eq!(percentile(&mut values, 0.99), 99.0);
        assert!((percentile(&mut [3.0, 1.0], 0.99) - 2.98).abs() < 1e-12);
        assert_eq!(percentile(&mut [5.0], 0.99), 5.0);
        assert_eq!(percentile(&mut [], 0.99), 0.0);
    }
}
