//! Runs of silhouette edges with their bounds: whole runs are left out of a block before any of their edges is asked.
//!
//! Edges come in the order of their meshes, so a run of 64 lies within a caster or a piece of one. Three bounds tell that none of them
//! matters for a block of pixels: the rectangle on the screen and the nearest depth, as a scissor and a depth-bounds test would
//! (an edge passes before a pixel only there), and the [`Shaft`] from the block to the light (a side crosses what the block sees
//! only if its edge lies between that and the light).

use fearless_simd::Simd;
use glam::DVec3;

use crate::bounds::{BoxGroup, LANES};
use crate::crossing::{Edge, HomogeneousLight};
use crate::outline::ScreenEdge;

/// Edges of a run: eight groups of sides.
pub const RUN: usize = LANES * LANES;

/// Half-spaces g·x + k ≥ 0 as (g, k), of which a box must touch all; of those marked, the plane itself.
#[derive(Clone, Debug, Default)]
pub struct Shaft {
    planes: Vec<([f64; 4], bool)>,
}

impl Shaft {
    /// Around all ways from the box between `min` and `max` to the light. Planes along the axes and, in each plane of two axes, the
    /// tangents from the light: Haines and Wallace, *Shaft culling for efficient ray-traced radiosity* (1991).
    pub fn to_light(min: DVec3, max: DVec3, light: &HomogeneousLight) -> Self {
        let mut shaft = Self::default();
        let l = light.point;
        let support = |n: DVec3| n.dot(DVec3::select(n.cmpgt(DVec3::ZERO), max, min));
        for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
            for n in [axis, -axis] {
                match light.at_infinity {
                    true if n.dot(l) > 0.0 => {}
                    true => shaft.push(n, support(n)),
                    false => shaft.push(n, support(n).max(n.dot(l))),
                }
            }
        }
        for (u, v) in [(0, 1), (1, 2), (2, 0)] {
            for corner in
                [min, DVec3::select(axis_mask(u), max, min), DVec3::select(axis_mask(v), max, min), max]
            {
                let way = light.from_point(corner);
                let mut n = DVec3::ZERO;
                (n[u], n[v]) = (-way[v], way[u]);
                let n = n.normalize_or_zero();
                for n in [n, -n] {
                    let reach = support(n);
                    // Elsewhere the light's ray through the corner passes through the box.
                    let touched = n.dot(corner);
                    if n != DVec3::ZERO && reach - touched <= TOUCHES * (touched.abs() + (max - min).length())
                    {
                        // All of the box and the light lie behind, whatever rounding does.
                        shaft.push(n, if light.at_infinity { reach } else { reach.max(n.dot(l)) });
                    }
                }
            }
        }
        shaft
    }

    /// The plane of all ways from a straight one, given by a point and its direction, to the light.
    pub fn plane(point: DVec3, way: DVec3, light: &HomogeneousLight) -> Self {
        let g = light.from_point(point).cross(way).normalize_or_zero();
        Self { planes: vec![([g.x, g.y, g.z, -g.dot(point)], true)] }
    }

    /// Everything with n·x ≤ offset.
    fn push(&mut self, n: DVec3, offset: f64) {
        self.planes.push(([-n.x, -n.y, -n.z, offset], false));
    }
}

/// How close to touching a plane through a corner of a box must be to be one of its sides, as a share of its size.
const TOUCHES: f64 = 1e-12;

fn axis_mask(axis: usize) -> glam::BVec3 {
    glam::BVec3::new(axis == 0, axis == 1, axis == 2)
}

/// Bounds of a run on the screen, and of the depth of its edges.
#[derive(Clone, Copy, Debug)]
struct OnScreen {
    low: [f64; 2],
    high: [f64; 2],
    depth: f64,
}

/// The bounds of all runs of a list of edges. Without bounds every run matters everywhere.
#[derive(Clone, Debug, Default)]
pub struct Runs {
    edges: usize,
    boxes: Vec<BoxGroup>,
    on_screen: Vec<OnScreen>,
}

impl Runs {
    /// Runs of so many edges, without bounds.
    pub fn unbounded(edges: usize) -> Self {
        Self { edges, ..Self::default() }
    }

    /// The runs of `edges`, which are seen as `outlines`.
    pub fn bounded(edges: &[Edge], outlines: &[ScreenEdge]) -> Self {
        let mut runs = Self::unbounded(edges.len());
        for (index, edges) in edges.chunks(RUN).enumerate() {
            if index % LANES == 0 {
                runs.boxes.push(BoxGroup::EMPTY);
            }
            let ends = edges.iter().flat_map(|edge| [edge.a, edge.b]);
            let (low, high) =
                ends.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)));
            runs.boxes[index / LANES].set(index % LANES, low, high);
        }
        let nowhere =
            OnScreen { low: [f64::INFINITY; 2], high: [f64::NEG_INFINITY; 2], depth: f64::INFINITY };
        // What an edge that is nowhere has of bounds is no number, which `min` and `max` pass over.
        let join = |all: OnScreen, edge: &ScreenEdge| {
            let [x, y] = [edge.range(0), edge.range(1)];
            OnScreen {
                low: [all.low[0].min(x[0]), all.low[1].min(y[0])],
                high: [all.high[0].max(x[1]), all.high[1].max(y[1])],
                depth: all.depth.min(edge.depth),
            }
        };
        runs.on_screen = outlines.chunks(RUN).map(|run| run.iter().fold(nowhere, join)).collect();
        runs
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.edges.div_ceil(RUN)
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.edges == 0
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.boxes[..]) + size_of_val(&self.on_screen[..])
    }

    /// The edges of a run.
    #[inline(always)]
    pub fn edges(&self, run: usize) -> std::ops::Range<usize> {
        run * RUN..((run + 1) * RUN).min(self.edges)
    }

    /// Eight runs, from `8 · group` on: those of which some edge may lie within the shaft, a bit each.
    #[inline(always)]
    pub fn within<S: Simd>(&self, simd: S, group: usize, shaft: &Shaft) -> u32 {
        let there = self.len().saturating_sub(group * LANES).min(LANES);
        let mut found = (1 << there) - 1;
        if let Some(boxes) = self.boxes.get(group) {
            for &(plane, both) in &shaft.planes {
                if found == 0 {
                    break;
                }
                found &= boxes.touching(simd, plane, both);
            }
        }
        found
    }

    /// Whether an edge of a run may pass before something inside a rectangle of centres that is at most `depth` deep: never
    /// false where [`ScreenEdge::may_pass`] says so of one of them.
    #[inline(always)]
    pub fn may_pass(&self, run: usize, min: [f64; 2], max: [f64; 2], depth: f64) -> bool {
        self.on_screen.get(run).is_none_or(|run| {
            run.low[0] <= max[0]
                && run.high[0] >= min[0]
                && run.low[1] <= max[1]
                && run.high[1] >= min[1]
                && run.depth <= depth + depth.abs() * f64::from(f32::EPSILON)
        })
    }
}
