//! The edges that a block's receivers are asked about, component by component.

use fearless_simd::{Select, Simd, SimdBase, SimdMask, f32x16};
use glam::Vec3;

use crate::lanes::{LANES, Lanes, Source};
use crate::silhouettes::Edge;
use crate::sites::{SiteVector, Sites, by_receivers};
use crate::vectors::{Vec3x16, dot, sub};

/// Numbers an edge: a, b, the two planes, the two signs; the point seen past the edge.
const PARTS: usize = 19;

/// Where the parts of an edge begin.
const PLANES: [usize; 2] = [6, 10];
const SIGNS: usize = 14;
const FAR: usize = 16;

/// Sixteen edges, or one sixteen times.
#[derive(Clone, Copy)]
pub(crate) struct EdgeVector<S: Simd> {
    /// The ends.
    pub(crate) a: Vec3x16<S>,
    pub(crate) b: Vec3x16<S>,
    /// Normals and distances of the two faces' planes.
    planes: [(Vec3x16<S>, f32x16<S>); 2],
    signs: [f32x16<S>; 2],
    /// The point seen past the edge, NaN where it is not known, if it is of some.
    pub(crate) far: Option<Vec3x16<S>>,
}

impl<S: Simd> EdgeVector<S> {
    #[inline(always)]
    fn of(numbers: impl Source<S>, has_far: bool) -> Self {
        let [first, second] = PLANES;
        Self {
            a: numbers.three(0),
            b: numbers.three(3),
            planes: [
                (numbers.three(first), numbers.number(first + 3)),
                (numbers.three(second), numbers.number(second + 3)),
            ],
            signs: [numbers.number(SIGNS), numbers.number(SIGNS + 1)],
            far: if has_far { Some(numbers.three(FAR)) } else { None },
        }
    }

    /// m(e) as seen from a point.
    #[inline(always)]
    pub(crate) fn multiplicity(&self, point: Vec3x16<S>) -> f32x16<S> {
        self.side(0, point) + self.side(1, point)
    }

    /// sign(e, f)·side(f, p) of the first or second face.
    #[inline(always)]
    fn side(&self, face: usize, point: Vec3x16<S>) -> f32x16<S> {
        let ((normal, d), sign) = (self.planes[face], self.signs[face]);
        (dot(normal, point) + d).simd_ge(0.0).select(sign, -sign)
    }

    /// Whether an edge may count for a receiver, a bit each: it rises above its plane and, where it is `silhouettes` that count, is
    /// one as it sees it.
    #[inline(always)]
    fn may_count(&self, site: &SiteVector<S>, silhouettes: bool) -> u64 {
        let a = dot(site.normal, sub(self.a, site.point)) - site.tolerance;
        let b = dot(site.normal, sub(self.b, site.point)) - site.tolerance;
        let bits = !(a.simd_le(0.0) & b.simd_le(0.0)).to_bitmask();
        if silhouettes { bits & !self.multiplicity(site.point).simd_eq(0.0).to_bitmask() } else { bits }
    }
}

/// Edges of a block, component by component.
#[derive(Debug, Default)]
pub struct TileEdges {
    lanes: Lanes<PARTS>,
    has_far: bool,
}

impl TileEdges {
    /// Forgets all.
    pub fn clear(&mut self) {
        self.lanes.clear();
        self.has_far = false;
    }

    /// Adds an edge.
    #[inline(always)]
    pub fn push(&mut self, edge: &Edge) {
        let [p, q] = edge.planes.map(|plane| plane.to_array());
        let (a, b, far, [first, second]) = (edge.a, edge.b, edge.far, edge.signs);
        self.has_far |= !far.is_nan();
        #[rustfmt::skip]
        self.lanes.push([
            a.x, a.y, a.z, b.x, b.y, b.z, p[0], p[1], p[2], p[3], q[0], q[1], q[2], q[3], first, second,
            far.x, far.y, far.z,
        ]);
    }

    /// Takes over those of `edges` that are named.
    #[inline(always)]
    pub fn gather(&mut self, edges: &[Edge], indices: impl Iterator<Item = u32>) {
        self.clear();
        indices.for_each(|index| self.push(&edges[index as usize]));
    }

