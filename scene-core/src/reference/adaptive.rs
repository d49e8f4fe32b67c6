//! Ground truth by as many shadow rays as an error asks for.
//!
//! A few samples tell how much those of a pixel disagree, and so how many it takes; V comes from fresh samples alone. How
//! many are taken thus never hangs on the samples that count, and V is unbiased whatever the first ones said.

use std::ops::ControlFlow;

use super::sampled::{Tracer, where_not_proved};
use super::tiles::{Cancelled, Estimate, Reference};
use super::{Occlusion, ReferenceSettings};
use crate::light::sampling::LightView;
use crate::{GBuffer, Light, Scene};

/// Samples that are looked at first.
const FIRST: u32 = 32;

/// What is aimed for, over the error asked: of 16 strata a few disagree, so what they tell is rough, and too few samples
/// cost more error than too many save.
const MARGIN: f32 = 0.75;

/// The seed of the first samples is another one.
const FIRST_SEED: u64 = 0x9e37_79b9_7f4a_7c15;

/// V of `light` for every pixel of `gbuffer` that sees a surface, by the same rules as [`reference()`](super::reference()),
/// with as many samples a pixel as its standard error takes to be about `max_error` or less, and no more than
/// `settings.samples`; where the first 32 samples agree nothing is known, and it takes all. Of each pixel `std_error` says
/// what was reached.
///
/// # Errors
/// [`Cancelled`] if `progress` breaks.
pub fn adaptive_reference(
    scene: &Scene,
    casters: &impl Occlusion,
    light: &Light,
    gbuffer: &GBuffer,
    settings: &ReferenceSettings,
    max_error: f32,
    progress: &(dyn Fn(f32) -> ControlFlow<()> + Sync),
) -> Result<Reference, Cancelled> {
    let first = ReferenceSettings { samples: FIRST, seed: settings.seed ^ FIRST_SEED, ..*settings };
    let tracer = Tracer { casters, light, gbuffer, settings, magnitude: scene.bounds().magnitude() };
    where_not_proved(scene, tracer, progress, |pixel, scratch, work| {
        let mut samples = settings.samples;
        if samples > FIRST && !LightView::new(light, gbuffer.position[pixel]).is_single() {
            let told = Tracer { settings: &first, ..tracer }.pixel(pixel, scratch, work);
            samples = enough(told, max_error, samples);
        }
        Tracer { settings: &ReferenceSettings { samples, ..*settings }, ..tracer }.pixel(pixel, scratch, work)
    })
}

/// Samples that a pixel takes for an error, told by its first ones.
///
/// A shadow's edge crosses about √n of n strata, and the strata it crosses are those that disagree: the standard error
/// √split/n falls as n^(−3/4).
fn enough(first: Estimate, max_error: f32, most: u32) -> u32 {
    let told = first.visibility > 0.0 && first.visibility < 1.0;
    if !(told && max_error > 0.0) {
        return most;
    }
    let samples = FIRST as f32 * (first.std_error / (MARGIN * max_error)).powf(4.0 / 3.0);
    // One stratum that disagrees is an error of 1/n.
    let samples = samples.max(1.0 / max_error);
    if samples < most as f32 { (samples.ceil() as u32).max(2) } else { most }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn as_many_samples_as_an_error_takes() {
        let first = Estimate { visibility: 0.5, std_error: MARGIN * 0.04 };
        assert_eq!(enough(first, 0.04, 1024), FIRST);
        assert!(enough(first, 0.005, 1024).abs_diff(16 * FIRST) <= 1);
        assert_eq!(enough(first, 0.005, 256), 256);
        assert_eq!(enough(first, 1.0, 1024), 2);
        for odd in [0.0, -1.0, f32::NAN] {
            assert_eq!(enough(first, odd, 1024), 1024);
        }
        // Samples that agree say nothing of a hair between them.
        assert_eq!(enough(Estimate { visibility: 1.0, ..first }, 0.04, 1024), 1024);
    }
}
