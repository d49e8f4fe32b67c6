//! The unit square mapped onto a light as one receiver sees it.

use glam::{DVec3, Vec2, Vec3};

use crate::light::{Light, LightPoint};

/// A light seen from one receiver: maps the unit square onto it, so that equal areas of the square are equal
/// shares of V (area for `Rect` and `Disk`, solid angle for `Sphere` and `Directional`).
///
/// Round lights use the concentric map of Shirley and Chiu (1997), which keeps square cells compact; the caps
/// go on from the disk by Lambert's equal-area azimuthal projection. Made in f64 once a receiver, evaluated in
/// f32. A light that [`Light::validate`] refuses, or a receiver that is not finite, gives points that are not
/// finite or lie anywhere, and never a panic.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightView(Shape);

#[derive(Clone, Copy, Debug, PartialEq)]
enum Shape {
    /// All of the square is one point.
    Single(LightPoint),
    /// `corner + x·edge_u + y·edge_v`.
    Parallelogram { corner: Vec3, edge_u: Vec3, edge_v: Vec3 },
    /// `center + x·axis_u + y·axis_v` over the unit disk.
    Disk { center: Vec3, axis_u: Vec3, axis_v: Vec3 },
    /// The part of a sphere that is seen from outside. The axes have the sphere's radius as their length,
    /// `axis_w` points to the receiver. `sin` and `cos` are those of the half angle under which the receiver
    /// sees the sphere, `height` is 1 − cos.
    Cap { center: Vec3, axis_u: Vec3, axis_v: Vec3, axis_w: Vec3, sin: f32, cos: f32, height: f32 },
    /// A sphere from within: all directions. `offset` is the receiver's distance from the centre in radii.
    Inside { center: Vec3, axis_u: Vec3, axis_v: Vec3, axis_w: Vec3, offset: f32 },
    /// Directions about unit vector `axis_w`; `height` is 1 − cos of the angular radius.
    Cone { axis_u: Vec3, axis_v: Vec3, axis_w: Vec3, height: f32 },
}

impl LightView {
    /// `light` as seen from `receiver` (world space).
    ///
    /// A receiver inside a sphere light or on it sees its inner wall in all directions.
    pub fn new(light: &Light, receiver: Vec3) -> Self {
        Self(match *light {
            Light::Directional { direction, angular_radius } if angular_radius > 0.0 => {
                let axis_w = (-direction.as_dvec3()).normalize_or(DVec3::Y);
                let (axis_u, axis_v) = axis_w.any_orthonormal_pair();
                // 1 − cos a, free of cancellation for the 0.0046 rad of the sun.
                let height = 2.0 * (0.5 * f64::from(angular_radius)).sin().powi(2);
                Shape::Cone {
                    axis_u: axis_u.as_vec3(),
                    axis_v: axis_v.as_vec3(),
                    axis_w: axis_w.as_vec3(),
                    height: height as f32,
                }
            }
            Light::Directional { .. } | Light::Point { .. } | Light::Spot { .. } => {
                Shape::Single(light.center())
            }
            Light::Sphere { center, radius } => sphere(center, radius, receiver),
            Light::Rect { center, half_u, half_v } => Shape::Parallelogram {
                corner: center - half_u - half_v,
                edge_u: 2.0 * half_u,
                edge_v: 2.0 * half_v,
            },
            Light::Disk { center, normal, radius } => {
                let (u, v) = normal.as_dvec3().normalize_or(DVec3::Y).any_orthonormal_pair();
                let r = f64::from(radius);
                Shape::Disk { center, axis_u: (u * r).as_vec3(), axis_v: (v * r).as_vec3() }
            }
        })
    }

    /// The point of the light that `square`, in [0, 1]², stands for. Deterministic; NaN stays NaN.
    #[inline]
    pub fn point(&self, square: Vec2) -> LightPoint {
        let mut point = [LightPoint::At(Vec3::NAN)];
        self.points(&[square], &mut point);
        point[0]
    }

