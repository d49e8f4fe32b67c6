//! A block's receivers, sixteen at a time: where they are, and the light over each.
//!
//! What is asked of an edge or a face and a receiver is asked of sixteen pairs together: of one receiver and sixteen edges, or of
//! sixteen receivers and one edge, whichever takes fewer turns ([`by_receivers`]). Both are the same function of vectors, which
//! hold either sixteen things or one sixteen times, so that the answers are the same, bit for bit.

use fearless_simd::{Select, Simd, SimdBase, SimdMask, f32x16};
use glam::{Mat3, Vec3};
use gnomon_shadow_map::light_maps::Receiver;
use scene_core::Light;

use crate::coverage::Site;
use crate::lanes::{LANES, Lanes, Named, Source};
use crate::light_cones::{LightCones, coarse};
use crate::vectors::{Vec3x16, dot};

/// Numbers a receiver: from the origin, in world space, its normal, the tolerance; three rows, the orientation, the height, and 1
/// if it has a cone.
const PARTS: usize = 22;
const WORLD: usize = 3;
const NORMAL: usize = 6;
const TOLERANCE: usize = 9;
const ROWS: usize = 10;
const ORIENTATION: usize = 19;
const HEIGHT: usize = 20;
const HAS_CONE: usize = 21;

/// Whether so many receivers and things are asked in fewer turns with sixteen receivers a turn than with sixteen things.
#[inline(always)]
pub(crate) fn by_receivers(receivers: usize, things: usize) -> bool {
    things * receivers.div_ceil(LANES) < receivers * things.div_ceil(LANES)
}

/// Receivers, component by component.
#[derive(Debug, Default)]
pub(crate) struct Sites {
    lanes: Lanes<PARTS>,
    is_parallel: bool,
}

/// Sixteen receivers, or one sixteen times.
#[derive(Clone, Copy)]
pub(crate) struct SiteVector<S: Simd> {
    /// From the edges' origin.
    pub(crate) point: Vec3x16<S>,
    /// World space.
    pub(crate) world: Vec3x16<S>,
    pub(crate) normal: Vec3x16<S>,
    pub(crate) tolerance: f32x16<S>,
    /// o.
    pub(crate) orientation: f32x16<S>,
    rows: [Vec3x16<S>; 3],
}

impl<S: Simd> SiteVector<S> {
    #[inline(always)]
    fn of(numbers: impl Source<S>) -> Self {
        Self {
            point: numbers.three(0),
            world: numbers.three(WORLD),
            normal: numbers.three(NORMAL),
            tolerance: numbers.number(TOLERANCE),
            orientation: numbers.number(ORIENTATION),
            rows: [numbers.three(ROWS), numbers.three(ROWS + 3), numbers.three(ROWS + 6)],
        }
    }

    /// (a, b, t) of points, counted from the receivers.
    #[inline(always)]
    pub(crate) fn locate(&self, from_receiver: Vec3x16<S>) -> Vec3x16<S> {
        let [a, b, t] = self.rows;
        [dot(a, from_receiver), dot(b, from_receiver), dot(t, from_receiver)]
    }
}

impl Sites {
    /// Takes receivers; the light over them is not known yet.
    #[inline(always)]
    pub(crate) fn place(&mut self, receivers: &[(u32, Receiver)], origin: Vec3) {
        self.lanes.resize(receivers.len());
        for (index, (_, receiver)) in receivers.iter().enumerate() {
            let (parts, lane) = (self.lanes.vector_mut(index / LANES), index % LANES);
            let three = [receiver.point - origin, receiver.point, receiver.normal];
            for (kind, vector) in three.into_iter().enumerate() {
                for axis in 0..3 {
                    parts[3 * kind + axis][lane] = vector[axis];
                }
            }
            parts[TOLERANCE][lane] = receiver.tolerance;
        }
    }

