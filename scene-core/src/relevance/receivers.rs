//! Where the surfaces are that anyone asks visibility of: a convex polyhedron around what is seen.

use glam::{DVec3, Vec3};

use super::close_bounds::CloseBounds;
use super::extent::{LightExtent, reach_of};
use super::polyhedron::side_of_all;
use super::{CasterChunks, HalfSpace, Polyhedron, Side, depth_slice, pyramid};
use crate::geometry::Aabb;
use crate::light::LightPoint;
use crate::{Camera, Light, Scene};

/// What a seen position may be off, as a share of the largest coordinate in play: 2⁻¹⁸.
///
/// With u = 2⁻²⁴ and M the largest absolute coordinate of scene, camera and light: a G-buffer position is
/// eye + t·direction, off by 6 u of a length of at most 2√3 M and an ulp of the sum, below 23 u M; a shadow
/// ray is lifted by 8 u M ([`crate::bvh::shadow_origin`]); sampled points of a light are off by less than 4 u M.
/// The sum is below 35 u M; 2⁻¹⁸ is 64 u.
const MARGIN: f64 = 1.0 / 262_144.0;

/// A convex polyhedron that holds all receivers that matter: the view's volume cut with the receivers' bounds,
/// or given boxes; and with a spot's cone, outside of which nothing is asked.
#[derive(Clone, Debug)]
pub struct Receivers {
    pub(super) region: Polyhedron,
    pub(super) margin: f64,
}

impl Receivers {
    /// What `camera` can see of the objects that receive shadows. An invalid camera sees everything.
    pub fn seen_by(scene: &Scene, camera: &Camera, light: &Light) -> Self {
        let margin = margin(scene.bounds(), camera.eye, light);
        let planes: Vec<_> = frustum(camera).into_iter().map(|plane| plane.grown(margin)).collect();
        let wider: Vec<_> = planes.iter().map(|plane| plane.grown(margin)).collect();
        let bounds = scene
            .objects()
            .iter()
            .filter(|o| o.flags.receives && side_of_all(&wider, &o.bounds) != Side::Outside)
            .fold(Aabb::EMPTY, |sum, o| sum.union(o.bounds));
        let mut region = Polyhedron::from_box(bounds, margin);
        planes.into_iter().for_each(|plane| region.clip(plane));
        Self::reached(region, light, margin)
    }

    /// As [`seen_by`](Self::seen_by), closer: of objects across the view's border only triangles that are not wholly outside of it
    /// count, so that a ground that rises far away is as flat as it is where it is seen. An object of more than [`MOST_TRIANGLES`](super::MOST_TRIANGLES)
    /// counts as a whole, and so does what could make the box around all receivers larger by no more than a [`LITTLE`](super::LITTLE) of what is
    /// in view. `chunks` must be of the same scene; objects it does not know are gone through without.
    pub fn seen_closely_by(scene: &Scene, camera: &Camera, light: &Light, chunks: &CasterChunks) -> Self {
        let margin = margin(scene.bounds(), camera.eye, light);
        let planes: Vec<_> = frustum(camera).into_iter().map(|plane| plane.grown(margin)).collect();
        let bounds = CloseBounds::around(scene, &planes, margin, chunks);
        let mut region = Polyhedron::from_box(bounds, margin);
        planes.into_iter().for_each(|plane| region.clip(plane));
        Self::reached(region, light, margin)
    }

    /// Receivers inside of `boxes`: bounds of seen positions, of an image or of its tiles
    /// ([`super::TileBounds`]). They are held by the box around all of them with its edges and corners cut where
    /// no box reaches.
    pub fn within(scene: &Scene, boxes: &[Aabb], light: &Light) -> Self {
        let bounds = boxes.iter().fold(Aabb::EMPTY, |sum, b| sum.union(*b));
        let margin = margin(scene.bounds().union(bounds), Vec3::ZERO, light);
        let mut region = Polyhedron::from_box(bounds, margin);
        if boxes.len() > 1 {
            for normal in slanted() {
                let reach =
                    |b: &Aabb| (normal * b.min.as_dvec3()).max(normal * b.max.as_dvec3()).element_sum();
                let boxes = boxes.iter().filter(|b| !b.is_empty());
                let offset = boxes.map(reach).fold(f64::NEG_INFINITY, f64::max);
                region.clip(HalfSpace { normal, offset: offset + margin });
            }
        }
        Self::reached(region, light, margin)
    }

