//! What a spot light reaches of a window: no texel is spent beyond its cone.

use std::f64::consts::FRAC_PI_2;

use glam::{DMat3, DVec2, DVec3};

/// The cone of a spot light.
pub(super) struct Cone {
    /// Unit vector in its middle, world space.
    pub(super) axis: DVec3,
    /// Between the axis and the rim, in radians.
    pub(super) angle: f64,
}

impl Cone {
    /// Bounds of x/z and y/z over the cone's directions in front of a window with these axes.
    ///
    /// Seen along y, the cone is a wedge around its axis' image (x, z): a direction d has d·axis ≥ cos angle, and the
    /// largest angle of its image from that of the axis is asin(sin angle / |(x, z)|). Infinite where that reaches a
    /// right angle from the window's own axis.
    pub(super) fn tangents(&self, axes: DMat3) -> [DVec2; 2] {
        let axis = axes.transpose() * self.axis;
        let along = |x: f64| {
            let spread = self.angle.sin() / x.hypot(axis.z);
            // The cone holds the way along which it is seen, or more than a half-space.
            if self.angle >= FRAC_PI_2 || spread.is_nan() || spread >= 1.0 {
                return [f64::NEG_INFINITY, f64::INFINITY];
            }
            let (middle, half) = (x.atan2(axis.z), spread.asin());
            let low = if middle - half > -FRAC_PI_2 { (middle - half).tan() } else { f64::NEG_INFINITY };
            let high = if middle + half < FRAC_PI_2 { (middle + half).tan() } else { f64::INFINITY };
            [low, high]
        };
        let ([left, right], [bottom, top]) = (along(axis.x), along(axis.y));
        [DVec2::new(left, bottom), DVec2::new(right, top)]
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        /// Every direction of the cone lies within the bounds, and the farthest ones come near them.
        #[test]
        fn bounds_hold_the_cone_and_touch_it(
            x in -0.9f64..0.9, y in -0.9f64..0.9, angle in 0.05f64..1.3,
        ) {
            let cone = Cone { axis: DVec3::new(x, y, 1.0).normalize(), angle };
            let [low, high] = cone.tangents(DMat3::IDENTITY);
            let (u, v) = cone.axis.any_orthonormal_pair();
            let (mut least, mut most) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
            let mut is_ahead = true;
            for i in 0..720 {
                let (sin, cos) = (f64::from(i) / 720.0 * std::f64::consts::TAU).sin_cos();
                let direction = cone.axis * angle.cos() + (u * cos + v * sin) * angle.sin();
                if direction.z <= 1e-3 {
                    is_ahead = false;
                    continue;
                }
                let tangents = direction.truncate() / direction.z;
                prop_assert!(tangents.cmpge(low - 1e-9).all() && tangents.cmple(high + 1e-9).all());
                (least, most) = (least.min(tangents), most.max(tangents));
            }
            if is_ahead && low.is_finite() && high.is_finite() {
                let size = high - low;
                prop_assert!(((least - low).abs() + (high - most).abs()).cmple(size * 0.01).all());
            }
        }
    }
}