    /// Finds the light over each.
    #[inline(always)]
    pub(crate) fn set_light<S: Simd>(&mut self, simd: S, light: &Light) {
        self.is_parallel = matches!(light, Light::Directional { .. });
        let (one, nothing) = (f32x16::splat(simd, 1.0), f32x16::splat(simd, 0.0));
        for vector in 0..self.lanes.vectors() {
            let valid = self.lanes.valid(vector);
            let cones = LightCones::new(simd, light, self.lanes.sixteen(simd, vector).three(WORLD));
            let parts = self.lanes.vector_mut(vector);
            for (part, row) in parts[ROWS..].iter_mut().zip(cones.rows.as_flattened()) {
                *part = row.to_array();
            }
            parts[ORIENTATION] = cones.right_handed.select(-one, one).to_array();
            parts[HEIGHT] = cones.height.to_array().map(coarse);
            parts[HAS_CONE] = cones.there.select(one, nothing).to_array();
            for lane in Named(valid & !cones.there.to_bitmask()) {
                let at = |part: usize| Vec3::from_array([0, 1, 2].map(|axis| parts[part + axis][lane]));
                // b and a are two directions across the way to the light's centre, t is along it.
                let (to_center, _) = light.center().ray_from(at(WORLD));
                let t = to_center.normalize_or(at(NORMAL));
                let (a, b) = t.any_orthonormal_pair();
                for (row, vector) in [a, b, t].into_iter().enumerate() {
                    (0..3).for_each(|axis| parts[ROWS + 3 * row + axis][lane] = vector[axis]);
                }
            }
        }
    }

    /// How many there are.
    pub(crate) fn len(&self) -> usize {
        self.lanes.len()
    }

    /// Vectors that there are.
    pub(crate) fn vectors(&self) -> usize {
        self.lanes.vectors()
    }

    /// Lanes of a vector that are receivers, a bit each.
    #[inline(always)]
    pub(crate) fn valid(&self, vector: usize) -> u64 {
        self.lanes.valid(vector)
    }

    /// Whether nothing lies behind the light.
    pub(crate) fn is_parallel(&self) -> bool {
        self.is_parallel
    }

    /// The light's [`coarse`] height over a receiver; `None` where it has no cone.
    #[inline(always)]
    pub(crate) fn height(&self, index: usize) -> Option<f32> {
        (self.lanes.at(index, HAS_CONE) != 0.0).then(|| self.lanes.at(index, HEIGHT))
    }

    /// A vector of receivers.
    #[inline(always)]
    pub(crate) fn sixteen<S: Simd>(&self, simd: S, vector: usize) -> SiteVector<S> {
        SiteVector::of(self.lanes.sixteen(simd, vector))
    }

    /// One receiver, sixteen times.
    #[inline(always)]
    pub(crate) fn one<S: Simd>(&self, simd: S, index: usize) -> SiteVector<S> {
        SiteVector::of(self.lanes.one(simd, index))
    }

    /// One receiver.
    pub(crate) fn site(&self, index: usize) -> Site {
        let rows = [0, 3, 6].map(|row| self.lanes.three(index, ROWS + row));
        Site {
            point: self.lanes.three(index, 0),
            normal: self.lanes.three(index, NORMAL),
            tolerance: self.lanes.at(index, TOLERANCE),
            light_from_receiver: Mat3::from_cols_array_2d(&rows.map(|row| row.to_array())).transpose(),
            is_parallel: self.is_parallel || self.height(index).is_none(),
        }
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    pub(crate) const LIGHT: Light = Light::Sphere { center: Vec3::new(0.3, 4.0, -0.2), radius: 0.5 };

    /// Numbers from −1 to 1.
    pub(crate) fn numbers() -> impl FnMut() -> f32 {
        let mut state = 1u32;
        move || {
            state = state.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
            (state >> 8) as f32 / (1u32 << 23) as f32 - 1.0
        }
    }

    /// Receivers on uneven ground.
    pub(crate) fn receivers(next: &mut impl FnMut() -> f32, count: usize) -> Vec<(u32, Receiver)> {
        let receiver = |slot: usize| {
            let (point, lean) = (Vec3::new(next(), 0.1 * next(), next()), Vec3::new(next(), 0.0, next()));
            let normal = (Vec3::Y + lean * 0.3).normalize();
            (slot as u32, Receiver { point, normal, object: 0, tolerance: 1e-6, pixel: [0; 2] })
        };
        (0..count).map(receiver).collect()
    }

    #[test]
    fn turns_are_counted() {
        assert!(by_receivers(16, 15) && !by_receivers(16, 16) && !by_receivers(1, 1));
        assert!(by_receivers(64, 40) && !by_receivers(5, 100));
    }
}
