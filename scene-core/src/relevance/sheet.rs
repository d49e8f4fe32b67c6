//! Whether a connected sheet of triangles hides a whole light from a whole group of receivers.
//!
//! # Why it is a proof
//!
//! Take any triangles that have all receivers strictly on one side of their plane and all of the light strictly on the
//! other, and turn each so that light crosses it from its back to its front. Move a segment from a receiver to the light
//! continuously, over all receivers and all of the light: the number of triangles it crosses can only change where it
//! meets an edge whose two sides do not cancel, that is the border of the sheet or a fold of it that is a
//! silhouette. So if no such edge reaches into the shaft and one segment crosses the sheet, all segments do: the light is
//! hidden. This holds for a wall of two triangles, where no triangle alone hides the light, as for the side of a finely
//! tessellated body.
//!
//! # Rounding
//!
//! A shadow ray meets corners that are rounded relative to its origin: each coordinate by 2 u of the largest coordinate
//! M, u = 2⁻²⁴, so corners move by less than 2√3 u M < 4 u M, all faces of a corner alike. Edges are kept 4 u M away from the
//! shaft: 2 u by the shaft itself, 2 u here. Sides are kept by the most that a determinant changes when its points move by
//! that. Then moving the corners from the exact to the rounded places passes through no border, and the number of
//! crossings stays.

use std::ops::ControlFlow;

use glam::{DVec3, Vec3};
use robust::{Coord3D, orient3d};

use super::receiver_group::Beam;
use crate::Scene;
use crate::bvh::{Bvh, HalfSpace};
use crate::geometry::Aabb;
use crate::light::LightPoint;
use crate::reference::shaft::LightShaft;

/// Triangles in a shaft at most; beyond it nothing is proved. A search takes time with their number.
const MOST: usize = 192;

/// 2⁻²³ = 2 u: see the module.
const BESIDE: f64 = 1.0 / (1_u32 << 23) as f64;
/// 2⁻²² = 4 u: see the module.
const MOVED: f64 = 2.0 * BESIDE;

/// Buffers of the search.
#[derive(Default)]
pub(super) struct Sheets {
    triangles: Vec<Caster>,
    pending: Vec<usize>,
}

/// A triangle in the shaft.
struct Caster {
    corners: [Vec3; 3],
    is_visited: bool,
    /// Which way light crosses it, once asked.
    turn: Option<Turn>,
}

/// Which way light crosses a triangle: by its corners' order, against it, or not the same way everywhere.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Turn {
    With,
    Against,
    Unsure,
}

/// What a search is about.
struct Search<'a> {
    beam: &'a Beam,
    origins: [DVec3; 8],
    sides: &'a [HalfSpace],
    /// Largest coordinate.
    magnitude: f64,
}

impl Sheets {
    /// Whether a sheet of casters without masks cuts the shaft between `origins` and the light.
    pub(super) fn cut(
        &mut self,
        scene: &Scene,
        casters: &Bvh,
        beam: &Beam,
        origins: &Aabb,
        shaft: &LightShaft,
    ) -> bool {
        self.triangles.clear();
        let mut add = |triangle: u32| {
            let object = &scene.objects()[scene.object_of(triangle as usize) as usize];
            if object.alpha.is_some() {
                return ControlFlow::Continue(());
            }
            if self.triangles.len() == MOST {
                return ControlFlow::Break(());
            }
            let corners = scene.corners(triangle as usize);
            self.triangles.push(Caster { corners, is_visited: false, turn: None });
            ControlFlow::Continue(())
        };
        if casters.visit_region(shaft.sides(), &mut add).is_break() {
            return false;
        }
        let search = Search {
            beam,
            origins: origins.corners().map(|corner| corner.as_dvec3()),
            sides: shaft.sides(),
            magnitude: f64::from(origins.magnitude().max(beam.magnitude)),
        };
        // Several segments, as one may pass through a corner or an edge, where it decides nothing.
        (0..3).any(|choice| {
            let segment = search.segment(choice);
            (0..self.triangles.len()).any(|seed| {
                !self.triangles[seed].is_visited
                    && crosses(segment, self.triangles[seed].corners)
                    && self.grow(seed, &search)
            })
        })
    }

    /// Whether the sheet around a triangle has no border in the shaft.
    fn grow(&mut self, seed: usize, search: &Search<'_>) -> bool {
        self.pending.clear();
        self.pending.push(seed);
        self.triangles[seed].is_visited = true;
        while let Some(index) = self.pending.pop() {
            let turn = self.turn(index, search);
            if turn == Turn::Unsure {
                return false;
            }
            for edge in 0..3 {
                let corners = self.triangles[index].corners;
                let (a, b) = (corners[edge], corners[(edge + 1) % 3]);
                if search.is_outside(a, b) {
                    continue;
                }
                let mut balance = if turn == Turn::With { 1 } else { -1 };
                for other in (0..self.triangles.len()).filter(|&other| other != index) {
                    let Some(along) = direction(self.triangles[other].corners, a, b) else { continue };
                    match self.turn(other, search) {
                        Turn::With => balance += along,
                        Turn::Against => balance -= along,
                        Turn::Unsure => continue,
                    }
                    if !self.triangles[other].is_visited {
                        self.triangles[other].is_visited = true;
                        self.pending.push(other);
                    }
                }
                if balance != 0 {
                    return false;
                }
            }
        }
        true
    }

