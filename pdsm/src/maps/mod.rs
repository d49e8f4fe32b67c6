//! Maps drawn for sixteen samples of the light at once: one triangle in sixteen views, a lane a view.
//!
//! In a [`Layout`] a vertex lies at q + D·t in the map of the sample with step D, with q and t the same in all maps. So a
//! triangle is fetched once, and what differs among views is one multiplication a coordinate. Each lane owns a map:
//! nothing is sorted, and no two lanes write to one place. What is stored is t itself, which is linear on the map wherever
//! a triangle is plane.
//!
//! # Coverage and precision
//! As in [`scene_core::raster`]: positions are snapped to 1/256 texel, coverage is decided in integers with the top-left
//! rule, and depth is interpolated by integer weights, kept between those of the corners. A vertex is snapped from its
//! place at t = 0, split into whole steps and a rest, so that D·t alone is rounded: below 2²¹ steps by a quarter of one
//! at most, in its factor t by as much. See [`POSITION_ERROR`].
//!
//! # Limits
//! Casters with cut-out masks, ones that reach before the window's near plane, and ones that leave the guard band in any
//! view are drawn by [`scene_core::raster`], map by map: [`MapCasters::new`] says so.

mod lanes;
mod spans;

use fearless_simd::{Level, dispatch};
use glam::{DVec3, Vec2, Vec3};
use rayon::prelude::*;
use scene_core::Scene;
use scene_core::geometry::Object;

use crate::layout::{Depth, Layout};

/// Views that are drawn at once.
pub const LANES: usize = 16;

/// Steps a texel.
const STEPS: f64 = 256.0;

/// Farthest place of a vertex in steps, in any view: 2¹⁴ texels. Rounding by adding a large number takes twice that.
const GUARD: f64 = 4_194_304.0;
/// Farthest that a vertex is moved from view to view, in steps.
const FARTHEST_MOVE: f64 = 2_097_152.0;

/// How far from a texel's centre, in texels along x and along y, the point of a triangle may project whose depth is
/// stored: half a step for snapping, half a step for rounding.
pub const POSITION_ERROR: f32 = 1.0 / 256.0;

/// A vertex in the axes of a window.
#[derive(Clone, Copy, Debug)]
struct Vertex {
    /// Place at t = 0 in steps: whole ones.
    whole: [i32; 2],
    /// The rest, at most half a step.
    rest: [f32; 2],
    t: f32,
}

/// Triangles ready to be drawn for any sample of a layout.
#[derive(Clone, Debug)]
pub struct MapCasters {
    level: Level,
    vertices: Vec<Vertex>,
    triangles: Vec<[u32; 3]>,
}

impl MapCasters {
    /// `casters` in the axes of `layout`; `None` where one of them is beyond what this module draws.
    pub fn new(scene: &Scene, casters: &[&Object], layout: &Layout) -> Option<Self> {
        if casters.iter().any(|object| object.alpha.is_some()) {
            return None;
        }
        let farthest = layout.steps().fold(Vec2::ZERO, |far, step| far.max(step.abs())).as_dvec2() * STEPS;
        let project = |&position: &Vec3| {
            let p = position.as_dvec3() - layout.placement.origin.as_dvec3();
            let [x, y, z] = layout.placement.axes.map(|axis| axis.as_dvec3().dot(p));
            let (on_window, t) = match layout.placement.depth {
                Depth::Central { focus } => {
                    let scale = f64::from(focus) / z;
                    (DVec3::new(x, y, z) * scale, 1.0 - scale)
                }
                Depth::Parallel { focus, per_unit } => {
                    (DVec3::new(x, y, z), (z - f64::from(focus)) * f64::from(per_unit))
                }
            };
            let steps = (on_window.truncate() - layout.placement.corner.as_dvec2())
                * layout.placement.texels_per_unit.as_dvec2()
                * STEPS;
            let moved = farthest * t.abs();
            let fits = z >= layout.caster_range[0]
                && (steps.abs() + moved).max_element() < GUARD
                && moved.max_element() < FARTHEST_MOVE;
            let whole = steps.round();
            let rest = (steps - whole).as_vec2();
            fits.then_some(Vertex { whole: whole.as_ivec2().to_array(), rest: rest.to_array(), t: t as f32 })
        };
        let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
        for object in casters {
            let positions = &scene.positions()[object.vertices.clone()];
            let own: Option<Vec<Vertex>> = positions.par_iter().map(project).collect();
            let base = (object.vertices.start as u32).wrapping_sub(vertices.len() as u32);
            triangles.extend(
                scene.triangles()[object.triangles.clone()]
                    .iter()
                    .map(|triangle| triangle.map(|vertex| vertex.wrapping_sub(base))),
            );
            vertices.extend(own?);
        }
        Some(Self { level: Level::new(), vertices, triangles })
    }

    /// Draws the maps of up to [`LANES`] samples, given by their steps: into each the least t at every texel's centre.
    /// Maps have `size` texels a side; row by row, `stride` values a row, the first at `start`. What is there already
    /// counts as drawn.
    pub fn draw(&self, steps: &[Vec2], target: Target, maps: &mut [&mut [f32]]) {
        let views = &steps[..steps.len().min(LANES).min(maps.len())];
        if views.is_empty() {
            return;
        }
        let level = self.level;
        dispatch!(level, simd => lanes::draw(simd, self, views, target, maps));
    }
}

