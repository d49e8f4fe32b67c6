//! The parametrisations of a frame and which of them is taken: the variant `auto`.

use glam::DVec3;

use crate::Variant;
use crate::aliasing;
use crate::light_image::LightImage;
use crate::seen::Sample;
use crate::view_frame::ViewFrame;
use crate::warp::{Warp, Window};
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
        is_better(&errors(&self.image.warp, &even), &errors(&least, &self.window(&least)))
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

/// The even map is kept for gains below this share: by so much error strays from the measure. It is the standard deviation of
/// ln(wrong pixels / measure) over rows that are not those of the README: the example `fresh_views` prints it.
const LEAST_GAIN: f64 = 1.0 / 6.0;

/// Whether a map with the errors `other` is better than the even one with those, sample by sample: if their mean is lower by
/// [`LEAST_GAIN`] and by twice the standard error of the difference. What chance could have done is no reason to warp.
fn is_better(even: &[f64], other: &[f64]) -> bool {
    let count = even.len() as f64;
    let gains = || even.iter().zip(other).map(|(a, b)| a - b);
    let mean = gains().sum::<f64>() / count;
    let variance = gains().map(|g| (g - mean).powi(2)).sum::<f64>() / (count - 1.0).max(1.0);
    mean > 2.0 * (variance / count).sqrt() + LEAST_GAIN * even.iter().sum::<f64>() / count
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_even_map_is_kept_unless_another_can_be_relied_on_to_be_better() {
        let even = [4.0, 4.0, 5.0, 3.0, 4.0];
        assert!(is_better(&even, &[2.0, 2.1, 2.5, 1.5, 2.0]));
        // A gain too small to rely on; what chance could have done; worse.
        assert!(!is_better(&even, &[3.9, 3.9, 4.9, 2.9, 3.9]));
        assert!(!is_better(&even, &[9.0, 0.1, 9.0, 0.1, 0.1]));
        assert!(!is_better(&even, &[9.0; 5]));
        // Nothing to go by.
        assert!(!is_better(&even, &[f64::NAN; 5]));
        assert!(!is_better(&[], &[]));
    }
}