    fn reached(mut region: Polyhedron, light: &Light, margin: f64) -> Self {
        reach_of(light).into_iter().for_each(|plane| region.clip(plane.grown(margin)));
        Self { region, margin }
    }

    /// Those of the receivers inside a volume: a cascade's ([`depth_slice`](super::depth_slice)), a cube face's or
    /// any other map's ([`pyramid`](super::pyramid)), or half-spaces of the caller's own. What lies on a border
    /// belongs to both sides, and so does what rounding could put there.
    ///
    /// A half-space that is not finite leaves everything in.
    #[must_use]
    pub fn inside(mut self, volume: &[HalfSpace]) -> Self {
        volume.iter().for_each(|plane| self.region.clip(plane.grown(self.margin)));
        self
    }

    /// Whether a receiver inside `bounds` may be one of these. Never false for one that is.
    pub fn touches(&self, bounds: &Aabb) -> bool {
        self.region.intersects(bounds)
    }

    /// Whether nothing is seen that could be in shadow.
    pub fn is_empty(&self) -> bool {
        self.region.is_empty()
    }

    /// The polyhedron.
    pub fn region(&self) -> &Polyhedron {
        &self.region
    }

    /// The largest distance of a receiver from `point`, in scene units; 0 if there is none.
    pub fn farthest_from(&self, point: Vec3) -> f64 {
        self.region.vertices().map(|v| v.distance(point.as_dvec3())).fold(0.0, f64::max)
    }

    /// The receivers with everything within `distance` of them: what a texel of that size stands for.
    #[must_use]
    pub fn grown(&self, distance: f64) -> Self {
        Self { region: self.region.grown(distance), margin: self.margin }
    }
}

/// See [`MARGIN`].
fn margin(bounds: Aabb, eye: Vec3, light: &Light) -> f64 {
    let light = match light.center() {
        LightPoint::At(_) => LightExtent::of(light).magnitude(),
        LightPoint::Towards(_) => 0.0,
    };
    let largest = f64::from(bounds.magnitude()).max(f64::from(eye.abs().max_element())).max(light);
    largest * MARGIN
}

/// The half-spaces of a camera's view, near and far included; none for a camera that is not finite.
fn frustum(camera: &Camera) -> Vec<HalfSpace> {
    let tan = camera.tan_half_fov();
    let mut planes = pyramid(camera.eye, camera.world_from_view_rotation(), -tan, tan);
    planes.extend(depth_slice(camera, camera.near, camera.far));
    planes
}

/// Unit normals through the edges and corners of a cube: with its faces, the 26 directions of a k-DOP.
fn slanted() -> impl Iterator<Item = DVec3> {
    (0..27).filter_map(|i| {
        let v = DVec3::new(f64::from(i % 3 - 1), f64::from(i / 3 % 3 - 1), f64::from(i / 9 - 1));
        (v.abs().element_sum() > 1.0).then(|| v.normalize())
    })
}

/// The ids of the objects that have a part among `receivers`: in a cascade, say, or in a face of a cube. The others need
/// not be asked about there.
pub fn objects_among(scene: &Scene, receivers: &Receivers) -> Vec<u32> {
    let objects = (0..).zip(scene.objects());
    objects.filter(|(_, o)| o.flags.receives && receivers.touches(&o.bounds)).map(|(id, _)| id).collect()
}

/// The ids of the objects that receive shadows and that `light` may reach: all of them but those outside the cone
/// of a spot, which have V = 0 everywhere.
pub fn reached_receivers(scene: &Scene, light: &Light) -> Vec<u32> {
    let margin = margin(scene.bounds(), Vec3::ZERO, light);
    let planes: Vec<_> = reach_of(light).into_iter().map(|plane| plane.grown(margin)).collect();
    let reached = |bounds: &Aabb| side_of_all(&planes, bounds) != Side::Outside;
    let objects = (0..).zip(scene.objects());
    objects.filter(|(_, o)| o.flags.receives && reached(&o.bounds)).map(|(id, _)| id).collect()
}
