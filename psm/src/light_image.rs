//! What a light sees before any warp: parallel or central projection along an axis, y along the view. Every
//! parametrisation is a homography of it, and `uniform` is it.

use glam::{DMat3, DVec3, DVec4};
use scene_core::Light;
use scene_core::light::LightPoint;
use scene_core::relevance::{HalfSpace, pyramid};

use glam::{Vec2, Vec3};

use crate::warp::{Warp, at};

/// Tangent of the half angle up to which one image serves, 60°: beyond, its middle gets less than a quarter of the
/// texels a radian that its rim gets, and faces of a cube are the better use of memory. As `light_views` of
/// `gnomon-shadow-map`.
pub(crate) const MAX_TAN: f64 = 1.732;

/// The image of a light along one axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightImage {
    /// The light.
    pub light: LightPoint,
    /// Columns: x, y (as much along the view as can be) and towards the light; world space.
    pub axes: DMat3,
    /// Places: scene units of parallel light, tangents of a light at a place.
    pub warp: Warp,
}

impl LightImage {
    /// `backwards` is the axis, towards the light; `along` what y shall follow. If the two are parallel, y is any.
    pub fn new(light: LightPoint, backwards: DVec3, along: DVec3) -> Self {
        let z = backwards.normalize_or(DVec3::Y);
        let y = (along - z * z.dot(along)).normalize_or(z.any_orthonormal_vector());
        let x = y.cross(z);
        let warp = match light {
            LightPoint::Towards(_) => Warp { x: x.extend(0.0), y: y.extend(0.0), w: DVec4::W },
            LightPoint::At(place) => {
                let through = |axis: DVec3| axis.extend(-axis.dot(place.as_dvec3()));
                Warp { x: through(x), y: through(y), w: through(-z) }
            }
        };
        Self { light, axes: DMat3::from_cols(x, y, z), warp }
    }

    /// The one image that serves all of `points`, or none: a light at a place needs them within 60° of its axis.
    pub fn of_all(light: &Light, points: &[DVec3], along: DVec3) -> Option<Self> {
        let center = light.center();
        match center {
            LightPoint::Towards(towards) => Some(Self::new(center, towards.as_dvec3(), along)),
            LightPoint::At(place) => {
                let place = place.as_dvec3();
                let middle = middle_of(points.iter().copied());
                let axis = match *light {
                    Light::Spot { direction, .. } => -direction.as_dvec3(),
                    _ => place - middle,
                };
                let image = Self::new(center, axis, along);
                // A spot's receivers may reach up to the light itself, where there is no angle.
                let cone = matches!(light, Light::Spot { outer, .. } if f64::from(outer.tan()) <= MAX_TAN && *outer < 1.5);
                let fits = |p: &DVec3| {
                    let w = at(image.warp.w, *p);
                    let [x, y] = [image.warp.x, image.warp.y].map(|form| at(form, *p).abs());
                    w > 0.0 && x.max(y) <= MAX_TAN * w
                };
                (cone || points.iter().all(fits)).then_some(image)
            }
        }
    }

    /// Distance along the axis of a light at a place; 1 for parallel light.
    #[inline]
    pub fn w(&self, point: DVec3) -> f64 {
        at(self.warp.w, point)
    }
}

/// The middle of the box around `points`; zero for none.
pub(crate) fn middle_of(points: impl Iterator<Item = DVec3>) -> DVec3 {
    let bounds = points.map(|p| (p, p)).reduce(|(min, max), (p, _)| (min.min(p), max.max(p)));
    bounds.map_or(DVec3::ZERO, |(min, max)| (min + max) * 0.5)
}

/// Faces of the cube around a light at a place.
pub(crate) const FACES: [Vec3; 6] = [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z];

/// The face (an index into [`FACES`], which point towards the light) that sees what lies in `direction` from it.
#[inline]
pub(crate) fn face_of(direction: Vec3) -> usize {
    let size = direction.abs();
    let axis = if size.x >= size.y && size.x >= size.z { 0 } else { if size.y >= size.z { 1 } else { 2 } };
    2 * axis + usize::from(direction[axis] > 0.0)
}

/// What a face sees.
pub(crate) fn face_volume(place: Vec3, face: usize) -> Vec<HalfSpace> {
    let backwards = FACES[face];
    let (x, y) = backwards.any_orthonormal_pair();
    pyramid(place, glam::Mat3::from_cols(x, y, backwards), Vec2::NEG_ONE, Vec2::ONE)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_forms_vanish_at_the_light() {
        let place = Vec3::new(1.0, 5.0, -2.0);
        let image = LightImage::new(LightPoint::At(place), DVec3::new(0.2, 1.0, 0.1), DVec3::X);
        let forms = [image.warp.x, image.warp.y, image.warp.w];
        assert!(forms.iter().all(|&f| at(f, place.as_dvec3()).abs() < 1e-12));
        let towards = Vec3::new(0.6, 0.8, 0.0);
        let image = LightImage::new(LightPoint::Towards(towards), towards.as_dvec3(), DVec3::Z);
        let forms = [image.warp.x, image.warp.y, image.warp.w];
        assert!(forms.iter().all(|&f| f.truncate().dot(towards.as_dvec3()).abs() < 1e-7));
        assert!(image.axes.y_axis.distance(DVec3::Z) < 1e-12);
    }

    #[test]
    fn each_direction_has_the_face_that_looks_there() {
        let place = Vec3::new(0.3, 1.0, -2.0);
        for direction in [Vec3::new(1.0, 0.2, 0.3), Vec3::new(-0.1, -2.0, 1.0), Vec3::new(0.0, 0.3, -0.4)] {
            let face = face_of(direction);
            let point = (place + direction).as_dvec3();
            assert!(face_volume(place, face).iter().all(|plane| plane.height(point) < 0.0), "{direction}");
            assert!(FACES[face].dot(direction) < 0.0);
        }
    }
}
