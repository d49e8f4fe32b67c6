//! The triangles that some neighbouring points may see before the light, with their corners and edges shared.
//!
//! Seen from one point, each triangle is one shadow on the light. Over an edge between two that face the same way
//! their number does not change, so only the edges where it does are handed on: the silhouette, and open edges.
//! Nothing is assumed of the mesh: edges count their triangles on either side, as many as there are.

use glam::Vec3;

use super::cone::{Cone, FAR, Projected};
use super::lit_area::LitArea;
use crate::Scene;
use crate::geometry::weld;

/// Corners at the same position are one.
#[derive(Debug, Default)]
pub(super) struct Patch {
    corners: Vec<Vec3>,
    /// Corner indices. Those of triangles without mask come first.
    triangles: Vec<[u32; 3]>,
    /// Triangles without mask.
    solid: usize,
    /// Of each triangle the edges from a corner to the next, and whether that is against the edge's direction.
    sides: Vec<[Side; 3]>,
    /// From the corner of lower index to the other.
    edges: Vec<[u32; 2]>,
}

#[derive(Clone, Copy, Debug, Default)]
struct Side {
    edge: u32,
    is_reversed: bool,
}

/// What the light gives to a point, in the light's own units of area.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Seen {
    /// With masked triangles as if they were not there.
    pub(super) most: f64,
    /// With masked triangles as if they had no holes.
    pub(super) least: f64,
}

/// A thread's buffers.
#[derive(Debug, Default)]
pub(super) struct Buffers {
    projected: Vec<Projected>,
    counts: Vec<i32>,
    lit: LitArea,
}

/// A slot of the table of edges that holds none.
const EMPTY: u32 = u32::MAX;

impl Patch {
    /// The patch of some triangles of the scene.
    pub(super) fn new(scene: &Scene, found: &[u32]) -> Self {
        let is_masked =
            |triangle: u32| scene.objects()[scene.object_of(triangle as usize) as usize].alpha.is_some();
        let mut ordered = found.to_vec();
        let mut solid = found.len();
        if scene.has_alpha() {
            let (masked, plain): (Vec<_>, Vec<_>) = found.iter().partition(|&&triangle| is_masked(triangle));
            solid = plain.len();
            ordered = plain;
            ordered.extend(masked);
        }
        let all: Vec<Vec3> = ordered.iter().flat_map(|&triangle| scene.corners(triangle as usize)).collect();
        let welded = weld(&all);
        let mut patch = Self { solid, ..Self::default() };
        let mut index_of = vec![0; all.len()];
        for (corner, &first) in welded.representative.iter().enumerate() {
            if first as usize == corner {
                index_of[corner] = patch.corners.len() as u32;
                patch.corners.push(all[corner]);
            } else {
                index_of[corner] = index_of[first as usize];
            }
        }
        patch.triangles.extend(index_of.as_chunks().0);
        patch.connect();
        patch
    }

    /// Finds the edges, each once.
    fn connect(&mut self) {
        // At most half full, so that a probe ends after a step or two.
        let slots = (self.triangles.len() * 6).next_power_of_two();
        let mut table = vec![EMPTY; slots];
        for corners in &self.triangles {
            let mut sides = [Side::default(); 3];
            for (i, side) in sides.iter_mut().enumerate() {
                let (from, to) = (corners[i], corners[(i + 1) % 3]);
                let ends = [from.min(to), from.max(to)];
                let key = u64::from(ends[0]) << 32 | u64::from(ends[1]);
                let hash = key.wrapping_mul(0x9E37_79B9_7F4A_7C15);
                let mut slot = (hash >> 32) as usize & (slots - 1);
                let edge = loop {
                    match table[slot] {
                        EMPTY => {
                            table[slot] = self.edges.len() as u32;
                            self.edges.push(ends);
                            break table[slot];
                        }
                        edge if self.edges[edge as usize] == ends => break edge,
                        _ => slot = (slot + 1) & (slots - 1),
                    }
                };
                *side = Side { edge, is_reversed: from > to };
            }
            self.sides.push(sides);
        }
    }

    /// How much of the light the apex of `cone` sees.
    pub(super) fn seen(&self, cone: &Cone<'_>, buffers: &mut Buffers) -> Seen {
        let Buffers { projected, counts, lit } = buffers;
        projected.clear();
        projected.extend(self.corners.iter().map(|&corner| cone.project(corner)));
        counts.clear();
        counts.resize(self.edges.len(), 0);
        lit.clear();
        let solid = self.add(0..self.solid, cone, projected, counts, lit);
        let most = if solid { self.area(cone, projected, counts, lit) } else { cone.seen_area };
        let masked = self.add(self.solid..self.triangles.len(), cone, projected, counts, lit);
        let least = if masked { self.area(cone, projected, counts, lit) } else { most };
        Seen { most, least }
    }

    /// Counts shadows on the edges of some triangles; those that reach beyond the cone's ends go to `lit` at once. Whether
    /// there were any.
    fn add(
        &self,
        triangles: std::ops::Range<usize>,
        cone: &Cone<'_>,
        projected: &[Projected],
        counts: &mut [i32],
        lit: &mut LitArea,
    ) -> bool {
        let mut any = false;
        for (corners, sides) in self.triangles[triangles.clone()].iter().zip(&self.sides[triangles]) {
            let [a, b, c] = corners.map(|corner| projected[corner as usize]);
            if a.outside & b.outside & c.outside & !FAR != 0 {
                continue;
            }
            any = true;
            if (a.outside | b.outside | c.outside) & FAR != 0 {
                lit.add_polygon(&cone.shadow(corners.map(|corner| self.corners[corner as usize])), 1);
                continue;
            }
            let winding = if (b.place - a.place).perp_dot(c.place - a.place) < 0.0 { -1 } else { 1 };
            for side in sides {
                counts[side.edge as usize] += if side.is_reversed { -winding } else { winding };
            }
        }
        any
    }

    /// What is lit of the outline, with the edges counted so far. Leaves `lit` as it was.
    fn area(&self, cone: &Cone<'_>, projected: &[Projected], counts: &[i32], lit: &mut LitArea) -> f64 {
        let before = lit.len();
        for (&[from, to], &count) in self.edges.iter().zip(counts) {
            if count != 0 {
                lit.add(projected[from as usize].place, projected[to as usize].place, count);
            }
        }
        let reach = glam::DVec2::splat(cone.reach());
        // What the outline leaves of the square counts as one more shadow.
        let area = match cone.seen() {
            Some(outline) => {
                lit.add_polygon(outline, -1);
                lit.area(-reach, reach, 1)
            }
            None => lit.area(-reach, reach, 0),
        };
        lit.truncate(before);
        area
    }
}
