//! Points in place of triangles (section 5): for casters of which many triangles fall into one texel, such as trees far off.
//!
//! An object that the scene marks ([`ObjectFlags::points`](scene_core::geometry::ObjectFlags::points)) gets a cloud once:
//! points spread over its surface by area, in an order in which every beginning is spread evenly, too: point i lies where the
//! base-2 radical inverse of i lies in the sum of areas, so that the first 2ᵏ have one in each 2⁻ᵏ of the surface. A map
//! draws as many of them as its texels ask for: one a texel of the surface, turned to the light, where texels are finest in the
//! object's bounds. The farther an object, the fewer; one that would need more than it has is drawn by its triangles.
//!
//! # Splats and holes
//! A point fills a square of [`SPLAT`] × [`SPLAT`] texels around itself. A texel's centre on a surface that fills the square of
//! that size around it is missed only if none of the points lies in that square: with at least one point a texel expected, that
//! is Poisson's e^(−SPLAT²), 1.2 · 10⁻⁴ for 3, and behind what is missed there is the surface's other side, or the next leaf.
//! What is filled beyond the mesh is at most half a splat off: V at an outline is as coarse as a map of a third of the
//! resolution. That is the price: points are for casters that are finer than the texels they fall into.
//!
//! A texel keeps the triangle that its point lies on, as a drawn one does, and the comparison is the same.

use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering};

use glam::{DVec2, DVec3, DVec4, Vec3};
use rayon::prelude::*;
use scene_core::relevance::HalfSpace;
use scene_core::{GBuffer, Scene};

use crate::views::MapView;
use crate::warp::at;

/// Texels a side that a point fills.
pub const SPLAT: i64 = 3;

/// Points that a map on the GPU chooses at once.
pub const PIECE: u32 = 64;

/// A cloud has at most a point for so many of the object's triangles: for more its triangles are drawn faster.
const TRIANGLES_A_POINT: usize = 2;

/// A point on a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CloudPoint {
    /// World space.
    pub position: Vec3,
    /// The triangle it lies on, as an index into [`Scene::triangles`].
    pub triangle: u32,
}

/// The points of one object.
#[derive(Clone, Debug)]
pub struct Cloud {
    /// Its id.
    pub object: usize,
    /// Of its surface, one side, scene units squared.
    pub area: f64,
    /// Every beginning of them is spread evenly.
    pub points: Vec<CloudPoint>,
}

/// The clouds of a scene. They hold as long as the scene does.
#[derive(Clone, Debug, Default)]
pub struct PointClouds {
    clouds: Vec<Cloud>,
}

impl PointClouds {
    /// For every casting object that is marked, has no cut-out mask and has an area.
    pub fn new(scene: &Scene) -> Self {
        let objects = scene.objects().par_iter().enumerate();
        let marked = objects.filter(|(_, o)| o.flags.points && o.flags.casts && o.alpha.is_none());
        Self { clouds: marked.filter_map(|(id, o)| Cloud::new(scene, id, o.triangles.clone())).collect() }
    }

    /// Each object's, ids ascending.
    pub fn clouds(&self) -> &[Cloud] {
        &self.clouds
    }

    /// Whether the scene marks nothing.
    pub fn is_empty(&self) -> bool {
        self.clouds.is_empty()
    }

    /// Points in all.
    pub fn count(&self) -> usize {
        self.clouds.iter().map(|cloud| cloud.points.len()).sum()
    }

    /// Bytes held.
    pub fn bytes(&self) -> u64 {
        (self.count() * size_of::<CloudPoint>()) as u64
    }

