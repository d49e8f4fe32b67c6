//! The box around the receivers in view, looked at triangle by triangle where that makes it much smaller.

use std::ops::Range;

use glam::Vec3;

use super::casters::{CHUNK, parts_of};
use super::polyhedron::side_of_all;
use super::{CasterChunks, HalfSpace, Polyhedron, Side};
use crate::Scene;
use crate::geometry::{Aabb, Object};

/// Triangles of an object that are asked one by one, at most, by [`Receivers::seen_closely_by`](super::Receivers::seen_closely_by): some 0.3 ms.
pub const MOST_TRIANGLES: usize = 16_384;

/// The share of what is in view, along each axis, that is not worth a closer look.
pub const LITTLE: f32 = 1.0 / 16.0;

/// Triangles that mostly lie side by side, in an object's order.
const NEIGHBOURS: usize = 16;

/// The box while it is gathered.
pub(super) struct CloseBounds<'s> {
    scene: &'s Scene,
    /// The view's volume.
    planes: &'s [HalfSpace],
    margin: f64,
    /// The same, moved out by the margin: what is told outside of these is not seen.
    wider: Vec<HalfSpace>,
    /// Around all that can be in view.
    view: Aabb,
    /// Around what was looked at closely, or lies inside of the view.
    close: Aabb,
    /// Around what was taken as a whole, being in that box or little beside it.
    beside: Aabb,
}

impl<'s> CloseBounds<'s> {
    /// Of the receivers of `scene` within `planes`.
    pub(super) fn around(
        scene: &'s Scene,
        planes: &'s [HalfSpace],
        margin: f64,
        chunks: &CasterChunks,
    ) -> Aabb {
        let wider: Vec<_> = planes.iter().map(|plane| plane.grown(margin)).collect();
        let sides = chunks.sides(scene, &wider);
        let view = part_within(scene.bounds(), margin, planes);
        let mut bounds = Self { scene, planes, margin, wider, view, close: Aabb::EMPTY, beside: Aabb::EMPTY };
        let mut across = Vec::new();
        let objects = scene.objects().iter().enumerate().zip(sides);
        for ((id, object), side) in objects.filter(|((_, object), _)| object.flags.receives) {
            match side {
                Side::Outside => {}
                Side::Across if object.triangles.len() <= MOST_TRIANGLES => across.push((id, object)),
                Side::Across | Side::Inside => bounds.close = bounds.close.union(object.bounds),
            }
        }
        across.into_iter().for_each(|(id, object)| bounds.look_at(object, chunks.runs_of(id, object)));
        bounds.close.union(bounds.beside)
    }

    /// Adds what of an object across the view's border is not wholly outside of it.
    fn look_at(&mut self, object: &Object, runs: impl Iterator<Item = (Range<usize>, Aabb)>) {
        if self.takes(object.bounds) {
            return;
        }
        // Far smaller than the box where the border is slanted; to find it takes some microseconds.
        let is_large = object.triangles.len() > CHUNK;
        let part =
            if is_large { part_within(object.bounds, self.margin, self.planes) } else { object.bounds };
        let mut crossed = self.wider.clone();
        crossed.retain(|plane| plane.side_of(&object.bounds) != Side::Inside);
        let is_outside = |bounds: &Aabb| side_of_all(&crossed, bounds) == Side::Outside;
        let scene = self.scene;
        for (run, bounds) in runs {
            if self.takes(bounds.intersection(part)) || is_outside(&bounds) {
                continue;
            }
            for few in parts_of(run, NEIGHBOURS) {
                let corners = few.map(|triangle| scene.corners(triangle));
                let bounds = Aabb::from_points(corners.clone().flatten());
                if self.takes(bounds.intersection(part)) || is_outside(&bounds) {
                    continue;
                }
                let beyond = |plane: &HalfSpace, corners: &[Vec3; 3]| {
                    corners.iter().all(|corner| plane.height(corner.as_dvec3()) > 0.0)
                };
                let seen = corners.filter(|corners| !crossed.iter().any(|plane| beyond(plane, corners)));
                self.close = seen.flatten().fold(self.close, Aabb::with_point);
            }
        }
    }

    /// Takes what of `part` is in view as a whole, if it adds little.
    fn takes(&mut self, part: Aabb) -> bool {
        let (part, little) = (part.intersection(self.view), LITTLE * self.view.size());
        let near = Aabb { min: self.close.min - little, max: self.close.max + little };
        let takes = near.holds(&part);
        if takes && !part.is_empty() {
            self.beside = self.beside.union(part);
        }
        takes
    }
}

/// The box around what of `bounds`, grown by `margin`, lies within `planes`.
fn part_within(bounds: Aabb, margin: f64, planes: &[HalfSpace]) -> Aabb {
    let mut part = Polyhedron::from_box(bounds, margin);
    planes.iter().for_each(|&plane| part.clip(plane));
    part.bounds()
}
