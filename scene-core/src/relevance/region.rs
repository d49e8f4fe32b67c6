//! H = M ∩ S ∩ L: where a caster can stand that shadows what is seen.
//!
//! After Stamminger and Drettakis, *Perspective shadow maps* (2002), section 4: M is the convex hull of the
//! receivers that matter and the light, S the casters' bounds, L what the light reaches.
//! Every segment from a receiver to a point of the light lies in M. Differences: M starts from the receivers in
//! view instead of all of the view's volume, and the light may have an extent.

use std::iter;

use glam::DVec3;

use super::extent::LightExtent;
use super::polyhedron::side_of_all;
use super::{HalfSpace, Polyhedron, Receivers, Side};
use crate::geometry::Aabb;
use crate::light::LightPoint;
use crate::{Camera, Light, Scene};

/// The region in which casters matter, as half-spaces.
///
/// It holds every point of H; it may hold a little more: hulls around a sphere, a disk or the cone of a sun are cut
/// by finitely many planes.
#[derive(Clone, Debug)]
pub struct CasterRegion {
    planes: Vec<HalfSpace>,
    hull: Polyhedron,
}

impl CasterRegion {
    /// H of what `camera` can see.
    pub fn of(scene: &Scene, camera: &Camera, light: &Light) -> Self {
        Self::between(scene, &Receivers::seen_by(scene, camera, light), light)
    }

    /// H of receivers inside `boxes`: the bounds of what is seen, see [`super::TileBounds`].
    pub fn of_receivers(scene: &Scene, boxes: &[Aabb], light: &Light) -> Self {
        Self::between(scene, &Receivers::within(scene, boxes, light), light)
    }

    /// H of given receivers: all that lies between them and any point of the light.
    pub fn between(scene: &Scene, receivers: &Receivers, light: &Light) -> Self {
        let extent = LightExtent::of(light);
        let planes = hull_planes(&receivers.region, &extent, receivers.margin);
        Self::cut(scene, receivers, planes)
    }

    /// Everything on a line from `light`, a point, through one of the receivers, before and beyond it: the
    /// texels of a map that a receiver is looked up in keep all that they hold.
    pub fn along(scene: &Scene, receivers: &Receivers, light: LightPoint) -> Self {
        let planes = line_planes(&receivers.region, light, receivers.margin);
        Self::cut(scene, receivers, planes)
    }

    /// Every caster that is not wholly outside one of `planes`: for a map's own sides, say, what it can hold. A plane
    /// that is not finite cuts nothing.
    pub fn inside(scene: &Scene, planes: &[HalfSpace]) -> Self {
        let mut hull = Polyhedron::from_box(casters_bounds(scene), 0.0);
        planes.iter().for_each(|&plane| hull.clip(plane));
        Self { planes: planes.to_vec(), hull }
    }

    fn cut(scene: &Scene, receivers: &Receivers, mut planes: Vec<HalfSpace>) -> Self {
        if receivers.is_empty() {
            return Self { planes: Vec::new(), hull: Polyhedron::EMPTY };
        }
        let mut hull = Polyhedron::from_box(casters_bounds(scene), receivers.margin);
        planes.iter().for_each(|&plane| hull.clip(plane));
        // The box around H tells most boxes apart, so its sides come first.
        if let Some((min, max)) = hull.extent() {
            let sides = [DVec3::X, DVec3::Y, DVec3::Z].into_iter().flat_map(|axis| {
                [(axis, axis.dot(max)), (-axis, -axis.dot(min))]
                    .map(|(normal, offset)| HalfSpace { normal, offset: offset + receivers.margin })
            });
            planes.splice(0..0, sides);
        }
        Self { planes, hull }
    }

    /// Whether a caster inside `bounds` may matter. Never false for one that does; false for an empty box.
    #[inline]
    pub fn touches(&self, bounds: &Aabb) -> bool {
        self.side_of(bounds) != Side::Outside
    }

    /// Where a box lies: outside, across the border (or so close that it was not told), or inside.
    #[inline]
    pub fn side_of(&self, bounds: &Aabb) -> Side {
        if self.hull.is_empty() { Side::Outside } else { side_of_all(&self.planes, bounds) }
    }

