//! Points that stand for an extended light, and what share of it each is to a receiver.
//!
//! Maps are drawn from points that all receivers have in common. Of a `rect`, a `disk` and a sun such points are equal
//! shares of V for everyone. Of a `sphere` they are not: V is the fraction of the sphere's solid angle, and every
//! receiver sees another cap of it. There a point of the surface with the normal n counts by the solid angle that its
//! surroundings fill, max(0, n·d)/|d|² for the vector d to the receiver up to a unit factor; the sum over all points
//! divides it.

use glam::{DVec3, Vec2, Vec3};
use scene_core::Light;
use scene_core::geometry::Aabb;
use scene_core::light::LightPoint;
use scene_core::light::sampling::{LightView, SampleKey, low_discrepancy, sobol};

/// `count` points of `light` (one of a light without extent), well spread for any prefix, the same for the same `seed`.
/// Of a sphere only points that someone within `receivers` may see.
pub fn light_points(light: &Light, receivers: Aabb, count: u32, seed: u32) -> Vec<LightPoint> {
    let key = SampleKey::new(u64::from(seed), 0);
    if !light.is_extended() {
        return vec![light.center()];
    }
    let Light::Sphere { center, radius } = *light else {
        let mut points = vec![light.center(); count.max(1) as usize];
        low_discrepancy(&LightView::new(light, receivers.center()), key, &mut points);
        return points;
    };
    let (axis, cos) = seen_cap(center, radius, receivers);
    let (x, y) = axis.any_orthonormal_pair();
    (0..count.max(1))
        .map(|index| {
            let Vec2 { x: u, y: v } = sobol(index, key);
            // Archimedes: the height on a sphere is uniform.
            let height = 1.0 - f64::from(u) * (1.0 - cos);
            let (sin, cos) = (f64::from(v) * std::f64::consts::TAU).sin_cos();
            let normal = (x * cos + y * sin) * (1.0 - height * height).max(0.0).sqrt() + axis * height;
            LightPoint::At((center.as_dvec3() + normal * f64::from(radius)).as_vec3())
        })
        .collect()
}

/// The cap of a sphere outside of which nobody within `receivers` sees it: its axis and the cosine of its angle. All
/// of it, if a receiver may be inside.
fn seen_cap(center: Vec3, radius: f32, receivers: Aabb) -> (DVec3, f64) {
    let (center, radius) = (center.as_dvec3(), f64::from(radius));
    let corners = receivers.corners().map(|corner| corner.as_dvec3() - center);
    let axis = (receivers.center().as_dvec3() - center).normalize_or(DVec3::NEG_Y);
    // Directions to a convex box that does not hold the centre are within the widest corner's angle.
    let cos = corners.iter().map(|c| c.normalize_or(-axis).dot(axis)).fold(1.0, f64::min);
    let beside = corners.iter().all(|c| c.dot(axis) > radius);
    // A receiver sees less than the half of the sphere that faces it.
    let angle = if beside { cos.acos() + std::f64::consts::FRAC_PI_2 } else { std::f64::consts::PI };
    (axis, angle.min(std::f64::consts::PI).cos())
}

/// What `point` counts at `receiver`, before it is divided by the sum over all points: 1 but for a sphere.
#[inline]
pub fn weight(light: &Light, point: LightPoint, receiver: Vec3) -> f32 {
    let (Light::Sphere { center, radius }, LightPoint::At(place)) = (light, point) else { return 1.0 };
    let to_receiver = receiver - place;
    let normal = (place - *center) / *radius;
    // n·d/|d|³: the cosine over the squared distance.
    let length = to_receiver.length();
    (normal.dot(to_receiver) * radius * radius / (length * length * length)).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    const BOX: Aabb = Aabb { min: Vec3::new(-2.0, 0.0, -2.0), max: Vec3::new(2.0, 1.0, 2.0) };

    #[test]
    fn points_lie_on_the_light_and_one_is_enough_without_extent() {
        let sphere = Light::Sphere { center: Vec3::new(0.0, 4.0, 1.0), radius: 0.5 };
        for point in light_points(&sphere, BOX, 64, 3) {
            let LightPoint::At(place) = point else { panic!("a sphere has places") };
            assert!((place.distance(Vec3::new(0.0, 4.0, 1.0)) - 0.5).abs() < 1e-6);
        }
        let point = Light::Point { position: Vec3::Y };
        assert_eq!(light_points(&point, BOX, 64, 3), [LightPoint::At(Vec3::Y)]);
        let rect = Light::Rect { center: Vec3::Y, half_u: Vec3::X, half_v: Vec3::Z };
        let (few, many) = (light_points(&rect, BOX, 8, 1), light_points(&rect, BOX, 64, 1));
        assert_eq!(few[..], many[..8]);
        assert_ne!(few, light_points(&rect, BOX, 8, 2));
    }

    /// The half of a sphere on one side of a plane through the receiver and its middle is half of its solid angle, and
    /// the weighed points say so; half of the area's share it is only by symmetry, so the nearer half is asked too:
    /// the cap within 30° of the axis as the receiver sees it, in closed form (1 − cos a)/(1 − cos b).
    #[test]
    fn weights_make_solid_angles() {
        let (center, radius, receiver) = (Vec3::new(0.0, 4.0, 1.0), 1.5, Vec3::new(0.5, 0.5, 0.0));
        let light = Light::Sphere { center, radius };
        let points = light_points(&light, BOX, 4096, 5);
        let axis = (center - receiver).normalize();
        let widest = (radius / center.distance(receiver)).asin();
        let (mut all, mut within) = (0.0, 0.0);
        let cap = 0.5 * widest;
        for point in points {
            let LightPoint::At(place) = point else { panic!("a sphere has places") };
            let w = f64::from(weight(&light, point, receiver));
            all += w;
            if (place - receiver).normalize().dot(axis) > cap.cos() {
                within += w;
            }
        }
        let expected = f64::from((1.0 - cap.cos()) / (1.0 - widest.cos()));
        // 4096 points of a (0, 2)-sequence: a smooth border cuts about √4096 cells, each off by half a point.
        assert!((within / all - expected).abs() < 0.5 / 64.0, "{} for {expected}", within / all);
    }
}
