//! The triangles that some neighbouring points may see before the light, with their corners and edges shared.
//!
//! Seen from one point, each triangle is one shadow on the light. Over an edge between two that face the same way
//! their number does not change, so only the edges where it does are handed on: the silhouette, and open edges.
//! Nothing is assumed of the mesh: edges count their triangles on either side, as many as there are.

use glam::{DVec2, Vec3};

use super::apexes::Apexes;
use super::cone::{Cone, FAR, Projected};
use super::lit_area::LitArea;
use crate::Scene;

/// Corners at the same position are one.
#[derive(Clone, Debug, Default)]
pub(super) struct Patch {
    /// Corners that are looked at; those of `triangles` come first.
    corners: Vec<Vec3>,
    /// How many are of `triangles`.
    asked_corners: usize,
    /// Those that are asked about from each point, as corner indices. Those without mask come first.
    triangles: Vec<[u32; 3]>,
    /// Triangles without mask.
    solid: usize,
    /// Of each triangle the edges from a corner to the next, and whether that is against the edge's direction.
    sides: Vec<[Side; 3]>,
    /// From a corner to another, and what the triangles that look the same from everywhere add: those without mask, and
    /// those with one. Edges on which nothing can be left are not there.
    edges: Vec<([u32; 2], [i32; 2])>,
    /// Whether there are any triangles without mask that look the same from everywhere, and with one.
    alike: [bool; 2],
}

#[derive(Clone, Copy, Debug, Default)]
struct Side {
    edge: u32,
    is_reversed: bool,
}

/// An edge while a patch is made.
#[derive(Clone, Copy, Debug)]
struct Whole {
    /// Vertices of the scene, the lower index first.
    ends: [u32; 2],
    counts: [i32; 2],
    is_asked: bool,
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
    places: Vec<DVec2>,
    counts: Vec<i32>,
    lit: LitArea,
}

/// A slot of the table of edges, or of the new index of a vertex, that holds none.
const EMPTY: u32 = u32::MAX;

/// A table of 32-bit keys or pairs of them in a slice of a power of two: where to start looking.
fn slot_of(key: u64, slots: usize) -> usize {
    (key.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 32) as usize & (slots - 1)
}

impl Patch {
    /// The patch of some triangles of the scene, as seen from points that `apexes` holds, if anything does.
    /// `representative` is of the scene's [`weld`](crate::geometry::weld()).
    pub(super) fn new(scene: &Scene, representative: &[u32], found: &[u32], apexes: Option<&Apexes>) -> Self {
        let is_masked = |triangle: u32| {
            scene.has_alpha() && scene.objects()[scene.object_of(triangle as usize) as usize].alpha.is_some()
        };
        // At most half full, so that a probe ends after a step or two.
        let slots = (found.len() * 6).next_power_of_two();
        let mut table = vec![EMPTY; slots];
        let mut edges: Vec<Whole> = Vec::with_capacity(found.len() * 2);
        let mut asked = [const { Vec::new() }; 2];
        let mut alike = [false; 2];
        for &triangle in found {
            let vertices = scene.triangles()[triangle as usize].map(|vertex| representative[vertex as usize]);
            let masked = usize::from(is_masked(triangle));
            let winding = apexes.and_then(|a| a.winding(scene.corners(triangle as usize)));
            let mut sides = [Side::default(); 3];
            for (i, side) in sides.iter_mut().enumerate() {
                let (from, to) = (vertices[i], vertices[(i + 1) % 3]);
                let ends = [from.min(to), from.max(to)];
                let mut slot = slot_of(u64::from(ends[0]) << 32 | u64::from(ends[1]), slots);
                let edge = loop {
                    match table[slot] {
                        EMPTY => {
                            table[slot] = edges.len() as u32;
                            edges.push(Whole { ends, counts: [0; 2], is_asked: false });
                            break table[slot];
                        }
                        edge if edges[edge as usize].ends == ends => break edge,
                        _ => slot = (slot + 1) & (slots - 1),
                    }
                };
                *side = Side { edge, is_reversed: from > to };
                let whole = &mut edges[edge as usize];
                match winding {
                    Some(winding) => {
                        whole.counts[masked] += if side.is_reversed { -winding } else { winding };
                    }
                    None => whole.is_asked = true,
                }
            }
            match winding {
                Some(_) => alike[masked] = true,
                None => asked[masked].push((vertices, sides)),
            }
        }
        Self { alike, ..Self::compact(scene, &edges, &asked) }
    }

