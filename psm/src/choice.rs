//! The parametrisations of a frame and which of them is taken: the variant `auto`.

use glam::DVec3;

use crate::Variant;
use crate::aliasing::{self, Aliasing};
use crate::light_image::LightImage;
use crate::seen::Sample;
use crate::view_frame::ViewFrame;
use crate::warp::{Warp, Window};
use crate::{lispsm, post_perspective, virtual_camera};

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
}

/// A parametrisation and what it would give.
#[derive(Clone, Debug)]
pub struct Candidate {
    /// Which it is.
    pub parametrisation: Parametrisation,
    /// Its forms.
    pub warp: Warp,
    /// d over the samples.
    pub aliasing: Aliasing,
    values: Vec<f64>,
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
    /// Receivers that d is measured at.
    pub samples: &'a [Sample],
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
                let mut warps = vec![uniform(), lispsm()];
                let (least, papers) = (psm(0.0), psm(self.papers_shift));
                warps.extend(least);
                warps.extend(papers.filter(|_| papers != least));
                warps
            }
        };
        warps.into_iter().map(|(parametrisation, warp)| self.measured(parametrisation, warp)).collect()
    }

    /// d of a warp in the window that these receivers would give it.
    fn measured(&self, parametrisation: Parametrisation, warp: Warp) -> Candidate {
        let points = self.samples.iter().map(|s| s.point).chain(self.receivers.iter().copied());
        let window = points.fold(Window::EMPTY, |window, point| window.with(warp.place(point)));
        let window = window.widened();
        let values = aliasing::of_samples(&warp, &window, self.map_size, self.frame, self.samples);
        Candidate { parametrisation, warp, aliasing: Aliasing::of(values.clone()), values }
    }
}

/// The candidate with the least mean d. The first (uniform) is kept unless another one's mean is lower by more than
/// twice the standard error of the difference, sample by sample: what chance could have done is no reason to warp.
pub fn choose(candidates: Vec<Candidate>) -> Option<Candidate> {
    let mut candidates = candidates.into_iter();
    let first = candidates.next()?;
    let is_better = |other: &Candidate| {
        let n = first.values.len() as f64;
        let gain = || first.values.iter().zip(&other.values).map(|(a, b)| a - b);
        let mean = gain().sum::<f64>() / n;
        let variance = gain().map(|g| (g - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
        mean > 2.0 * (variance / n).sqrt()
    };
    let best = candidates.filter(is_better).min_by(|a, b| a.aliasing.mean.total_cmp(&b.aliasing.mean));
    Some(best.unwrap_or(first))
}

#[cfg(test)]
mod tests {
    use glam::DVec4;

    use super::*;

    fn candidate(parametrisation: Parametrisation, values: &[f64]) -> Candidate {
        let warp = Warp { x: DVec4::X, y: DVec4::Y, w: DVec4::W };
        let aliasing = Aliasing::of(values.to_vec());
        Candidate { parametrisation, warp, aliasing, values: values.to_vec() }
    }

    #[test]
    fn the_best_is_taken_unless_chance_could_have_made_it() {
        let uniform = || candidate(Parametrisation::Uniform, &[4.0, 4.0, 5.0, 3.0, 4.0]);
        let better = candidate(Parametrisation::Lispsm, &[2.0, 2.1, 2.5, 1.5, 2.0]);
        let lucky = candidate(Parametrisation::Psm { shift: 0.0 }, &[9.0, 0.1, 9.0, 0.1, 0.1]);
        let chosen = |c: Vec<Candidate>| choose(c).map(|c| c.parametrisation);
        assert_eq!(chosen(vec![uniform(), lucky.clone()]), Some(Parametrisation::Uniform));
        assert_eq!(chosen(vec![uniform(), lucky, better]), Some(Parametrisation::Lispsm));
        assert_eq!(chosen(vec![uniform()]), Some(Parametrisation::Uniform));
        assert_eq!(chosen(Vec::new()), None);
    }
}