    /// The clouds that `view` draws with `size` texels a side, and how many points of each.
    pub fn chosen(&self, scene: &Scene, view: &MapView, size: u32) -> Chosen<'_> {
        let sides = view.sides();
        let choice = |cloud: &Cloud| {
            let bounds = scene.objects()[cloud.object].bounds;
            if sides.iter().any(|side| is_outside(side, bounds.corners().map(Vec3::as_dvec3))) {
                return Some(0);
            }
            let density = density(view, size, bounds.corners().map(Vec3::as_dvec3))?;
            let count = cloud.area * density;
            (count <= cloud.points.len() as f64).then_some(count.ceil() as usize)
        };
        let chosen = self.clouds.par_iter().filter_map(|cloud| Some((cloud, choice(cloud)?)));
        Chosen { clouds: chosen.collect() }
    }
}

/// What a map draws as points.
#[derive(Clone, Debug)]
pub struct Chosen<'a> {
    clouds: Vec<(&'a Cloud, usize)>,
}

impl Chosen<'_> {
    /// Ids of the objects whose triangles are not drawn, ascending.
    pub fn objects(&self) -> Vec<usize> {
        self.clouds.iter().map(|(cloud, _)| cloud.object).collect()
    }

    /// Points that are drawn.
    pub fn count(&self) -> usize {
        self.clouds.iter().map(|(_, count)| count).sum()
    }

    /// Draws them over what `depth` and `triangles` hold, row by row; the nearer stays. Of equal depth the larger id stays, so
    /// that the number of threads does not matter.
    pub fn draw(&self, view: &MapView, size: u32, depth: &[f32], triangles: &mut [u32]) {
        if self.count() == 0 {
            return;
        }
        // Reversed depth is not below 0, and so are ordered by their bits.
        let packed = |depth: f32, triangle: u32| u64::from(depth.to_bits()) << 32 | u64::from(triangle);
        let texels: Vec<AtomicU64> = depth
            .par_iter()
            .zip(&*triangles)
            .map(|(&depth, &triangle)| {
                // Nothing is farther than every point.
                AtomicU64::new(if triangle == GBuffer::NOTHING { 0 } else { packed(depth, triangle) })
            })
            .collect();
        let rows: [DVec4; 4] = [0, 1, 2, 3].map(|row| view.clip_from_world.row(row).as_dvec4());
        let (extent, half) = (f64::from(size), f64::from(size) * 0.5);
        self.clouds.par_iter().for_each(|(cloud, count)| {
            for point in &cloud.points[..*count] {
                let [x, y, z, w] = rows.map(|row| at(row, point.position.as_dvec3()));
                let place = DVec2::new((x + w) * half, (w - y) * half) / w;
                let nearness = z / w;
                let reach = SPLAT as f64 * 0.5;
                // NaN is outside.
                let inside = place.min_element() > -reach && place.max_element() < extent + reach;
                if !(w > 0.0 && inside && nearness > 0.0 && nearness <= 1.0) {
                    continue;
                }
                // Texels whose centres lie within half a splat.
                let first = (place - reach + 0.5).floor();
                let value = packed(nearness as f32, point.triangle);
                let span = |first: f64| {
                    let first = first as i64;
                    first.max(0)..(first + SPLAT).min(i64::from(size))
                };
                for row in span(first.y) {
                    for column in span(first.x) {
                        let texel = &texels[row as usize * size as usize + column as usize];
                        if texel.load(Ordering::Relaxed) < value {
                            texel.fetch_max(value, Ordering::Relaxed);
                        }
                    }
                }
            }
        });
        triangles.par_iter_mut().zip(texels).for_each(|(triangle, texel)| {
            let value = texel.into_inner();
            if value > 0 {
                *triangle = value as u32;
            }
        });
    }
}

