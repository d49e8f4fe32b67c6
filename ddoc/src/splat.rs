//! Step 3, the splat of an edge: the part of the light's image that its penumbra can fall on.
//!
//! The paper splats pixels of the image, as wide as the penumbra is on the far surface. Here an edge (a, b) is splatted.
//! A receiver that it half hides lies at p = q + τ·(q − s) for a point q of the edge, a point s of the light and τ ≥ 0, no
//! farther from the light than the farthest receiver there. For a fixed τ-plane that is a projective map of q and of s
//! each, so that the image of all such p lies in the convex hull of the images of the edge's ends and of what the corners
//! of the light's hull throw from them as far as the farthest receiver: the light's true size and the two depths, nothing
//! else.
//!
//! All this is so where all of the light lies nearer than the edge, by the distance along the image's axis. An edge beside a
//! large light throws shadows back past itself, too, on receivers that are nearer than it is: its splat is taken to be
//! everywhere.

use glam::Vec3;
use scene_core::light::{LightHull, LightPoint};

use crate::light_image::{Bounds, LightImage};

/// How far beyond its bounds a splat is taken to reach, in texels, for the rounding of f32 positions; that of the
/// image's own coordinates is below a thousandth.
const SLACK: f32 = 0.25;

/// A cosine between a shadow's way and the image's axis below which the shadow may come back: the axis is good to 2⁻²⁴.
const LEAST_RATE: f64 = 1.0 / 262_144.0;

/// Where receivers may lie that an edge half hides.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Splat {
    /// In the image.
    pub bounds: Bounds,
    /// Receivers no farther along the axis than this are not reached: the edge's own distance, −∞ where shadows come back.
    pub beyond: f32,
}

/// An edge as light falls past it: what its splats have in common, however far their receivers lie.
#[derive(Clone, Copy, Debug)]
pub struct Cast<'a> {
    image: &'a LightImage,
    ends: [Vec3; 2],
    /// Bounds of the light; none where shadows come back.
    hull: Option<&'a LightHull>,
    beyond: f32,
}

impl<'a> Cast<'a> {
    /// Of the edge between `ends`.
    pub fn new(image: &'a LightImage, ends: [Vec3; 2], hull: Option<&'a LightHull>) -> Self {
        let goes_on =
            |end: Vec3, corner: LightPoint| image.rate(end, corner).is_some_and(|rate| rate > LEAST_RATE);
        let hull = hull.filter(|hull| {
            hull.corners().iter().all(|&corner| match corner {
                LightPoint::At(_) => ends.into_iter().all(|end| goes_on(end, corner)),
                // The same way from everywhere.
                LightPoint::Towards(_) => goes_on(ends[0], corner),
            })
        });
        let nearest = || image.along(ends[0]).min(image.along(ends[1]));
        Self { image, ends, hull, beyond: if hull.is_some() { nearest() } else { f32::NEG_INFINITY } }
    }

    /// The splat for receivers up to the distance `far`; `None` if all of them lie before the edge. Everything where the shadow
    /// comes back or reaches behind the light's plane.
    pub fn splat(&self, far: f32) -> Option<Splat> {
        let Self { image, ends, beyond, .. } = *self;
        let everywhere = Splat { bounds: Bounds::ALL, beyond };
        let Some(hull) = self.hull else { return Some(everywhere) };
        if beyond >= far {
            return None;
        }
        let mut bounds = Bounds::NONE;
        for end in ends {
            match image.place(end) {
                Some(place) => bounds = bounds.with(place),
                None => return Some(everywhere),
            }
            for &corner in hull.corners() {
                match image.thrown(end, corner, far).and_then(|thrown| image.place(thrown)) {
                    Some(place) => bounds = bounds.with(place),
                    None => return Some(everywhere),
                }
            }
        }
        Some(Splat { bounds: bounds.grown(SLACK), beyond })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gnomon_shadow_map::light_views::light_views;
    use scene_core::{Light, scenes};

    /// Every receiver that an edge lies before, as some point of the light sees it, is in the edge's splat: under lights as large as
    /// the scene, too, whose shadows come back past edges beside them.
    #[test]
    fn whatever_an_edge_hides_is_in_its_splat() {
        let setup = scenes::build("edges", 0.0).expect("built in");
        let casters: Vec<_> = setup.scene.objects().iter().collect();
        let bounds = setup.scene.bounds();
        let (center, size) = (bounds.center(), bounds.size().length());
        let mut numbers = 0x2545_f491_u32;
        let mut number = move || {
            numbers = numbers.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (numbers >> 8) as f32 / 8_388_608.0 - 1.0
        };
        let mut came_back = 0;
        for share in [0.02, 0.2, 0.5] {
            let radius = share * size;
            let lights = [
                Light::Sphere { center, radius },
                Light::Rect { center, half_u: Vec3::X * radius, half_v: Vec3::new(0.0, 0.3, 0.9) * radius },
                Light::Disk { center, normal: Vec3::NEG_Y, radius },
                Light::Directional { direction: Vec3::new(0.4, -1.0, 0.3), angular_radius: share },
            ];
            for light in lights {
                let hull = LightHull::of(&light).expect("not that wide");
                let views = light_views(&setup.scene, &light, &casters, false).views;
                let images: Vec<_> = views.into_iter().map(|view| LightImage::new(view, 256)).collect();
                for _ in 0..4_000 {
                    let mut point = || center + Vec3::new(number(), number(), number()) * (0.5 * size);
                    let ends = [point(), point()];
                    let on_edge = ends[0].lerp(ends[1], 0.5 * number() + 0.5);
                    // A point between the hull's corners.
                    let weights: Vec<f32> = hull.corners().iter().map(|_| number() + 1.0).collect();
                    let sum: f32 = weights.iter().sum();
                    let of_light =
                        hull.corners().iter().zip(&weights).fold(Vec3::ZERO, |all, (corner, weight)| {
                            let (LightPoint::At(at) | LightPoint::Towards(at)) = *corner;
                            all + at * (weight / sum)
                        });
                    let way = match hull.corners()[0] {
                        LightPoint::At(_) => on_edge - of_light,
                        LightPoint::Towards(_) => -of_light * size,
                    };
                    let receiver = on_edge + way * (number() + 1.0);
                    for image in &images {
                        let (Some(place), along) = (image.place(receiver), image.along(receiver)) else {
                            continue;
                        };
                        let far = along + along.abs() * 1e-5;
                        let found = Cast::new(image, ends, Some(&hull)).splat(far);
                        assert!(
                            found.is_some_and(|splat| splat.bounds.holds(place) && splat.beyond < far),
                            "{light:?}: {ends:?} before {receiver}: {found:?}"
                        );
                        let nearest = image.along(ends[0]).min(image.along(ends[1]));
                        came_back += u32::from(far < nearest);
                    }
                }
            }
        }
        assert!(came_back > 100, "{came_back}");
    }
}
