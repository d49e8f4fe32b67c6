//! From world space to fixed-point pixels: the one place where a vertex is projected and snapped.

use glam::{DMat4, DVec3, DVec4, Vec3};

/// Subpixel bits of a snapped coordinate.
pub(super) const SUBPIXEL_BITS: u32 = 8;
/// Subpixel steps a pixel.
pub(super) const SUBPIXELS: i32 = 1 << SUBPIXEL_BITS;

/// Guard band in pixels: coordinates outside are clipped. With these limits an edge spans at most 3·2²² steps,
/// so that its function stays below 2⁴⁸ and i64 is ample.
pub(super) const GUARD_MIN: f64 = -16_384.0;
/// Upper end of the guard band; twice the largest target.
pub(super) const GUARD_MAX: f64 = 32_768.0;

/// Nothing is drawn at or behind this w. Any positive number below the smallest product of two f32 does: it
/// only keeps the eye itself out of a division.
pub(super) const MIN_W: f64 = 1e-100;

/// What a vertex is outside of. A triangle whose corners share a bit cannot be seen.
pub(super) mod flags {
    /// Left of the target.
    pub(crate) const LEFT: i32 = 1;
    /// Right of it.
    pub(crate) const RIGHT: i32 = 2;
    /// Above it.
    pub(crate) const TOP: i32 = 4;
    /// Below it.
    pub(crate) const BOTTOM: i32 = 8;
    /// Behind the plane of the eye.
    pub(crate) const BEHIND: i32 = 16;
    /// Before the near plane.
    pub(crate) const NEAR: i32 = 32;
    /// Beyond the far plane.
    pub(crate) const FAR: i32 = 64;
    /// Outside the guard band: the snapped position does not exist.
    pub(crate) const GUARD: i32 = 128;
    /// A triangle with a corner so marked is clipped in f64.
    pub(crate) const CLIP: i32 = NEAR | FAR | GUARD;
    /// Corners that all have one of these hide their triangle, whatever becomes of depths out of range.
    pub(crate) const SIDES: i32 = LEFT | RIGHT | TOP | BOTTOM | BEHIND;
}

/// A projected vertex: x and y in 1/256 pixel, bits of its nearness (f32), [`flags`].
pub(super) type ScreenVertex = [i32; 4];

/// A projection onto a target of pixels. Its depth is *nearness*: reversed depth as it is, forward depth
/// negated, so that the larger is always the nearer.
#[derive(Clone, Debug)]
pub(super) struct Projection {
    /// Rows that yield x and y in pixels (y down), nearness, and w; the first three times w.
    rows: [DVec4; 4],
    width: f64,
    height: f64,
    /// Nearness of the far and of the near plane.
    pub(super) range: [f64; 2],
}

impl Projection {
    /// A target of `width` × `height` pixels; `reversed` says that depth is 1 at the near plane.
    pub(super) fn new(clip_from_world: &DMat4, width: u32, height: u32, reversed: bool) -> Self {
        let (width, height) = (f64::from(width), f64::from(height));
        let [x, y, z, w] = [0, 1, 2, 3].map(|i| clip_from_world.row(i));
        let (z, range) = if reversed { (z, [0.0, 1.0]) } else { (-z, [-1.0, 0.0]) };
        let rows = [(x + w) * (width * 0.5), (w - y) * (height * 0.5), z, w];
        // Without this a matrix full of NaN would still have to be clipped triangle by triangle.
        let rows = if rows.iter().all(|r| r.is_finite()) { rows } else { [DVec4::ZERO; 4] };
        Self { rows, width, height, range }
    }

    /// Homogeneous pixel coordinates: x·w, y·w, nearness·w, w.
    #[inline(always)]
    pub(super) fn homogeneous(&self, position: Vec3) -> DVec4 {
        let (x, y, z) = (f64::from(position.x), f64::from(position.y), f64::from(position.z));
        let apply = |r: &DVec4| r.x * x + r.y * y + r.z * z + r.w;
        let [px, py, nearness, w] = &self.rows;
        DVec4::new(apply(px), apply(py), apply(nearness), apply(w))
    }