    /// Whether no caster matters at all.
    pub fn is_empty(&self) -> bool {
        self.hull.is_empty()
    }

    /// H itself, bounded by the casters' bounds.
    pub fn polyhedron(&self) -> &Polyhedron {
        &self.hull
    }

    /// Its half-spaces.
    pub fn planes(&self) -> &[HalfSpace] {
        &self.planes
    }
}

/// Bounds of all that casts.
fn casters_bounds(scene: &Scene) -> Aabb {
    let casters = scene.objects().iter().filter(|o| o.flags.casts);
    casters.fold(Aabb::EMPTY, |sum, o| sum.union(o.bounds))
}

/// Planes around the convex hull of receivers and light, moved out by `margin`.
///
/// A facet of the hull is a face of the receivers, or an edge of theirs with a point of the light, or a point of
/// theirs with an edge of the light. Whatever a candidate's normal is, the plane is moved until all of both lies
/// behind it: rounding can make the region larger, not smaller. Candidates that do not touch are no facets.
fn hull_planes(receivers: &Polyhedron, light: &LightExtent, margin: f64) -> Vec<HalfSpace> {
    let mut planes: Vec<HalfSpace> = Vec::new();
    let vertices = distinct(receivers);
    let mut add = |normal: DVec3, touched: f64| {
        let reach = vertices.iter().map(|v| normal.dot(*v)).fold(light.support(normal), f64::max);
        // Not finite: a light at infinity lies beyond any such plane.
        if reach.is_finite() && reach - touched <= margin {
            let plane = HalfSpace { normal, offset: reach + margin };
            if !planes.iter().any(|p| is_same(p, &plane, margin)) {
                planes.push(plane);
            }
        }
    };
    for plane in receivers.planes() {
        add(plane.normal, plane.offset);
    }
    for (a, b) in receivers.edges() {
        light.edge_tangents(a, b, |normal| add(normal, normal.dot(a)));
    }
    for &point in &vertices {
        light.point_tangents(point, |normal| add(normal, normal.dot(point)));
    }
    planes
}

/// Planes through a point light, or along a parallel one, that touch the receivers and have all of them behind.
fn line_planes(receivers: &Polyhedron, light: LightPoint, margin: f64) -> Vec<HalfSpace> {
    let vertices = distinct(receivers);
    let edges = receivers.edges();
    let normals: Vec<(DVec3, DVec3)> = edges
        .filter_map(|(a, b)| {
            let to_light = match light {
                LightPoint::At(place) => place.as_dvec3() - a,
                LightPoint::Towards(direction) => direction.as_dvec3(),
            };
            (b - a).try_normalize()?.cross(to_light.try_normalize()?).try_normalize().map(|n| (n, a))
        })
        .flat_map(|(normal, a)| iter::once((normal, a)).chain(iter::once((-normal, a))))
        .collect();
    let mut planes: Vec<HalfSpace> = Vec::new();
    for (normal, a) in normals {
        let anchor = match light {
            LightPoint::At(place) => place.as_dvec3(),
            LightPoint::Towards(_) => a,
        };
        // An angle of 10⁻¹² is far above rounding and, across all of the scene, far below the margin.
        let behind = |v: &DVec3| normal.dot(*v - anchor) <= (*v - anchor).length() * 1e-12;
        if vertices.iter().all(behind) {
            let plane = HalfSpace { normal, offset: normal.dot(anchor) + margin };
            if !planes.iter().any(|p| is_same(p, &plane, margin)) {
                planes.push(plane);
            }
        }
    }
    planes
}

/// Whether two planes differ by less than anyone could tell: one of them will do, as both hold everything.
fn is_same(a: &HalfSpace, b: &HalfSpace, margin: f64) -> bool {
    a.normal.dot(b.normal) >= 1.0 - 1e-12 && (a.offset - b.offset).abs() <= margin
}

fn distinct(receivers: &Polyhedron) -> Vec<DVec3> {
    let mut vertices: Vec<_> = receivers.vertices().collect();
    vertices.sort_by(|a, b| a.to_array().partial_cmp(&b.to_array()).unwrap_or(std::cmp::Ordering::Equal));
    vertices.dedup();
    vertices
}