    fn turn(&mut self, index: usize, search: &Search<'_>) -> Turn {
        let triangle = &mut self.triangles[index];
        *triangle.turn.get_or_insert_with(|| search.turn(triangle.corners))
    }
}

impl Search<'_> {
    /// A segment from among the receivers to inside the light: its origin, and where it goes.
    fn segment(&self, choice: usize) -> (DVec3, DVec3) {
        // Weights without a pattern, so that edges of regular things are not met.
        let weight = |i: usize| 1.0 + (i as f64 * 0.618_034 + choice as f64 * 0.414_214).fract();
        let mean = |points: &mut dyn Iterator<Item = DVec3>| {
            let (sum, weights) = points
                .enumerate()
                .fold((DVec3::ZERO, 0.0), |(sum, all), (i, p)| (sum + p * weight(i), all + weight(i)));
            sum / weights
        };
        let origin = mean(&mut self.origins.into_iter());
        let mut is_distant = false;
        let light = mean(&mut self.beam.outline.points().iter().map(|point| match *point {
            LightPoint::At(place) => place.as_dvec3(),
            LightPoint::Towards(direction) => {
                is_distant = true;
                direction.as_dvec3()
            }
        }));
        (origin, if is_distant { origin + light * self.magnitude } else { light })
    }

    /// Whether an edge lies outside the shaft, with room for rounding.
    fn is_outside(&self, a: Vec3, b: Vec3) -> bool {
        let beside = self.magnitude * BESIDE;
        let outside = |side: &HalfSpace, p: Vec3| side.normal.dot(p.as_dvec3()) > side.offset + beside;
        self.sides.iter().any(|side| outside(side, a) && outside(side, b))
    }

    fn turn(&self, corners: [Vec3; 3]) -> Turn {
        let [a, b, c] = corners.map(|corner| corner.as_dvec3());
        let normal = (b - a).cross(c - a);
        let moved = self.magnitude * MOVED;
        // A determinant of three offsets changes by at most three times the moved length times the square of the
        // longest offset; f64 adds far less, which the last term holds.
        let side = |p: DVec3| {
            let height = normal.dot(p - a);
            let longest = [a, b, c].map(|v| v.distance(p)).into_iter().fold(0.0, f64::max) + moved;
            let doubt = 3.0 * moved * longest * longest + 1e-14 * longest * longest * longest;
            if height > doubt {
                1
            } else if height < -doubt {
                -1
            } else {
                0
            }
        };
        // Of a direction: both edges move by twice the length.
        let longest = (b - a).length().max((c - a).length()) + moved;
        let along = |d: DVec3| {
            let height = normal.dot(d);
            let doubt = (4.0 * moved * longest + 1e-14 * longest * longest) * d.length();
            if height > doubt {
                1
            } else if height < -doubt {
                -1
            } else {
                0
            }
        };
        let way = -side(self.origins[0]);
        let is_same = way != 0
            && self.origins[1..].iter().all(|&origin| side(origin) == -way)
            && self.beam.outline.points().iter().all(|point| match *point {
                LightPoint::At(place) => side(place.as_dvec3()) == way,
                LightPoint::Towards(direction) => along(direction.as_dvec3()) == way,
            });
        match (is_same, way) {
            (true, 1) => Turn::With,
            (true, _) => Turn::Against,
            (false, _) => Turn::Unsure,
        }
    }
}

/// Whether a triangle has the edge between `a` and `b`: 1 if it runs from a to b, −1 if from b to a.
fn direction(corners: [Vec3; 3], a: Vec3, b: Vec3) -> Option<i32> {
    (0..3).find_map(|edge| match (corners[edge], corners[(edge + 1) % 3]) {
        (from, to) if from == a && to == b => Some(1),
        (from, to) if from == b && to == a => Some(-1),
        _ => None,
    })
}

/// Whether the line through a segment passes strictly inside a triangle; exact.
fn crosses((from, to): (DVec3, DVec3), corners: [Vec3; 3]) -> bool {
    let at = |p: DVec3| Coord3D { x: p.x, y: p.y, z: p.z };
    let [a, b, c] = corners.map(|corner| at(corner.as_dvec3()));
    let (from, to) = (at(from), at(to));
    let first = orient3d(from, to, a, b);
    let agrees = |side: f64| side * first.signum() > 0.0;
    first != 0.0 && agrees(orient3d(from, to, b, c)) && agrees(orient3d(from, to, c, a))
}
