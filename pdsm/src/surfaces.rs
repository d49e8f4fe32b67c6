//! Which depths of each ray receivers are asked about: what the only-surfaces mode keeps (section 3.1's last paragraph).
//!
//! In this crate's layouts planes stay planes, so that the lookup of any point of a triangle reads a pixel's function at
//! one and the same depth, that of the triangle's plane at the pixel's centre less what its slope asks for. A pixel is
//! read from up to one pixel away along both axes. So one depth for each triangle within that distance is all that the
//! pixel is ever asked for, and rounding makes an interval of it.

use glam::Vec2;
use gnomon_shadow_map::receiver_plane::view_tolerance;
use rayon::prelude::*;
use scene_core::Scene;

use crate::events::EventStrips;
use crate::grid::PixelGrid;
use crate::layout::Layout;
use crate::lookup::{T_ERROR, read_before};

/// What rounding of positions adds to how far from its centre a pixel is read, in pixels.
const ROUNDING: f32 = 1.0 / 64.0;

/// A camera may stand so many times the scene's diagonal away from what it sees: its distance is part of what positions
/// are rounded by.
const FARTHEST_CAMERA: f32 = 16.0;

/// Triangles a task.
const CHUNK: usize = 4096;

/// Depths at which one pixel of a strip is read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surface {
    /// Pixel of the strip, row by row.
    pub pixel: u32,
    /// First and last depth.
    pub range: [f32; 2],
}

/// Surfaces of all receivers by strips of rows, those of [`EventStrips`]; each sorted by pixel and depth.
#[derive(Clone, Debug)]
pub struct Surfaces {
    strips: Vec<Vec<Surface>>,
}

impl Surfaces {
    /// The receivers of `scene` in a window. `tolerance` is that of the lookup.
    /// Pixels are read from up to `radius` pixels away.
    pub fn new(scene: &Scene, layout: &Layout, grid: PixelGrid, tolerance: f32, radius: u32) -> Self {
        let tolerance = tolerance + view_tolerance(FARTHEST_CAMERA * scene.bounds().diagonal());
        let finder = Finder { scene, layout, grid, tolerance, reach: radius.max(1) as f32 + ROUNDING };
        let receivers = scene.objects().iter().filter(|object| object.flags.receives);
        let triangles: Vec<usize> = receivers.flat_map(|object| object.triangles.clone()).collect();
        let empty = || vec![Vec::new(); EventStrips::new(grid.size).strip_count()];
        let parts: Vec<Vec<Vec<Surface>>> = triangles
            .par_chunks(CHUNK)
            .map(|triangles| {
                let mut strips = empty();
                triangles.iter().for_each(|&triangle| finder.add(triangle, &mut strips));
                strips
            })
            .collect();
        let mut strips = empty();
        strips.par_iter_mut().enumerate().for_each(|(index, strip)| {
            parts.iter().for_each(|part| strip.extend_from_slice(&part[index]));
            strip.sort_unstable_by(|a, b| {
                a.pixel
                    .cmp(&b.pixel)
                    .then(a.range[0].total_cmp(&b.range[0]))
                    .then(a.range[1].total_cmp(&b.range[1]))
            });
            unite(strip);
        });
        Self { strips }
    }

    /// Surfaces of strip `index`; those of a pixel ascend and are apart.
    pub fn strip(&self, index: usize) -> &[Surface] {
        &self.strips[index]
    }
}

/// Makes one of intervals that overlap.
fn unite(surfaces: &mut Vec<Surface>) {
    surfaces.dedup_by(|next, kept| {
        let overlaps = next.pixel == kept.pixel && next.range[0] <= kept.range[1];
        if overlaps {
            kept.range[1] = kept.range[1].max(next.range[1]);
        }
        overlaps
    });
}

struct Finder<'a> {
    scene: &'a Scene,
    layout: &'a Layout,
    grid: PixelGrid,
    tolerance: f32,
    /// How far from a pixel's centre it is read, in pixels along each axis.
    reach: f32,
}

