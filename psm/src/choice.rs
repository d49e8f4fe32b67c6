//! The parametrisations of a frame and which of them is taken: the variant `auto`.

use glam::DVec3;

use crate::aliasing;
use crate::light_image::LightImage;
use crate::seen::Sample;
use crate::view_frame::ViewFrame;
use crate::warp::{Warp, Window};
use crate::{Lookup, Variant};
use crate::{fitted, lispsm, post_perspective, virtual_camera};

/// How the texels of a map are spread.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Parametrisation {
    /// As the light sees.
    Uniform,
    /// In post-perspective space of a camera moved back by `shift` scene units.
    Psm {
        /// Of the virtual camera.
        shift: f64,
    },
    /// By a perspective in the light's own image.
    Lispsm,
    /// By the homography of the light's own image that promises the least error.
    Fitted,
}

/// What a warp is made for: one image of the light and who looks at it.
pub struct Situation<'a> {
    /// The light's own image.
    pub image: LightImage,
    /// The camera.
    pub frame: &'a ViewFrame,
    /// Depths of the nearest and farthest receiver.
    pub depths: [f64; 2],
    /// Receivers that span the others, each before the light and the camera.
    pub receivers: Vec<DVec3>,
    /// The paper's shift of the camera ([`virtual_camera::holding`]).
    pub papers_shift: f64,
    /// Receivers spread over the picture.
    pub samples: &'a [Sample],
    /// Those of them where shadows may have edges: what a parametrisation is measured at.
    pub near_shadows: &'a [Sample],
    /// Texels a side.
    pub map_size: u32,
    /// How the map will be looked up.
    pub lookup: Lookup,
}

impl Situation<'_> {
    /// What `variant` takes. A `psm` that has no shift is uniform.
    pub fn chosen(&self, variant: Variant) -> (Parametrisation, Warp) {
        let uniform = || (Parametrisation::Uniform, self.image.warp);
        match variant {
            Variant::Auto => self.fitted().unwrap_or_else(uniform),
            Variant::Uniform => uniform(),
            Variant::Psm => {
                let warp =
                    |shift| post_perspective::warp(self.frame, self.image.light, shift, &self.receivers);
                let found = virtual_camera::least(self.papers_shift, self.depths[1], warp);
                found.map_or_else(uniform, |(shift, warp)| (Parametrisation::Psm { shift }, warp))
            }
            Variant::Lispsm => {
                let warp = lispsm::warp(&self.image, self.frame, self.depths, &self.receivers);
                (Parametrisation::Lispsm, warp)
            }
        }
    }

    /// The variant `auto`: the map that promises the least error, if that can be relied on to be less than the even map's.
    fn fitted(&self) -> Option<(Parametrisation, Warp)> {
        let even = self.window(&self.image.warp);
        let receivers: Vec<_> = self.spread().collect();
        let least = fitted::least(&self.image.warp, &even, &receivers, self.near_shadows)?;
        let errors = |warp: &Warp, window: &Window| {
            aliasing::expected_errors(warp, window, self.map_size, self.near_shadows)
        };
        let gain = least_gain(self.lookup);
        is_better(&errors(&self.image.warp, &even), &errors(&least, &self.window(&least)), gain)
            .then_some((Parametrisation::Fitted, least))
    }

    /// All receivers that are known by place.
    fn spread(&self) -> impl Iterator<Item = DVec3> {
        self.samples.iter().map(|s| s.point).chain(self.receivers.iter().copied())
    }

    /// Their window.
    fn window(&self, warp: &Warp) -> Window {
        self.spread().fold(Window::EMPTY, |window, point| window.with(warp.place(point))).widened()
    }
}

/// The even map is kept for gains below this share, by what the example `fresh_views` prints of rows that are not those of the
/// README. One texel's errors stray from the measure by as much: it is the standard deviation of ln(wrong pixels / measure). Those
/// that surfaces leave fall faster than the measure, and of no row was any gain that it promised missed.
pub(crate) fn least_gain(lookup: Lookup) -> f64 {
    match lookup {
        Lookup::Surface => 0.0,
        Lookup::Texel => 1.0 / 6.0,
    }
}

/// Whether a map with the errors `other` is better than the even one with those, sample by sample: if their mean is lower by
/// the share `gain` and by twice the standard error of the difference. What chance could have done is no reason to warp.
fn is_better(even: &[f64], other: &[f64], gain: f64) -> bool {
    let count = even.len() as f64;
    let gains = || even.iter().zip(other).map(|(a, b)| a - b);
    let mean = gains().sum::<f64>() / count;
    let variance = gains().map(|g| (g - mean).powi(2)).sum::<f64>() / (count - 1.0).max(1.0);
    mean > 2.0 * (variance / count).sqrt() + gain * even.iter().sum::<f64>() / count
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_even_map_is_kept_unless_another_can_be_relied_on_to_be_better() {
        let even = [4.0, 4.0, 5.0, 3.0, 4.0];
        for gain in [Lookup::Surface, Lookup::Texel].map(least_gain) {
            let is_better = |other: &[f64]| is_better(&even, other, gain);
            assert!(is_better(&[2.0, 2.1, 2.5, 1.5, 2.0]));
            // What chance could have done; worse; nothing to go by.
            assert!(!is_better(&[9.0, 0.1, 9.0, 0.1, 0.1]));
            assert!(!is_better(&[9.0; 5]));
            assert!(!is_better(&[f64::NAN; 5]));
        }
        // One texel's errors stray by more than this gain.
        let slightly = [3.9, 3.9, 4.9, 2.9, 3.9];
        assert!(is_better(&even, &slightly, least_gain(Lookup::Surface)));
        assert!(!is_better(&even, &slightly, least_gain(Lookup::Texel)));
        assert!(!is_better(&[], &[], 0.0));
    }
}