    /// [`LightView::point`] of each of `squares`, as many as there is room for in `points`.
    #[inline]
    pub fn points(&self, squares: &[Vec2], points: &mut [LightPoint]) {
        // The kind is told apart once, not once a point.
        match self.0 {
            Shape::Single(point) => map(squares, points, |_| point),
            Shape::Parallelogram { corner, edge_u, edge_v } => {
                map(squares, points, |square| LightPoint::At(corner + edge_u * square.x + edge_v * square.y));
            }
            Shape::Disk { center, axis_u, axis_v } => map(squares, points, |square| {
                let (disk, _) = concentric(square);
                LightPoint::At(center + axis_u * disk.x + axis_v * disk.y)
            }),
            Shape::Cap { center, axis_u, axis_v, axis_w, sin, cos, height } => {
                // At the receiver a direction's angle t from the axis has cos t = 1 − u·height with u uniform, and
                // sin t = sin·s. The nearer hit lies at the centre's angle a from the axis,
                // cos a = sin·s² + cos t·√(1 − s²) and sin a = s·(cos t − sin·√(1 − s²)); below, every
                // difference of near-equal numbers is multiplied out, so that neither far nor near
                // receivers lose digits.
                let inverse = 1.0 / (1.0 + cos);
                map(squares, points, |square| {
                    let (disk, u) = concentric(square);
                    let lower = u * height;
                    let cos_t = 1.0 - lower;
                    let stretch_squared = (2.0 - lower) * inverse;
                    let root = ((1.0 - u) * (1.0 - lower * inverse)).sqrt();
                    let lateral = stretch_squared.sqrt() * (cos * cos) / (cos_t + sin * root);
                    let along = sin * u * stretch_squared + cos_t * root;
                    let side = axis_u * disk.x + axis_v * disk.y;
                    LightPoint::At(center + side * lateral + axis_w * along)
                });
            }
            Shape::Inside { center, axis_u, axis_v, axis_w, offset } => map(squares, points, |square| {
                let (disk, u) = concentric(square);
                let cos_t = 1.0 - 2.0 * u;
                let lateral = 2.0 * (1.0 - u).sqrt();
                let sin_squared = 4.0 * u * (1.0 - u);
                let distance = (1.0 - offset * offset * sin_squared).max(0.0).sqrt() - offset * cos_t;
                let side = (axis_u * disk.x + axis_v * disk.y) * lateral;
                LightPoint::At(center + side * distance + axis_w * (cos_t * distance + offset))
            }),
            Shape::Cone { axis_u, axis_v, axis_w, height } => map(squares, points, |square| {
                let (disk, u) = concentric(square);
                let lateral = (height * (2.0 - u * height)).sqrt();
                let direction = axis_w * (1.0 - u * height) + (axis_u * disk.x + axis_v * disk.y) * lateral;
                // Of unit length but for rounding: a Newton step for 1/√ does what is left.
                LightPoint::Towards(direction * (1.5 - 0.5 * direction.length_squared()))
            }),
        }
    }

    /// Whether the light is one point or direction, so that one sample says all.
    pub fn is_single(&self) -> bool {
        matches!(self.0, Shape::Single(_))
    }

    /// Width over height of what the unit square is mapped onto: 1 but for a rect.
    pub fn aspect(&self) -> f32 {
        match self.0 {
            Shape::Parallelogram { edge_u, edge_v, .. } => edge_u.length() / edge_v.length(),
            _ => 1.0,
        }
    }
}

#[inline]
fn map(squares: &[Vec2], points: &mut [LightPoint], point: impl Fn(Vec2) -> LightPoint) {
    for (square, into) in squares.iter().zip(points) {
        *into = point(*square);
    }
}

/// The view of a sphere: its near cap from outside, all of its wall from inside.
fn sphere(center: Vec3, radius: f32, receiver: Vec3) -> Shape {
    let r = f64::from(radius);
    let to_receiver = receiver.as_dvec3() - center.as_dvec3();
    let distance = to_receiver.length();
    let axis_w = to_receiver.normalize_or(DVec3::Y);
    let (axis_u, axis_v) = axis_w.any_orthonormal_pair();
    let [axis_u, axis_v, axis_w] = [axis_u, axis_v, axis_w].map(|axis| (axis * r).as_vec3());
    if distance > r {
        let sin = (r / distance) as f32;
        let cos = ((distance - r) * (distance + r)).sqrt() / distance;
        let height = (r / distance).powi(2) / (1.0 + cos);
        Shape::Cap { center, axis_u, axis_v, axis_w, sin, cos: cos as f32, height: height as f32 }
    } else {
        Shape::Inside { center, axis_u, axis_v, axis_w, offset: (distance / r) as f32 }
    }
}

/// Shirley and Chiu's map of the unit square onto the unit disk: equal areas stay equal, and nested squares
/// become nested circles. Also the square of the distance from the middle, uniform in [0, 1].
#[inline]
fn concentric(square: Vec2) -> (Vec2, f32) {
    let p = 2.0 * square - 1.0;
    let x_leads = p.x.abs() > p.y.abs();
    let (radius, other) = if x_leads { (p.x, p.y) } else { (p.y, p.x) };
    // Nothing is divided by zero in the middle, and without a branch.
    let ratio = other / if radius == 0.0 { 1.0 } else { radius };
    let (sin, cos) = sin_cos_eighth(std::f32::consts::FRAC_PI_4 * ratio);
    let (along, across) = (radius * cos, radius * sin);
    let disk = if x_leads { Vec2::new(along, across) } else { Vec2::new(across, along) };
    (disk, radius * radius)
}

/// Sine and cosine of an angle in [−π/4, π/4] by Taylor series. The first terms left out, x¹¹/11! and x¹⁰/10!,
/// are below 2·10⁻⁹ and 3·10⁻⁸ there, within the rounding of f32; unlike the system's functions they give the
/// same bits everywhere.
#[inline]
fn sin_cos_eighth(x: f32) -> (f32, f32) {
    let s = x * x;
    let sin = 1.0
        - s * (1.0 / 6.0) * (1.0 - s * (1.0 / 20.0) * (1.0 - s * (1.0 / 42.0) * (1.0 - s * (1.0 / 72.0))));
    let cos = 1.0 - s * 0.5 * (1.0 - s * (1.0 / 12.0) * (1.0 - s * (1.0 / 30.0) * (1.0 - s * (1.0 / 56.0))));
    (x * sin, cos)
}

#[cfg(test)]
mod tests;
