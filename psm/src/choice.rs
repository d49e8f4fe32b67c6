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

/// A parametrisation and what it would give.
#[derive(Clone, Debug)]
pub struct Candidate {
    /// Which it is.
    pub parametrisation: Parametrisation,
    /// Its forms.
    pub warp: Warp,
    /// Mean of [`aliasing::expected_error`] over the samples near shadows, scene units.
    pub measure: f64,
    values: Vec<f64>,
}

impl Candidate {
    fn new(parametrisation: Parametrisation, warp: Warp, values: Vec<f64>) -> Self {
        let measure = values.iter().sum::<f64>() / values.len().max(1) as f64;
        Self { parametrisation, warp, measure, values }
    }
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
    /// Those that `variant` may take, uniform first. A `psm` that has no shift is left out.
    pub fn candidates(&self, variant: Variant) -> Vec<Candidate> {
        let uniform = || (Parametrisation::Uniform, self.image.warp);
        let psm = |from: f64| {
            let warp = |shift| post_perspective::warp(self.frame, self.image.light, shift, &self.receivers);
            virtual_camera::least(from, self.depths[1], warp)
                .map(|(shift, warp)| (Parametrisation::Psm { shift }, warp))
        };
        let lispsm = || {
            let warp = lispsm::warp(&self.image, self.frame, self.depths, &self.receivers);
            (Parametrisation::Lispsm, warp)
        };
        let warps: Vec<_> = match variant {
            Variant::Uniform => vec![uniform()],
            Variant::Psm => vec![psm(self.papers_shift).unwrap_or_else(uniform)],
            Variant::Lispsm => vec![lispsm()],
            Variant::Auto => {
                let warp = fitted::least(
                    &self.image.warp,
                    &self.window(&self.image.warp),
                    &self.spread().collect::<Vec<_>>(),
                    self.near_shadows,
                );
                let fitted = warp.map(|warp| (Parametrisation::Fitted, warp));
                std::iter::once(uniform()).chain(fitted).collect()
            }
        };
        warps.into_iter().map(|(parametrisation, warp)| self.measured(parametrisation, warp)).collect()
    }

    /// All receivers that are known by place.
    fn spread(&self) -> impl Iterator<Item = DVec3> {
        self.samples.iter().map(|s| s.point).chain(self.receivers.iter().copied())
    }

    /// Their window.
    fn window(&self, warp: &Warp) -> Window {
        self.spread().fold(Window::EMPTY, |window, point| window.with(warp.place(point))).widened()
    }

    /// A warp, measured in the window that these receivers would give it.
    fn measured(&self, parametrisation: Parametrisation, warp: Warp) -> Candidate {
        let window = self.window(&warp);
        let errors = aliasing::expected_errors(&warp, &window, self.map_size, self.near_shadows);
        Candidate::new(parametrisation, warp, errors)
    }
}

/// Uniform is kept for gains below this share: by so much error strays from the measure. It is the standard deviation of
/// ln(wrong pixels / measure) over rows that are not those of the README: the example `fresh_views` prints it.
const LEAST_GAIN: f64 = 1.0 / 6.0;

/// Among the others what differs by less than this share is the same, and the first of them is taken: rounding decides nothing.
const SAME: f64 = 1.0 / 1024.0;

/// The candidate with the least measure. The first (uniform) is kept unless another one's mean is lower by a share of
/// 1/6 and by twice the standard error of the difference, sample by sample: what chance could have done is no
/// reason to warp.
pub fn choose(candidates: Vec<Candidate>) -> Option<Candidate> {
    let mut candidates = candidates.into_iter();
    let first = candidates.next()?;
    let is_better = |other: &Candidate| {
        let n = first.values.len() as f64;
        let gain = || first.values.iter().zip(&other.values).map(|(a, b)| a - b);
        let mean = gain().sum::<f64>() / n;
        let variance = gain().map(|g| (g - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
        mean > 2.0 * (variance / n).sqrt() + first.measure * LEAST_GAIN
    };
    let better = |best: Option<Candidate>, other: Candidate| match best {
        Some(best) if other.measure >= best.measure * (1.0 - SAME) => Some(best),
        _ => Some(other),
    };
    let best = candidates.filter(is_better).fold(None, better);
    Some(best.unwrap_or(first))
}

#[cfg(test)]
mod tests {
    use glam::DVec4;

    use super::*;

    fn candidate(parametrisation: Parametrisation, values: &[f64]) -> Candidate {
        let warp = Warp { x: DVec4::X, y: DVec4::Y, w: DVec4::W };
        Candidate::new(parametrisation, warp, values.to_vec())
    }

    #[test]
    fn the_best_is_taken_unless_chance_could_have_made_it() {
        let uniform = || candidate(Parametrisation::Uniform, &[4.0, 4.0, 5.0, 3.0, 4.0]);
        let better = candidate(Parametrisation::Lispsm, &[2.0, 2.1, 2.5, 1.5, 2.0]);
        let lucky = candidate(Parametrisation::Psm { shift: 0.0 }, &[9.0, 0.1, 9.0, 0.1, 0.1]);
        let chosen = |c: Vec<Candidate>| choose(c).map(|c| c.parametrisation);
        assert_eq!(chosen(vec![uniform(), lucky.clone()]), Some(Parametrisation::Uniform));
        assert_eq!(chosen(vec![uniform(), lucky, better]), Some(Parametrisation::Lispsm));
        // A gain too small to rely on; one that is the same as the one before.
        let little = candidate(Parametrisation::Lispsm, &[3.9, 3.9, 4.9, 2.9, 3.9]);
        assert_eq!(chosen(vec![uniform(), little]), Some(Parametrisation::Uniform));
        let lispsm = candidate(Parametrisation::Lispsm, &[2.0; 5]);
        let same = candidate(Parametrisation::Psm { shift: 0.0 }, &[1.9999; 5]);
        assert_eq!(chosen(vec![uniform(), lispsm, same]), Some(Parametrisation::Lispsm));
        assert_eq!(chosen(vec![uniform()]), Some(Parametrisation::Uniform));
        assert_eq!(chosen(Vec::new()), None);
    }
}