    /// Keeps the edges that may count for some of the receivers. Each is asked as [`Counter`](crate::coverage) asks: what is left out
    /// would have counted for nobody.
    #[inline(always)]
    pub(crate) fn keep_for<S: Simd>(&mut self, simd: S, sites: &Sites, silhouettes: bool) {
        let by_receivers = by_receivers(sites.len(), self.len());
        let mut kept = 0;
        for vector in 0..self.lanes.vectors() {
            let valid = self.lanes.valid(vector);
            let mut counts = 0;
            if by_receivers {
                for lane in 0..valid.count_ones() as usize {
                    let edge = self.one(simd, vector * LANES + lane);
                    for of in 0..sites.vectors() {
                        if edge.may_count(&sites.sixteen(simd, of), silhouettes) & sites.valid(of) != 0 {
                            counts |= 1 << lane;
                            break;
                        }
                    }
                }
            } else {
                let edge = self.sixteen(simd, vector);
                for receiver in 0..sites.len() {
                    counts |= edge.may_count(&sites.one(simd, receiver), silhouettes);
                    if counts & valid == valid {
                        break;
                    }
                }
            }
            kept = self.lanes.keep(vector, counts & valid, kept);
        }
        self.lanes.resize(kept);
    }

    /// A vector of edges.
    #[inline(always)]
    pub(crate) fn sixteen<S: Simd>(&self, simd: S, vector: usize) -> EdgeVector<S> {
        EdgeVector::of(self.lanes.sixteen(simd, vector), self.has_far)
    }

    /// One edge, sixteen times.
    #[inline(always)]
    pub(crate) fn one<S: Simd>(&self, simd: S, index: usize) -> EdgeVector<S> {
        EdgeVector::of(self.lanes.one(simd, index), self.has_far)
    }

    /// The ends of an edge.
    #[inline]
    pub(crate) fn ends(&self, index: usize) -> [Vec3; 2] {
        [self.lanes.three(index, 0), self.lanes.three(index, 3)]
    }

    /// Vectors that there are.
    #[inline(always)]
    pub(crate) fn vectors(&self) -> usize {
        self.lanes.vectors()
    }

    /// Lanes of a vector that are edges, a bit each.
    #[inline(always)]
    pub(crate) fn valid(&self, vector: usize) -> u64 {
        self.lanes.valid(vector)
    }

    /// Edges there are.
    #[inline(always)]
    pub fn len(&self) -> usize {
        self.lanes.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fearless_simd::{Level, dispatch};
    use glam::Vec4;
    use gnomon_shadow_map::light_maps::Receiver;

    use crate::sites::tests::{numbers, receivers};

    /// Receivers that ask together, an edge at a time, keep what each of them keeps alone, sixteen edges at a time.
    #[test]
    fn what_counts_for_some_counts_for_all_together() {
        let (mut next, mut kept_some) = (numbers(), 0);
        for round in 0..200 {
            let receivers: Vec<(u32, Receiver)> = receivers(&mut next, 1 + round % 40);
            let edges: Vec<Edge> = (0..1 + round % 23)
                .map(|_| Edge {
                    a: Vec3::new(next(), next() - 0.3, next()),
                    b: Vec3::new(next(), next() - 0.3, next()),
                    planes: [Vec4::new(next(), next(), next(), next()), Vec4::ZERO],
                    signs: [1.0, (round % 2) as f32],
                    from_center: 0,
                    far: Vec3::NAN,
                })
                .collect();
            let kept_for = |held: &[(u32, Receiver)]| {
                let (mut tile, mut sites) = (TileEdges::default(), Sites::default());
                edges.iter().for_each(|edge| tile.push(edge));
                sites.place(held, Vec3::ZERO);
                dispatch!(Level::new(), simd => tile.keep_for(simd, &sites, true));
                (0..tile.len()).map(|index| tile.ends(index)).collect::<Vec<_>>()
            };
            let together = kept_for(&receivers);
            let alone: Vec<_> = receivers.iter().map(|&receiver| kept_for(&[receiver])).collect();
            let expected = edges.iter().map(|edge| [edge.a, edge.b]);
            let expected: Vec<_> =
                expected.filter(|ends| alone.iter().any(|kept| kept.contains(ends))).collect();
            assert_eq!(together, expected, "{round}");
            kept_some += usize::from((1..edges.len()).contains(&together.len()));
        }
        assert!(kept_some > 50, "{kept_some}");
    }
}
