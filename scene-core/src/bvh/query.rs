//! The queries of a [`Bvh`]: from what callers ask to shafts and back.

use fearless_simd::dispatch;
use glam::Vec3;

use super::exact;
use super::shaft::{MAX_RAYS, Shaft};
use super::tree::Link;
use super::walk::{self, Cutout};
use super::{Bvh, Hit};
use crate::light::LightPoint;

/// Rays of a small packet, for which less is set up.
const FEW: usize = 16;

impl Bvh {
    /// The first triangle that the ray from `origin` along `direction` meets with `t_min ≤ t ≤ t_max`, t in
    /// units of the direction. Of triangles met at the very same place the one of lowest index.
    ///
    /// Whether a triangle is met is exact (see the module), t and weights are rounded from f64. Nothing for a
    /// zero direction or input that is not finite (`t_max` may be infinite).
    pub fn closest_hit(&self, origin: Vec3, direction: Vec3, t_min: f32, t_max: f32) -> Option<Hit> {
        if !origin.is_finite() || !direction.is_finite() || direction == Vec3::ZERO {
            return None;
        }
        let ends = direction.to_array().map(|end| [end]);
        let (t_min, t_max) = (f64::from(t_min), f64::from(t_max));
        let fits = Shaft::can_reach(origin, self.tree.bounds);
        let first = dispatch!(self.level, simd => {
            match Shaft::new(simd, origin, &ends, 1, false).filter(|_| fits) {
                Some((shaft, rays)) => {
                    walk::closest(simd, &self.tree, self.masks.as_ref(), &shaft, &rays, t_min, t_max)
                }
                None => self.closest_slowly(origin, direction, t_min, t_max),
            }
        })?;
        let [u, v] = first.crossing.weights;
        Some(Hit { t: first.crossing.t as f32, triangle: first.triangle, u: u as f32, v: v as f32 })
    }

    /// Whether anything blocks the light that comes from `target` to `origin`. Nothing does if the two are one,
    /// the direction is zero, or a coordinate is not finite.
    pub fn is_occluded(&self, origin: Vec3, target: LightPoint) -> bool {
        self.occluded_packed::<1>(origin, &[target]) != 0
    }

    /// For each of `targets`, usually samples of one light, whether anything blocks it from `origin`; what
    /// `blocked` held before is overwritten. The same as [`Bvh::is_occluded`] for each, bit for bit, and much faster,
    /// the more so if targets that are near each other in space are near each other in the list.
    ///
    /// # Panics
    /// If `targets` and `blocked` differ in length.
    pub fn occluded_from(&self, origin: Vec3, targets: &[LightPoint], blocked: &mut [bool]) {
        assert_eq!(targets.len(), blocked.len(), "as many answers as targets");
        for (targets, blocked) in targets.chunks(MAX_RAYS).zip(blocked.chunks_mut(MAX_RAYS)) {
            let mask = self.occluded_mask(origin, targets);
            for (bit, blocked) in blocked.iter_mut().enumerate() {
                *blocked = mask >> bit & 1 == 1;
            }
        }
    }

    /// For each pair of origin and target, as the pixels of a tile have, whether anything blocks the light between
    /// them: [`Bvh::is_occluded`] for each, bit for bit; what `blocked` held before is overwritten. Coherent rays
    /// are fastest.
    ///
    /// # Panics
    /// If the three differ in length.
    pub fn occluded_packet(&self, origins: &[Vec3], targets: &[LightPoint], blocked: &mut [bool]) {
        assert!(origins.len() == targets.len() && targets.len() == blocked.len(), "one answer a ray");
        for ((&origin, &target), blocked) in origins.iter().zip(targets).zip(blocked) {
            *blocked = self.is_occluded(origin, target);
        }
    }

    /// [`Bvh::occluded_from`] for at most 64 targets, as bits: bit i says that target i is blocked. Targets past
    /// the 64th are ignored.
    pub fn occluded_mask(&self, origin: Vec3, targets: &[LightPoint]) -> u64 {
        match targets.len() {
            0..=1 => self.occluded_packed::<1>(origin, targets),
            2..=FEW => self.occluded_packed::<FEW>(origin, targets),
            _ => self.occluded_packed::<MAX_RAYS>(origin, targets),
        }
    }