impl Cloud {
    fn new(scene: &Scene, object: usize, triangles: Range<usize>) -> Option<Self> {
        let mut sums = Vec::with_capacity(triangles.len());
        let mut area = 0.0;
        for triangle in triangles.clone() {
            let [a, b, c] = scene.corners(triangle).map(Vec3::as_dvec3);
            area += (b - a).cross(c - a).length() * 0.5;
            sums.push(area);
        }
        if !(area > 0.0 && area.is_finite()) {
            return None;
        }
        let count = triangles.len() / TRIANGLES_A_POINT;
        let point = |index: u32| {
            let target = radical_inverse(index) * area;
            let place = sums.partition_point(|&sum| sum <= target).min(sums.len() - 1);
            let triangle = triangles.start + place;
            let [a, b, c] = scene.corners(triangle);
            let [u, v] = along(object, index);
            CloudPoint { position: a + (b - a) * u + (c - a) * v, triangle: triangle as u32 }
        };
        (count > 0).then(|| Self { object, area, points: (0..count as u32).map(point).collect() })
    }
}

/// Where on its triangle a point of an object lies: shares of the ways from the first corner to the others.
pub fn along(object: usize, index: u32) -> [f32; 2] {
    let [u, v] = square(index ^ (object as u32).wrapping_mul(0x9E37_79B1));
    // Folded, so that it is uniform over the triangle.
    if u + v > 1.0 { [1.0 - u, 1.0 - v] } else { [u, v] }
}

/// Whether all corners lie outside of a half-space.
fn is_outside(side: &HalfSpace, corners: [DVec3; 8]) -> bool {
    corners.iter().all(|&corner| side.height(corner) > 0.0)
}

/// Texels a unit of area, turned to the light, where they are finest in a box; `None` if it reaches to where the map has no
/// place.
///
/// A place is (X, Y)/w, and the cross product of its gradients is `N/w³` with a linear N, along the light's ray since both
/// gradients are across it. |N| is largest and w is least at corners: their quotient is a bound, reached where w is constant.
fn density(view: &MapView, size: u32, corners: [DVec3; 8]) -> Option<f64> {
    let ndc = view.ndc;
    let (mut largest, mut least) = (0.0f64, f64::INFINITY);
    for corner in corners {
        let w = at(ndc.w, corner);
        if w <= 0.0 {
            return None;
        }
        let place = ndc.place(corner);
        let (x, y) = ((ndc.x - ndc.w * place.x).truncate(), (ndc.y - ndc.w * place.y).truncate());
        (largest, least) = (largest.max(x.cross(y).length() * w), least.min(w));
    }
    let texels = f64::from(size) * 0.5;
    let density = largest / least.powi(3) * texels * texels;
    density.is_finite().then_some(density)
}

/// The bits of `index` mirrored at the binary point: in [0, 1).
fn radical_inverse(index: u32) -> f64 {
    f64::from(index.reverse_bits()) / 4_294_967_296.0
}

/// Two numbers in [0, 1), scattered by `index`. The mixer is that of `MurmurHash3` (public domain).
fn square(index: u32) -> [f32; 2] {
    let mix = |mut h: u32| {
        h = (h ^ h >> 16).wrapping_mul(0x85EB_CA6B);
        h = (h ^ h >> 13).wrapping_mul(0xC2B2_AE35);
        h ^ h >> 16
    };
    [index.wrapping_mul(2), index.wrapping_mul(2).wrapping_add(1)]
        .map(|i| (mix(i) >> 8) as f32 / 16_777_216.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_beginning_of_the_order_is_spread_evenly() {
        for bits in 0..8 {
            let count = 1u32 << bits;
            let mut shares: Vec<u32> =
                (0..count).map(|i| (radical_inverse(i) * f64::from(count)) as u32).collect();
            shares.sort_unstable();
            assert!(shares.into_iter().eq(0..count));
        }
    }

    #[test]
    fn scattered_numbers_fill_the_square() {
        let mut cells = [0; 16];
        for i in 0..1600 {
            let [u, v] = square(i);
            assert!((0.0..1.0).contains(&u) && (0.0..1.0).contains(&v));
            cells[(u * 4.0) as usize * 4 + (v * 4.0) as usize] += 1;
        }
        // 100 expected in each: five standard deviations.
        assert!(cells.iter().all(|n| (50..150).contains(n)), "{cells:?}");
    }
}
