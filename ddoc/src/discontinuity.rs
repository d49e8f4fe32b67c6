//! Step 2, the depth discontinuity map: one bit a texel, and between which neighbours the map has a gap.
//!
//! Two texels next to each other show one surface if the way from one to the other needs no more depth than the two
//! surfaces have slope: with d₁ and d₂ what each stored triangle's plane rises along the light from its own texel's centre
//! to the other's, a surface made of the two, and of what lies between them at no steeper slope, changes its distance by
//! at most |d₁| + |d₂|. A gap beyond that is a discontinuity; the nearer texel's bit is set. A triangle seen edge-on has
//! no bound and never makes a gap. No constant is chosen; what is added is the rounding of stored points.

use glam::{Vec2, Vec3};
use rayon::prelude::*;
use scene_core::Scene;
use scene_core::light::LightPoint;

use crate::layers::Layers;
use crate::light_image::LightImage;
use crate::silhouettes::plane;

/// What a texel's centre shows first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surface {
    /// The point, world space.
    pub point: Vec3,
    /// Its reversed depth.
    pub depth: f32,
    /// Distance along the view's axis.
    pub along: f32,
    /// The triangle.
    pub triangle: u32,
}

/// The nearest surfaces of a map, as its discontinuities see them.
#[derive(Debug)]
pub struct Discontinuities<'l> {
    layers: &'l Layers,
    scene: &'l Scene,
    center: LightPoint,
    tolerance: f32,
}

impl<'l> Discontinuities<'l> {
    /// Of a map whose stored points are good to `tolerance` scene units.
    pub fn new(scene: &'l Scene, layers: &'l Layers, center: LightPoint, tolerance: f32) -> Self {
        Self { layers, scene, center, tolerance }
    }

    /// The image of the map.
    pub fn image(&self) -> &LightImage {
        &self.layers.image
    }

    /// The light's centre.
    pub fn center(&self) -> LightPoint {
        self.center
    }

    /// What a texel shows; `None` beside the map and where there is nothing.
    pub fn surface(&self, [column, row]: [i32; 2]) -> Option<Surface> {
        let first = self.layers.fragments.of(column as u32, row as u32).first()?;
        if first.depth <= 0.0 {
            return None;
        }
        let image = &self.layers.image;
        let middle = Vec2::new(column as f32 + 0.5, row as f32 + 0.5) * (2.0 / image.size as f32);
        let point = image.view.unproject(Vec2::new(middle.x - 1.0, 1.0 - middle.y), first.depth);
        let (depth, triangle) = (first.depth, first.triangle);
        Some(Surface { point, depth, along: image.along(point), triangle })
    }

    /// What the plane of `surface` rises along the light from its own centre to that of the texel where `other` is seen.
    fn rise(&self, surface: &Surface, other: &Surface) -> f32 {
        let plane = plane(self.scene.corners(surface.triangle as usize), surface.point).truncate();
        let (direction, _) = self.center.ray_from(other.point);
        let slope = plane.dot(direction);
        let way = plane.dot(surface.point - other.point) / slope;
        let met = other.point + direction * way;
        let rise = (self.layers.image.along(met) - surface.along).abs();
        if rise.is_finite() { rise } else { f32::INFINITY }
    }

    /// Whether there is a gap between two texels next to each other, the first the nearer.
    pub fn is_gap(&self, near: &Surface, far: Option<&Surface>) -> bool {
        let Some(far) = far else { return true };
        let gap = far.along - near.along;
        // The rounding of a point, as a distance along the axis.
        let (direction, _) = self.center.ray_from(near.point);
        let rate = self.layers.image.along_direction(direction.normalize_or_zero()).abs();
        gap > self.rise(near, far) + self.rise(far, near) + 2.0 * self.tolerance * rate
    }

    /// Whether a texel is on the near side of a discontinuity: its bit.
    pub fn bit(&self, texel: [i32; 2]) -> bool {
        let Some(near) = self.surface(texel) else { return false };
        let [column, row] = texel;
        [[column + 1, row], [column, row + 1], [column - 1, row], [column, row - 1]]
            .into_iter()
            .any(|beside| self.is_gap(&near, self.surface(beside).as_ref()))
    }

    /// The map, row by row.
    pub fn bits(&self) -> Vec<bool> {
        let size = self.layers.image.size as i32;
        let texels = (0..size * size).into_par_iter();
        texels.map(|texel| self.bit([texel % size, texel / size])).collect()
    }
}