    fn occluded_packed<const N: usize>(&self, origin: Vec3, targets: &[LightPoint]) -> u64 {
        let mut ends = [[0.0; N]; 3];
        // Rays that stop, and rays that go on.
        let mut masks = [0_u64; 2];
        for (ray, &target) in targets.iter().take(N).enumerate() {
            let (end, kind) = match target {
                LightPoint::At(point) => (point - origin, 0),
                LightPoint::Towards(direction) => (direction, 1),
            };
            for axis in 0..3 {
                ends[axis][ray] = end[axis];
            }
            // A ray of no length, or with a coordinate that is not finite, is not blocked.
            let is_ray = end.is_finite() && end != Vec3::ZERO;
            masks[kind] |= u64::from(is_ray) << ray;
        }
        if !origin.is_finite() {
            return 0;
        }
        self.occluded_ends(origin, &ends, masks[0], true) | self.occluded_ends(origin, &ends, masks[1], false)
    }

    #[expect(clippy::manual_map, reason = "a closure would be compiled apart, without the vector unit")]
    fn occluded_ends<const N: usize>(
        &self,
        origin: Vec3,
        ends: &[[f32; N]; 3],
        mask: u64,
        finite: bool,
    ) -> u64 {
        if mask == 0 {
            return 0;
        }
        if !Shaft::can_reach(origin, self.tree.bounds) {
            return self.occluded_slowly(origin, ends, mask, finite);
        }
        let blocked = dispatch!(self.level, simd => {
            match Shaft::new(simd, origin, ends, mask, finite) {
                Some((shaft, rays)) => {
                    Some(walk::occluded(simd, &self.tree, self.masks.as_ref(), &shaft, &rays))
                }
                None => None,
            }
        });
        if let Some(blocked) = blocked {
            return blocked;
        }
        if mask.is_power_of_two() {
            return self.occluded_slowly(origin, ends, mask, finite);
        }
        // Too wide for one shaft: by the half of the space each ray goes to, then by order.
        let half = half_of(ends, mask);
        self.occluded_ends(origin, ends, half, finite)
            | self.occluded_ends(origin, ends, mask & !half, finite)
    }

    /// The exact test of every triangle whose box the ray may cross, for coordinates outside the range of the
    /// f32 filters.
    fn each_candidate(&self, origin: Vec3, direction: Vec3, mut test: impl FnMut(Link, usize, [Vec3; 3])) {
        let mut pending: Vec<_> = self.tree.root.into_iter().collect();
        while let Some(link) = pending.pop() {
            if link.is_leaf() {
                for lane in 0..link.count() {
                    let corners = self.tree.blocks[link.index()].triangle(lane).map(|v| v - origin);
                    test(link, lane, corners);
                }
                continue;
            }
            let node = &self.tree.nodes[link.index()];
            for slot in 0..node.count as usize {
                let lo = Vec3::from_array(node.lo.map(|axis| axis[slot])) - origin;
                let hi = Vec3::from_array(node.hi.map(|axis| axis[slot])) - origin;
                if may_cross(lo, hi, direction) {
                    pending.push(node.links[slot]);
                }
            }
        }
    }

    #[cold]
    fn occluded_slowly<const N: usize>(
        &self,
        origin: Vec3,
        ends: &[[f32; N]; 3],
        mask: u64,
        finite: bool,
    ) -> u64 {
        let mut blocked = 0;
        for ray in (0..N).filter(|ray| mask >> ray & 1 == 1) {
            let end = Vec3::from_array(ends.map(|axis| axis[ray]));
            self.each_candidate(origin, end, |link, lane, corners| {
                let crosses = if finite {
                    exact::segment_crosses(corners, end)
                } else {
                    exact::ray_crosses(corners, end)
                };
                if crosses && self.is_solid(link, lane, || exact::crossing(corners, end)) {
                    blocked |= 1 << ray;
                }
            });
        }
        blocked
    }

    #[cold]
    fn closest_slowly(&self, origin: Vec3, direction: Vec3, t_min: f64, t_max: f64) -> Option<walk::First> {
        let mut best: Option<walk::First> = None;
        self.each_candidate(origin, direction, |link, lane, corners| {
            let Some(crossing) = exact::crossing(corners, direction) else { return };
            let triangle = self.tree.triangles[link.index()][lane];
            let closer = best.is_none_or(|b| (crossing.t, triangle) < (b.crossing.t, b.triangle));
            let within = (t_min..=t_max).contains(&crossing.t);
            if closer && within && self.is_solid(link, lane, || Some(crossing)) {
                best = Some(walk::First { crossing, triangle });
            }
        });
        best
    }

