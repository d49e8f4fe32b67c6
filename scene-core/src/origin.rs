//! Coordinates counted from a place in the scene, for scenes that lie far from zero.
//!
//! An f32 near 10,000 has steps of a millimetre, and what is computed from such coordinates is off by many of them: a matrix
//! product by a dozen. Counted from a place among them the same coordinates are as exact as near zero. They lose nothing
//! on the way: the difference of two floats, neither of which is more than twice the other, is exact (Sterbenz 1974), and
//! an axis is only moved where that holds for every coordinate of the scene.
//!
//! What remains are the steps that coordinates were given with. A [`GBuffer`]'s positions are rounded to them, too, and so lie off
//! their surfaces: [`Origin::gbuffer`] lifts them above.

use std::borrow::Cow;

use glam::Vec3;

use crate::bvh::{LIFT, shadow_origin};
use crate::geometry::Aabb;
use crate::{Camera, GBuffer, Light, Scene};

/// Where coordinates are counted from.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Origin {
    /// In world space.
    place: Vec3,
    /// The scene's largest coordinate in world space; 0 where nothing moves.
    magnitude: f32,
}

impl Origin {
    /// Zero: coordinates stay as they are.
    pub const WORLD: Self = Self { place: Vec3::ZERO, magnitude: 0.0 };

    /// The middle of a scene's bounds if it lies more than twice their diagonal away; nearer, nothing is gained.
    pub fn near(bounds: Aabb) -> Self {
        if bounds.is_empty() || bounds.magnitude() <= 2.0 * bounds.diagonal() {
            return Self::WORLD;
        }
        let middle = |axis: usize| {
            let (min, max) = (bounds.min[axis], bounds.max[axis]);
            let (inner, outer) = (min.abs().min(max.abs()), min.abs().max(max.abs()));
            let exact = min * max > 0.0 && 0.5 * outer <= inner;
            if exact { 0.5 * min + 0.5 * max } else { 0.0 }
        };
        Self { place: Vec3::new(middle(0), middle(1), middle(2)), magnitude: bounds.magnitude() }
    }

    /// Whether coordinates stay as they are.
    pub fn is_world(self) -> bool {
        self.place == Vec3::ZERO
    }

    /// A point of the world.
    #[inline]
    pub fn point(self, point: Vec3) -> Vec3 {
        point - self.place
    }

    /// Points of the world, copied only if they move.
    pub fn points(self, points: &[Vec3]) -> Cow<'_, [Vec3]> {
        if self.is_world() {
            return Cow::Borrowed(points);
        }
        Cow::Owned(points.iter().map(|&point| self.point(point)).collect())
    }

    /// A scene, copied only if it moves.
    pub fn scene(self, scene: &Scene) -> Cow<'_, Scene> {
        if self.is_world() { Cow::Borrowed(scene) } else { Cow::Owned(scene.counted_from(self.place)) }
    }

    /// A light.
    #[must_use]
    pub fn light(self, light: &Light) -> Light {
        let mut light = *light;
        match &mut light {
            Light::Directional { .. } => {}
            Light::Point { position: place }
            | Light::Spot { position: place, .. }
            | Light::Sphere { center: place, .. }
            | Light::Rect { center: place, .. }
            | Light::Disk { center: place, .. } => *place -= self.place,
        }
        light
    }

    /// A camera.
    #[must_use]
    pub fn camera(self, camera: &Camera) -> Camera {
        Camera { eye: camera.eye - self.place, target: camera.target - self.place, ..*camera }
    }

    /// A G-buffer, copied only if it moves. Positions are lifted off their surfaces by
    /// what rounding may have put them below: to where [shadow rays start](shadow_origin), the ground truth's as well.
    pub fn gbuffer(self, gbuffer: &GBuffer) -> Cow<'_, GBuffer> {
        if self.is_world() {
            return Cow::Borrowed(gbuffer);
        }
        let mut moved = gbuffer.clone();
        for (position, &normal) in moved.position.iter_mut().zip(&gbuffer.normal) {
            *position = self.point(shadow_origin(*position, normal, self.magnitude));
        }
        Cow::Owned(moved)
    }

    /// By how much positions are lifted off their surfaces, in scene units: as [shadow rays](shadow_origin) are that start
    /// within the scene; 0 where nothing moves.
    pub fn lift(self) -> f32 {
        self.magnitude * LIFT
    }

    /// A G-buffer counted from here, in world space again.
    #[must_use]
    pub fn back(self, mut gbuffer: GBuffer) -> GBuffer {
        if !self.is_world() {
            gbuffer.position.iter_mut().for_each(|position| *position += self.place);
        }
        gbuffer
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{raster, scenes};

    #[test]
    fn what_is_near_stays() {
        let setup = scenes::build("ball", 0.0).unwrap();
        assert_eq!(Origin::near(setup.scene.bounds()), Origin::WORLD);
        assert_eq!(Origin::near(Aabb::EMPTY), Origin::WORLD);
        assert!(matches!(Origin::WORLD.scene(&setup.scene), Cow::Borrowed(_)));
    }

    /// Vertices move without any rounding, and no position is left below its triangle.
    #[test]
    fn what_is_far_moves_exactly() {
        let near = scenes::build("ball", 0.0).unwrap();
        let offset = Vec3::new(30_000.0, -20_000.0, 10_000.0);
        let scene = near.scene.counted_from(-offset);
        let (eye, target) = (near.camera.eye + offset, near.camera.target + offset);
        let camera = Camera { eye, target, ..near.camera.with_size(64, 48) };
        let origin = Origin::near(scene.bounds());
        let moved = origin.scene(&scene);
        assert!(!origin.is_world() && moved.bounds().magnitude() <= scene.bounds().diagonal());
        for (&world, &local) in scene.positions().iter().zip(moved.positions()) {
            assert_eq!(world.as_dvec3() - origin.place.as_dvec3(), local.as_dvec3());
        }
        let gbuffer = raster::render_gbuffer(&scene, &camera);
        let lowest = |position: &dyn Fn(usize) -> Vec3| {
            let seen = (0..gbuffer.pixel_count()).filter(|&pixel| gbuffer.is_seen(pixel));
            let height = |pixel: usize| {
                let [corner, _, _] = moved.corners(gbuffer.triangle[pixel] as usize);
                let from_corner = position(pixel).as_dvec3() - corner.as_dvec3();
                gbuffer.normal[pixel].as_dvec3().dot(from_corner)
            };
            seen.map(height).fold(f64::INFINITY, f64::min)
        };
        let local = origin.gbuffer(&gbuffer);
        assert!(lowest(&|pixel| origin.point(gbuffer.position[pixel])) < -1e-4);
        assert!(lowest(&|pixel| local.position[pixel]) > 0.0);
    }
}
