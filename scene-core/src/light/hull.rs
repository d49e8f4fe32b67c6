//! A simple convex hull of a light: a few points between which all of it lies.

use glam::{DVec3, Vec3};

use super::{Light, LightPoint};

/// Half the opening of a cone of directions, in radians, up to which the corners of a square around it are of use:
/// beyond, they lie near the horizon, and what they say of a face they say of nearly all.
const WIDEST: f32 = 1.4;

/// Points whose convex hull holds a light: of a `rect` its corners, of a `disk` those of the square around it, of a
/// `sphere` those of the cube around it, of a sun four directions whose pyramid holds its cone. A light without extent
/// has its one point.
///
/// What is linear in the light's point (the side of a plane it lies on) is for all of the light between what it is at
/// the corners.
#[derive(Clone, Debug, PartialEq)]
pub struct LightHull {
    corners: Vec<LightPoint>,
}

impl LightHull {
    /// Of `light`; `None` for a sun so wide that no pyramid holds it.
    pub fn of(light: &Light) -> Option<Self> {
        let square = |u: DVec3, v: DVec3| {
            [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, y)| u * x + v * y)
        };
        let at = |place: DVec3| LightPoint::At(place.as_vec3());
        let corners = match *light {
            Light::Rect { center, half_u, half_v } => {
                square(half_u.as_dvec3(), half_v.as_dvec3()).map(|d| at(center.as_dvec3() + d)).to_vec()
            }
            Light::Disk { center, normal, radius } => {
                let (u, v) = normal.as_dvec3().normalize_or(DVec3::Y).any_orthonormal_pair();
                let reach = f64::from(radius);
                square(u * reach, v * reach).map(|d| at(center.as_dvec3() + d)).to_vec()
            }
            Light::Sphere { center, radius } => {
                let reach = f64::from(radius);
                let face = square(DVec3::X * reach, DVec3::Y * reach);
                let side = |z: f64| face.map(|d| at(center.as_dvec3() + d + DVec3::Z * (z * reach)));
                [side(-1.0), side(1.0)].concat()
            }
            Light::Directional { direction, angular_radius } if angular_radius > 0.0 => {
                if angular_radius > WIDEST {
                    return None;
                }
                let towards = (-direction.as_dvec3()).normalize_or(DVec3::Y);
                let (u, v) = towards.any_orthonormal_pair();
                let reach = f64::from(angular_radius).tan();
                square(u * reach, v * reach)
                    .map(|d| LightPoint::Towards((towards + d).normalize().as_vec3()))
                    .to_vec()
            }
            Light::Directional { .. } | Light::Point { .. } | Light::Spot { .. } => vec![light.center()],
        };
        Some(Self { corners })
    }

    /// The corners.
    pub fn corners(&self) -> &[LightPoint] {
        &self.corners
    }

    /// On which side of a triangle the light lies: as [`facing_of`](crate::geometry::facing_of) where it is the same for
    /// all points of the light, 0 where it is not, or may not be within rounding.
    ///
    /// The facing is linear in the light's point, so the corners decide. Rounding: the corners are those of f64 rounded to
    /// f32, off by 2⁻²⁴ of their coordinates, and the determinant is of differences of f32 in f64; a corner so near to the
    /// plane that 2⁻²⁰ of its terms would carry it over is on neither side.
    pub fn facing(&self, [a, b, c]: [Vec3; 3]) -> i8 {
        let [a, b, c] = [a, b, c].map(Vec3::as_dvec3);
        let normal = (b - a).cross(c - a);
        let (mut some_front, mut some_back) = (false, false);
        for corner in &self.corners {
            let (to_corner, terms) = match *corner {
                LightPoint::At(place) => {
                    let place = place.as_dvec3();
                    (place - a, place.abs() + a.abs())
                }
                LightPoint::Towards(direction) => (direction.as_dvec3(), direction.as_dvec3().abs()),
            };
            let side = normal.dot(to_corner);
            let doubt = normal.abs().dot(terms) * (1.0 / 1_048_576.0);
            some_front |= side > -doubt || side.is_nan();
            some_back |= side < doubt || side.is_nan();
        }
        i8::from(some_front) - i8::from(some_back)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::facing_of;
    use crate::light::sampling::{LightView, SampleKey, low_discrepancy};

    /// What the hull says of a triangle, every point of the light says; where it says nothing, two points disagree for
    /// most triangles (a hull is larger than the light).
    #[test]
    fn a_hull_speaks_for_all_of_its_light() {
        let center = Vec3::new(1.0, 5.0, 2.0);
        let lights = [
            Light::Rect { center, half_u: Vec3::new(0.5, 0.1, 0.0), half_v: Vec3::new(0.0, 0.2, 0.7) },
            Light::Disk { center, normal: Vec3::new(0.1, -1.0, 0.2), radius: 0.4 },
            Light::Sphere { center, radius: 0.6 },
            Light::Directional { direction: -center, angular_radius: 0.2 },
        ];
        let mut numbers = 0x2545_f491_u32;
        let mut number = || {
            numbers = numbers.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (numbers >> 8) as f32 / 16_777_216.0 * 2.0 - 1.0
        };
        for light in lights {
            let hull = LightHull::of(&light).unwrap();
            let mut points = [LightPoint::At(Vec3::ZERO); 64];
            low_discrepancy(&LightView::new(&light, Vec3::ZERO), SampleKey::new(1, 2), &mut points);
            let (mut known, mut differ, mut unknown) = (0, 0, 0);
            for _ in 0..2000 {
                let corners = [(); 3].map(|()| Vec3::new(number(), number(), number()) * 3.0);
                let facings = points.map(|point| facing_of(corners, point));
                let same = facings.iter().all(|&facing| facing == facings[0]);
                match hull.facing(corners) {
                    0 => {
                        unknown += 1;
                        differ += usize::from(!same);
                    }
                    facing => {
                        known += 1;
                        assert!(facings.iter().all(|&of_point| of_point == facing), "{light:?}");
                    }
                }
            }
            assert!(
                known > 1000 && differ * 3 > unknown,
                "{light:?}: {known} known, {differ} of {unknown} differ"
            );
        }
    }

    #[test]
    fn what_has_no_side_has_none() {
        let sun = Light::Directional { direction: Vec3::NEG_Y, angular_radius: 1.5 };
        assert!(LightHull::of(&sun).is_none());
        let hull = LightHull::of(&Light::Point { position: Vec3::Y }).unwrap();
        assert_eq!(hull.facing([Vec3::X; 3]), 0);
        assert_eq!(hull.facing([Vec3::NAN; 3]), 0);
        assert_eq!(hull.facing([Vec3::ZERO, Vec3::Z, Vec3::X]), 1);
    }
}