    /// Projects one vertex. Written without branches, so that a loop over it becomes vector code.
    #[inline(always)]
    pub(super) fn vertex(&self, position: Vec3) -> ScreenVertex {
        let p = self.homogeneous(position);
        let inverse = 1.0 / p.w;
        let (x, y, nearness) = (p.x * inverse, p.y * inverse, p.z * inverse);
        let bit = |outside: bool, flag: i32| if outside { flag } else { 0 };
        // Single `&`, so that there is nothing to branch on.
        let guard = GUARD_MIN..=GUARD_MAX;
        let snappable = (p.w > MIN_W) & guard.contains(&x) & guard.contains(&y);
        let outside = bit(p.x < 0.0, flags::LEFT)
            | bit(p.x > self.width * p.w, flags::RIGHT)
            | bit(p.y < 0.0, flags::TOP)
            | bit(p.y > self.height * p.w, flags::BOTTOM)
            | bit(p.w <= MIN_W, flags::BEHIND)
            | bit(p.z > self.range[1] * p.w, flags::NEAR)
            | bit(p.z < self.range[0] * p.w, flags::FAR)
            | bit(!snappable, flags::GUARD);
        [snap(x), snap(y), (nearness as f32).to_bits() as i32, outside]
    }

    /// The snapped position of a point in homogeneous pixel coordinates and its nearness. The point is
    /// clipped: before the eye and, up to rounding, inside the guard band.
    pub(super) fn snap_clipped(p: DVec4) -> (i32, i32, f64) {
        let inverse = 1.0 / p.w;
        let x = (p.x * inverse).clamp(GUARD_MIN, GUARD_MAX);
        let y = (p.y * inverse).clamp(GUARD_MIN, GUARD_MAX);
        (snap(x), snap(y), p.z * inverse)
    }

    /// x·w, y·w and w: what perspective-correct weights are made of.
    pub(super) fn plane_point(&self, position: Vec3) -> DVec3 {
        let p = self.homogeneous(position);
        DVec3::new(p.x, p.y, p.w)
    }
}

/// The nearest multiple of 1/256 pixel, ties to even. Outside ±2²³ pixels and for NaN it is meaningless.
#[inline(always)]
fn snap(pixels: f64) -> i32 {
    // Adding 1.5·2⁵² moves the integer part into the lowest bits of the mantissa, rounded by the addition
    // itself: unlike a checked conversion this is one instruction in every vector set.
    const SHIFT: f64 = 6_755_399_441_055_744.0;
    (pixels * f64::from(SUBPIXELS) + SHIFT).to_bits() as i32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn snapping_rounds_to_even_on_both_sides_of_zero() {
        assert_eq!(snap(0.0), 0);
        assert_eq!(snap(1.5), 384);
        assert_eq!(snap(-1.5), -384);
        assert_eq!(snap(0.5 / 256.0), 0);
        assert_eq!(snap(1.5 / 256.0), 2);
        assert_eq!(snap(-1.5 / 256.0), -2);
        assert_eq!(snap(GUARD_MAX), 8_388_608);
    }

    #[test]
    fn identity_maps_the_square_to_the_target_with_y_down() {
        let projection = Projection::new(&DMat4::IDENTITY, 64, 32, true);
        let [x, y, z, outside] = projection.vertex(Vec3::new(-1.0, 1.0, 0.25));
        assert_eq!((x, y, f32::from_bits(z as u32), outside), (0, 0, 0.25, 0));
        let [x, y, _, outside] = projection.vertex(Vec3::new(1.0, -1.0, 0.25));
        assert_eq!((x, y, outside), (64 * 256, 32 * 256, 0));
    }

    #[test]
    fn every_side_has_its_flag() {
        let projection = Projection::new(&DMat4::IDENTITY, 64, 64, true);
        for (position, flag) in [
            (Vec3::new(-1.5, 0.0, 0.5), flags::LEFT),
            (Vec3::new(1.5, 0.0, 0.5), flags::RIGHT),
            (Vec3::new(0.0, 1.5, 0.5), flags::TOP),
            (Vec3::new(0.0, -1.5, 0.5), flags::BOTTOM),
            (Vec3::new(0.0, 0.0, 1.5), flags::NEAR),
            (Vec3::new(0.0, 0.0, -0.5), flags::FAR),
            (Vec3::new(1e30, 0.0, 0.5), flags::RIGHT | flags::GUARD),
        ] {
            assert_eq!(projection.vertex(position)[3], flag, "{position}");
        }
        let forward = Projection::new(&DMat4::IDENTITY, 64, 64, false);
        assert_eq!(forward.vertex(Vec3::new(0.0, 0.0, 1.5))[3], flags::FAR);
    }

    #[test]
    fn a_broken_matrix_puts_everything_behind_the_eye() {
        let projection = Projection::new(&DMat4::from_cols_array(&[f64::NAN; 16]), 64, 64, true);
        assert_ne!(projection.vertex(Vec3::ONE)[3] & flags::BEHIND, 0);
    }
}