/// How a map's texels lie in memory.
#[derive(Clone, Copy, Debug)]
pub struct Target {
    /// Texels a side.
    pub size: i32,
    /// Place of the first.
    pub start: i32,
    /// Values a row.
    pub stride: i32,
}

#[cfg(test)]
mod tests {
    use scene_core::raster::{DepthMap, DepthOptions, DepthRange, RasterScratch, render_depth_into};
    use scene_core::{relevance, scenes};

    use super::*;
    use crate::layout::Fit;

    /// The rasteriser of scene-core draws the same casters, from the same layout, by another way: depths agree but for
    /// texels that an edge passes within what snapping moves it.
    #[test]
    fn maps_are_those_of_the_rasteriser() {
        for name in ["quads", "knot", "cylinder", "park"] {
            let setup = scenes::build(name, 0.0).unwrap();
            let (scene, light) = (&setup.scene, &setup.lights[0]);
            let casters = relevance::told_apart(scene, light, 1e-4).drawn;
            let size = 128;
            let (layouts, _) = Fit { scene, light, views: 20, map_size: size, seed: 0 }.layouts(&casters);
            for layout in &layouts {
                let Some(drawn) = MapCasters::new(scene, &casters, layout) else { continue };
                let steps: Vec<_> = layout.steps().collect();
                let target = Target { size: size as i32, start: 0, stride: size as i32 };
                let mut maps = vec![vec![f32::INFINITY; (size * size) as usize]; steps.len()];
                for (steps, maps) in steps.chunks(LANES).zip(maps.chunks_mut(LANES)) {
                    let mut maps: Vec<_> = maps.iter_mut().map(Vec::as_mut_slice).collect();
                    drawn.draw(steps, target, &mut maps);
                }
                let ranges: Vec<_> = casters.iter().map(|object| object.triangles.clone()).collect();
                let options =
                    DepthOptions { range: DepthRange::Clamp, triangles: Some(&ranges), ..Default::default() };
                let t_of_depth = layout.t_of_depth();
                for (step, map) in steps.iter().zip(&maps) {
                    let mut other = DepthMap { width: size, height: size, depth: Vec::new() };
                    let projection = layout.map_projection(*step);
                    render_depth_into(scene, projection, &options, &mut RasterScratch::new(), &mut other);
                    let expected: Vec<f32> = other.depth.iter().map(|&depth| t_of_depth(depth)).collect();
                    let near =
                        |index: usize, t: f32| (expected[index] - t).abs() < 1e-3 || expected[index] == t;
                    let differ = (0..map.len()).filter(|&index| !near(index, map[index])).count();
                    let seen = map.iter().filter(|t| t.is_finite()).count();
                    assert!(seen > 100 && differ * 50 <= seen, "{name}: {differ} of {seen}");
                }
            }
        }
    }

    /// Two triangles that share an edge leave no texel out and none is drawn by both, in every view.
    #[test]
    fn shared_edges_are_watertight() {
        let vertex = |x: f64, y: f64, t: f32| {
            let (sx, sy) = (x * STEPS, y * STEPS);
            Vertex {
                whole: [sx.round() as i32, sy.round() as i32],
                rest: [(sx - sx.round()) as f32, (sy - sy.round()) as f32],
                t,
            }
        };
        // A fan around a point: small triangles, and large ones that are drawn by rows.
        for (side, size) in [(11.3, 16), (90.7, 96)] {
            let mut vertices = vec![vertex(side * 0.43, side * 0.51, 0.4)];
            let rim = 24;
            for i in 0..rim {
                let angle = f64::from(i) / f64::from(rim) * std::f64::consts::TAU;
                let (sin, cos) = angle.sin_cos();
                vertices.push(vertex(side * (0.5 + 2.0 * cos), side * (0.5 + 2.0 * sin), 0.4));
            }
            let triangles: Vec<[u32; 3]> =
                (0..rim as u32).map(|i| [0, i + 1, (i + 1) % rim as u32 + 1]).collect();
            let steps: Vec<_> =
                (0..13).map(|i| Vec2::new(i as f32 * 0.31 - 2.0, 1.7 - i as f32 * 0.23)).collect();
            let area = (size * size) as usize;
            let mut covered = vec![vec![0; area]; steps.len()];
            for &triangle in &triangles {
                let casters =
                    MapCasters { level: Level::new(), vertices: vertices.clone(), triangles: vec![triangle] };
                let mut maps = vec![vec![f32::INFINITY; area]; steps.len()];
                let mut slices: Vec<_> = maps.iter_mut().map(Vec::as_mut_slice).collect();
                casters.draw(&steps, Target { size, start: 0, stride: size }, &mut slices);
                for (covered, map) in covered.iter_mut().zip(&maps) {
                    for (count, t) in covered.iter_mut().zip(map) {
                        *count += usize::from(t.is_finite());
                        assert!(!t.is_finite() || (t - 0.4).abs() < 1e-6);
                    }
                }
            }
            assert!(covered.iter().all(|map| map.iter().all(|&count| count == 1)), "{size}");
        }
    }
}