    /// Leaves out edges on which nothing is left, and corners that no one asks for.
    fn compact(scene: &Scene, edges: &[Whole], asked: &[Vec<([u32; 3], [Side; 3])>; 2]) -> Self {
        let is_kept = |edge: &Whole| edge.is_asked || edge.counts != [0; 2];
        let kept = edges.iter().filter(|edge| is_kept(edge)).count();
        let mut patch = Self { solid: asked[0].len(), ..Self::default() };
        let slots = (kept * 4).next_power_of_two();
        let mut table = vec![[EMPTY; 2]; slots];
        let mut corner = |vertex: u32, corners: &mut Vec<Vec3>| {
            let mut slot = slot_of(u64::from(vertex), slots);
            loop {
                match table[slot] {
                    [EMPTY, _] => {
                        table[slot] = [vertex, corners.len() as u32];
                        corners.push(scene.positions()[vertex as usize]);
                        break corners.len() as u32 - 1;
                    }
                    [key, index] if key == vertex => break index,
                    _ => slot = (slot + 1) & (slots - 1),
                }
            }
        };
        for &(vertices, sides) in asked.iter().flatten() {
            patch.triangles.push(vertices.map(|vertex| corner(vertex, &mut patch.corners)));
            patch.sides.push(sides);
        }
        patch.asked_corners = patch.corners.len();
        let mut renamed = vec![EMPTY; edges.len()];
        for (edge, renamed) in edges.iter().zip(&mut renamed).filter(|(edge, _)| is_kept(edge)) {
            *renamed = patch.edges.len() as u32;
            let ends = edge.ends.map(|vertex| corner(vertex, &mut patch.corners));
            patch.edges.push((ends, edge.counts));
        }
        for side in patch.sides.iter_mut().flatten() {
            side.edge = renamed[side.edge as usize];
        }
        patch
    }

    /// Whether there are triangles with masks, whose holes count.
    pub(super) fn has_masks(&self) -> bool {
        self.solid < self.triangles.len() || self.alike[1]
    }

    /// Projects all corners; edges count what is alike of triangles without mask.
    fn look(&self, cone: &Cone<'_>, buffers: &mut Buffers) {
        let Buffers { projected, places, counts, lit, .. } = buffers;
        let (asked, others) = self.corners.split_at(self.asked_corners);
        projected.clear();
        projected.extend(asked.iter().map(|&corner| cone.project(corner)));
        places.clear();
        places.extend(projected.iter().map(|corner| corner.place));
        places.extend(others.iter().map(|&corner| cone.place(corner)));
        counts.clear();
        counts.extend(self.edges.iter().map(|(_, counts)| counts[0]));
        lit.clear();
    }

    /// How much of the light the apex of `cone` sees.
    pub(super) fn seen(&self, cone: &Cone<'_>, buffers: &mut Buffers) -> Seen {
        self.look(cone, buffers);
        let Buffers { projected, places, counts, lit, .. } = buffers;
        let solid =
            self.add(0..self.solid, cone, projected, counts, |p| lit.add_polygon(p, 1)) || self.alike[0];
        let most = if solid { self.area(cone, places, counts, lit) } else { cone.seen_area };
        if !self.has_masks() {
            return Seen { most, least: most };
        }
        for (count, (_, counts)) in counts.iter_mut().zip(&self.edges) {
            *count += counts[1];
        }
        let masks = self.solid..self.triangles.len();
        let masked = self.add(masks, cone, projected, counts, |p| lit.add_polygon(p, 1)) || self.alike[1];
        let least = if masked { self.area(cone, places, counts, lit) } else { most };
        Seen { most, least }
    }

    /// Counts shadows on the edges of some triangles; the shadows of those that reach beyond the cone's ends go to `cut`.
    /// Whether there were any.
    fn add(
        &self,
        triangles: std::ops::Range<usize>,
        cone: &Cone<'_>,
        projected: &[Projected],
        counts: &mut [i32],
        mut cut: impl FnMut(&[DVec2]),
    ) -> bool {
        let mut any = false;
        for (corners, sides) in self.triangles[triangles.clone()].iter().zip(&self.sides[triangles]) {
            let [a, b, c] = corners.map(|corner| projected[corner as usize]);
            if a.outside & b.outside & c.outside & !FAR != 0 {
                continue;
            }
            any = true;
            if (a.outside | b.outside | c.outside) & FAR != 0 {
                cut(&cone.shadow(corners.map(|corner| self.corners[corner as usize])));
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
    fn area(&self, cone: &Cone<'_>, places: &[DVec2], counts: &[i32], lit: &mut LitArea) -> f64 {
        let before = lit.len();
        for (&([from, to], _), &count) in self.edges.iter().zip(counts) {
            if count != 0 {
                lit.add(places[from as usize], places[to as usize], count);
            }
        }
        let reach = DVec2::splat(cone.reach());
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