    fn is_solid(&self, link: Link, lane: usize, crossing: impl FnOnce() -> Option<exact::Crossing>) -> bool {
        let Some(masks) = self.masks.as_ref().filter(|m| m.lanes(link.index()) >> lane & 1 == 1) else {
            return true;
        };
        crossing().is_none_or(|crossing| masks.is_solid(link.index(), lane, &crossing))
    }
}

/// A part of the rays in `mask`, neither none nor all of them: those on one side of the origin along an axis that
/// parts them, else every second one.
fn half_of<const N: usize>(ends: &[[f32; N]; 3], mask: u64) -> u64 {
    for axis in ends {
        let positive = (0..N).filter(|&ray| axis[ray] > 0.0).fold(0_u64, |bits, ray| bits | 1 << ray);
        let half = mask & positive;
        if half != 0 && half != mask {
            return half;
        }
    }
    let mut half = 0;
    let mut rest = mask;
    while rest != 0 {
        half |= rest & rest.wrapping_neg();
        rest &= rest - 1;
        rest &= rest.wrapping_sub(1);
    }
    half
}

/// Whether the ray from 0 along `direction` may cross the box, erring to yes: slabs in f64, where the coordinates
/// of f32 and their quotients neither overflow nor underflow.
fn may_cross(lo: Vec3, hi: Vec3, direction: Vec3) -> bool {
    let (mut near, mut far) = (0.0_f64, f64::INFINITY);
    for axis in 0..3 {
        let d = f64::from(direction[axis]);
        let (lo, hi) = (f64::from(lo[axis]), f64::from(hi[axis]));
        if d == 0.0 {
            if lo > 0.0 || hi < 0.0 {
                return false;
            }
        } else {
            let (a, b) = (lo / d, hi / d);
            near = near.max(a.min(b));
            far = far.min(a.max(b));
        }
    }
    // Quotients are rounded by at most 2⁻⁵³ of themselves each.
    near <= far * (1.0 + 4.0 * f64::EPSILON)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{ObjectFlags, Scene, TriangleMesh};
    use fearless_simd::Level;
    use glam::Affine3A;

    /// Points of [−1, 1]³ by golden-ratio steps.
    fn point(i: u32) -> Vec3 {
        let at = |step: f64| ((f64::from(i) * step).fract() * 2.0 - 1.0) as f32;
        Vec3::new(at(0.819_172_513), at(0.671_043_607), at(0.549_700_478))
    }

    #[test]
    fn every_vector_unit_gives_the_same_answers() {
        let positions: Vec<_> = (0..900).map(|i| point(i / 3 * 7) + point(i + 5000) * 0.2).collect();
        let triangles = (0..300).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let mut scene = Scene::new();
        let mesh = TriangleMesh::new("soup", positions, triangles);
        scene.add(&mesh, Affine3A::IDENTITY, ObjectFlags::default()).unwrap();
        let best = Bvh::all(&scene);
        let mut others = vec![Level::baseline()];
        #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
        {
            others.extend(best.level.as_sse4_2().map(Level::Sse4_2));
            others.extend(best.level.as_avx2().map(Level::Avx2));
        }
        for level in others {
            let other = Bvh { level, ..best.clone() };
            for packet in 0..300 {
                let origin = point(packet + 20_000) * 1.5;
                let count = [1, 5, 16, 64][packet as usize % 4];
                let targets: Vec<_> =
                    (0..count).map(|i| LightPoint::At(point(packet * 64 + i) * 2.0)).collect();
                let blocked = best.occluded_mask(origin, &targets);
                assert_eq!(blocked, other.occluded_mask(origin, &targets));
                let direction = point(packet + 40_000);
                let hit = |bvh: &Bvh| bvh.closest_hit(origin, direction, 0.0, f32::INFINITY);
                assert_eq!(hit(&best), hit(&other));
                // The exact walk that knows no vectors agrees as well.
                let ends = [0, 1, 2].map(|axis| [(point(packet * 64) * 2.0 - origin)[axis]]);
                assert_eq!(blocked & 1, other.occluded_slowly(origin, &ends, 1, true));
            }
        }
    }
}
