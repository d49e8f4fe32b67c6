//! Receivers: which pixels' visibility is a question, and from where.

use glam::{DVec3, Vec3};
use scene_core::bvh::shadow_origin;
use scene_core::light::LightPoint;
use scene_core::{GBuffer, Scene};

use crate::area_light::AreaLight;

/// A point that the light's visibility is asked for.
#[derive(Clone, Copy, Debug)]
pub struct Receiver {
    /// Where shadow rays start.
    pub origin: Vec3,
    /// The surface's position and unit normal; `None` for a free point.
    pub surface: Option<[Vec3; 2]>,
    /// Whether all of the light is above the surface.
    pub sees_all: bool,
    /// Which pattern of samples it takes.
    pub pattern: usize,
}

/// What is known of a pixel.
#[derive(Clone, Copy, Debug)]
pub enum Asked {
    /// V is certain, or nothing is seen (NaN).
    Known(f32),
    /// All of the light is below the surface.
    Dark,
    /// It depends on the casters.
    Yes(Receiver),
}

impl Receiver {
    /// A free point.
    pub fn free(point: Vec3, pattern: usize) -> Self {
        Self { origin: point, surface: None, sees_all: true, pattern }
    }

    /// The receiver at a pixel.
    #[inline]
    pub fn at(scene: &Scene, gbuffer: &GBuffer, light: &AreaLight, magnitude: f32, pixel: usize) -> Asked {
        if !gbuffer.is_seen(pixel) {
            return Asked::Known(f32::NAN);
        }
        if !scene.objects()[gbuffer.object[pixel] as usize].flags.receives {
            return Asked::Known(1.0);
        }
        let (position, normal) = (gbuffer.position[pixel], gbuffer.normal[pixel]);
        let origin = shadow_origin(position, normal, magnitude);
        // Where rays see no shadow there is none to be counted.
        if !origin.is_finite() {
            return Asked::Known(1.0);
        }
        let n = normal.as_dvec3();
        let (height, reach) = (n.dot(light.from_point(position.as_dvec3())), light.reach(n));
        if height + reach <= 0.0 {
            return Asked::Dark;
        }
        let width = gbuffer.width as usize;
        let pattern = pixel / width % 8 * 8 + pixel % width % 8;
        // Samples are rounded to f32, and so are their heights over the surface.
        let rounding = 8.0 * f64::from(f32::EPSILON) * f64::from(magnitude.max(position.abs().max_element()));
        let sees_all = height - reach > rounding;
        Asked::Yes(Self { origin, surface: Some([position, normal]), sees_all, pattern })
    }

    /// The place in f64.
    #[inline]
    pub fn place(&self) -> DVec3 {
        self.origin.as_dvec3()
    }

    /// Whether a point of the light is above the surface.
    #[inline]
    pub fn is_above(&self, point: LightPoint) -> bool {
        self.surface.is_none_or(|[position, normal]| match point {
            LightPoint::At(place) => normal.dot(place - position) > 0.0,
            LightPoint::Towards(direction) => normal.dot(direction) > 0.0,
        })
    }
}
