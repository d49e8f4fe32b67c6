//! Whether a technique stood a trial.

use scene_core::VisibilityImage;
use scene_core::metrics::{self, Errors};
use serde::Serialize;

use crate::error::CliError;
use crate::ground_truth::GroundTruth;

/// What a cell came to.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case", tag = "verdict")]
pub(crate) enum Verdict {
    /// Finite, in [0, 1], and close enough where that can be said.
    Pass {
        rmse: f64,
        /// The largest rmse allowed; none where the image is that of no other trial.
        bound: Option<f64>,
    },
    /// A value that is not finite or not in [0, 1], or too large an error.
    Fail { why: String },
    /// The technique says that it does not take this input.
    Refused { why: String },
}

/// Checks an image. `base_rmse` is the error on the scene that this one must look like.
///
/// The bound: a change of coordinates rounds vertices and maps differently, which may move a shadow's edge by up to half a
/// pixel or half a texel, whichever is larger on screen; on these small images that is half a pixel. Then V changes at a
/// pixel by at most half its largest difference from a neighbour in the truth; the root mean square of that, plus the two
/// truths' own noise, is what may be added to the error.
pub(crate) fn judge(
    image: &VisibilityImage,
    truth: &GroundTruth,
    base_rmse: Option<f64>,
) -> Result<Verdict, CliError> {
    let fault = |(pixel, v): (usize, &f32)| {
        let (x, y) = (pixel % image.width as usize, pixel / image.width as usize);
        let is_seen = !truth.visibility.values[pixel].is_nan();
        (is_seen && !(0.0..=1.0).contains(v)).then(|| format!("V = {v} at pixel ({x}, {y})"))
    };
    if let Some(why) = image.values.iter().enumerate().find_map(fault) {
        return Ok(Verdict::Fail { why });
    }
    let Errors { rmse, .. } = metrics::errors(image, &truth.visibility, &truth.valid)?;
    let noise = if truth.noise().is_nan() { 0.0 } else { truth.noise() };
    let bound = base_rmse.map(|base| base + half_a_pixel(&truth.visibility, &truth.valid) + 2.0 * noise);
    Ok(match bound {
        Some(bound) if rmse > bound => {
            Verdict::Fail { why: format!("rmse {rmse:.4} where {bound:.4} is allowed") }
        }
        bound => Verdict::Pass { rmse, bound },
    })
}

/// Root mean square, over valid pixels, of half the largest difference from a valid neighbour.
fn half_a_pixel(truth: &VisibilityImage, valid: &[bool]) -> f64 {
    let (width, height) = (truth.width as usize, truth.height as usize);
    let (mut sum, mut count) = (0.0, 0_usize);
    for pixel in (0..width * height).filter(|&pixel| valid[pixel]) {
        let (x, y) = (pixel % width, pixel / width);
        let neighbours = [
            (x > 0).then(|| pixel - 1),
            (x + 1 < width).then(|| pixel + 1),
            (y > 0).then(|| pixel - width),
            (y + 1 < height).then(|| pixel + width),
        ];
        let largest = neighbours
            .into_iter()
            .flatten()
            .filter(|&neighbour| valid[neighbour])
            .map(|neighbour| f64::from((truth.values[neighbour] - truth.values[pixel]).abs()))
            .fold(0.0, f64::max);
        sum += (0.5 * largest).powi(2);
        count += 1;
    }
    (sum / count.max(1) as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn truth(values: Vec<f32>) -> GroundTruth {
        let count = values.len();
        GroundTruth {
            visibility: VisibilityImage { width: count as u32, height: 1, values },
            std_error: vec![0.0; count],
            valid: vec![true; count],
        }
    }

    #[test]
    fn what_is_not_a_visibility_fails_and_so_does_a_growing_error() {
        let truth = truth(vec![1.0, 1.0, 0.0, 0.0]);
        let judge = |values: [f32; 4], base| {
            let image = VisibilityImage { width: 4, height: 1, values: values.to_vec() };
            judge(&image, &truth, base).unwrap()
        };
        for bad in [f32::NAN, -0.01, 1.01, f32::INFINITY] {
            assert!(matches!(judge([1.0, bad, 0.0, 0.0], None), Verdict::Fail { .. }), "{bad}");
        }
        // An edge that moved by half a pixel passes, one by a whole pixel does not.
        assert!(matches!(judge([1.0, 0.5, 0.5, 0.0], Some(0.0)), Verdict::Pass { .. }));
        assert!(matches!(judge([1.0, 0.0, 0.0, 0.0], Some(0.0)), Verdict::Fail { .. }));
        assert!(matches!(judge([0.0, 0.0, 1.0, 1.0], None), Verdict::Pass { bound: None, .. }));
    }
}