impl Finder<'_> {
    fn add(&self, triangle: usize, strips: &mut [Vec<Surface>]) {
        let corners = self.scene.corners(triangle);
        let [a, b, c] = corners;
        let Some(normal) = (b - a).cross(c - a).try_normalize() else { return };
        let seen = corners.map(|corner| self.layout.project(corner));
        // One that reaches behind the light's plane may be anywhere in the window.
        let Some((anchor, at)) = corners.into_iter().zip(seen).find_map(|(p, at)| Some((p, at?))) else {
            return;
        };
        let whole = seen.iter().all(Option::is_some);
        let (slope, lift) = self.layout.plane_slope(anchor, normal, at.t);
        let rounding = self.tolerance * lift + T_ERROR * (at.t.abs() + (1.0 - at.t).abs());
        let before = at.t - read_before(slope) - rounding;
        if !before.is_finite() {
            return;
        }
        let pixel = self.grid.from_texels(at.texel);
        let slope = slope * self.grid.ratio as f32;
        let places = seen.map(|at| at.map_or(Vec2::ZERO, |at| self.grid.from_texels(at.texel)));
        let footprint = if whole { Footprint::new(places, self.reach) } else { Footprint::EVERYWHERE };
        let size = self.grid.size;
        for y in footprint.rows(size) {
            for x in footprint.columns(size) {
                let center = Vec2::new(x as f32, y as f32);
                if !footprint.reaches(center) {
                    continue;
                }
                let way = center - pixel;
                let t = before + slope.dot(way);
                // The lookup starts from another point of the triangle, with its own rounding of the same terms.
                let slack = 2.0 * rounding
                    + (slope.abs() * way.abs()).element_sum() * (32.0 * f32::EPSILON)
                    + t.abs() * T_ERROR;
                let (strip, pixel) = EventStrips::place(size, x, y);
                strips[strip].push(Surface { pixel, range: [t - slack, t + slack] });
            }
        }
    }
}

/// The pixels that a triangle is looked up in.
struct Footprint {
    corners: [Vec2; 3],
    low: Vec2,
    high: Vec2,
    reach: f32,
}

impl Footprint {
    const EVERYWHERE: Self = Self {
        corners: [Vec2::ZERO; 3],
        low: Vec2::splat(f32::NEG_INFINITY),
        high: Vec2::splat(f32::INFINITY),
        reach: 0.0,
    };

    fn new(corners: [Vec2; 3], reach: f32) -> Self {
        let [a, b, c] = corners;
        Self { corners, low: a.min(b).min(c) - reach, high: a.max(b).max(c) + reach, reach }
    }

    fn columns(&self, size: u32) -> std::ops::Range<u32> {
        range(self.low.x, self.high.x, size)
    }

    fn rows(&self, size: u32) -> std::ops::Range<u32> {
        range(self.low.y, self.high.y, size)
    }

    /// Whether the triangle may reach the square around a pixel's centre: no edge of it parts them.
    fn reaches(&self, center: Vec2) -> bool {
        let [a, b, c] = self.corners;
        let side = (b - a).perp_dot(c - a).signum();
        [(a, b), (b, c), (c, a)].into_iter().all(|(a, b)| {
            let edge = b - a;
            side * edge.perp_dot(center - a) + self.reach * edge.abs().element_sum() >= 0.0
        })
    }
}

/// Whole numbers from `low` to `high` that are pixels.
fn range(low: f32, high: f32, size: u32) -> std::ops::Range<u32> {
    let end = size as f32;
    low.ceil().clamp(0.0, end) as u32..(high.floor() + 1.0).clamp(0.0, end) as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_footprint_is_the_triangle_and_a_pixel_around() {
        let footprint =
            Footprint::new([Vec2::new(2.5, 2.5), Vec2::new(12.5, 2.5), Vec2::new(2.5, 12.5)], 1.0 + ROUNDING);
        assert_eq!((footprint.columns(10), footprint.rows(64)), (2..10, 2..14));
        assert!(footprint.reaches(Vec2::new(2.0, 2.0)) && footprint.reaches(Vec2::new(8.0, 8.0)));
        assert!(!footprint.reaches(Vec2::new(9.0, 9.0)) && !footprint.reaches(Vec2::new(12.0, 12.0)));
        // Without area there is nothing to part.
        assert!(Footprint::EVERYWHERE.reaches(Vec2::splat(1e3)));
    }

    #[test]
    fn overlapping_depths_are_one() {
        let surface = |pixel, low, high| Surface { pixel, range: [low, high] };
        let mut surfaces =
            vec![surface(0, 0.0, 0.5), surface(0, 0.25, 0.3), surface(0, 0.5, 1.0), surface(1, 0.75, 1.0)];
        unite(&mut surfaces);
        assert_eq!(surfaces, [surface(0, 0.0, 1.0), surface(1, 0.75, 1.0)]);
    }
}
