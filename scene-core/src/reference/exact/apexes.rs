//! What all points of a block of pixels see alike.
//!
//! A triangle that turns the same side to every point of a box, and lies well between all of them and the light, adds
//! the same to its edges from everywhere: the edges between two such that cancel are done with for the whole block. Where
//! that is in doubt the triangle is asked about from each point.

use glam::{DVec3, Vec3};

use super::cone::{FARTHEST, Outline};

/// A box around points that look at a light, all from the same side of its plane.
#[derive(Clone, Copy, Debug)]
pub(super) struct Apexes {
    center: DVec3,
    half: DVec3,
    /// The light's normal away from the points.
    facing: DVec3,
    /// +1 if that is the outline's own normal.
    handed: i32,
    /// A point of the light's plane, as a height along `facing`.
    plane: f64,
    /// How far heights of the points along `facing` lie from that of the middle.
    spread: f64,
    /// The largest height of the light over a point.
    deepest: f64,
    /// What the distance of a corner from the middle, times `deepest`, may be over its least height: see [`Self::is_near`].
    reach: f64,
    /// Half the diagonal.
    radius: f64,
    /// Heights closer to 0 than this are in doubt.
    doubt: f64,
}

/// Heights and volumes of a few products in f64 are wrong by less than this part of their terms: 2⁻⁴⁸ ≫ 8·2⁻⁵³.
const ROUNDING: f64 = 1.0 / (1_u64 << 48) as f64;

impl Apexes {
    /// `None` if the points are none, or do not lie on one side of the light's plane.
    pub(super) fn new(outline: &Outline, points: impl Iterator<Item = Vec3>) -> Option<Self> {
        let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for point in points {
            (min, max) = (min.min(point.as_dvec3()), max.max(point.as_dvec3()));
        }
        let (center, half) = (0.5 * (min + max), 0.5 * (max - min));
        let (radius, dual) = (half.length(), outline.duals[0].length().max(outline.duals[1].length()));
        let largest = center.abs() + half + outline.center.abs();
        if outline.is_distant() {
            // Seen at the offset over its height, on a plane at distance 1.
            let usable = largest.is_finite().then_some(outline.normal);
            return usable.map(|facing| Self {
                center,
                half,
                facing,
                handed: 1,
                plane: f64::INFINITY,
                spread: facing.abs().dot(half),
                deepest: 1.0,
                reach: FARTHEST * outline.reach / dual,
                radius,
                doubt: ROUNDING * facing.abs().dot(largest),
            });
        }
        let away = outline.center - center;
        let is_ours = away.dot(outline.normal) >= 0.0;
        let facing = if is_ours { outline.normal } else { -outline.normal };
        let spread = facing.abs().dot(half);
        let doubt = ROUNDING * facing.abs().dot(largest);
        let depth = away.dot(facing);
        let reach = FARTHEST * outline.reach / dual - away.length() - radius;
        // Cones move an apex that lies all but in the light's plane; such do not share.
        let size = away.length() + radius + outline.axes[0].length() + outline.axes[1].length();
        let usable = depth - spread > size * facing.length() * 2f64.powi(-29) && reach > 0.0;
        let handed = if is_ours { 1 } else { -1 };
        let plane = facing.dot(outline.center);
        (usable && largest.is_finite()).then_some(Self {
            center,
            half,
            facing,
            handed,
            plane,
            spread,
            deepest: depth + spread,
            reach,
            radius,
            doubt,
        })
    }

    /// Whether the corner lies between all points and the light, where it is projected without loss of digits: no farther
    /// from the light's middle than [`FARTHEST`] half sides.
    ///
    /// From a point o the corner p, at height w over it, is seen at o + (p − o)·depth/w. Along the light's plane that is no
    /// farther from its middle than (|p − c| + radius)·deepest/w + |middle − c| + radius, |p − c| along the plane, too.
    fn is_near(&self, corner: DVec3) -> bool {
        let offset = corner - self.center;
        let height = self.facing.dot(offset);
        let least = height - self.spread;
        let along = offset - self.facing * (height / self.facing.length_squared());
        let before = self.plane - self.facing.dot(corner);
        let room = self.reach * least - self.radius * self.deepest;
        least > self.doubt
            && before > self.doubt
            && room > 0.0
            && along.length_squared() * self.deepest * self.deepest <= room * room
    }

    /// The winding of the triangle's shadow on the light, if it is the same from all points and the shadow is whole.
    pub(super) fn winding(&self, corners: [Vec3; 3]) -> Option<i32> {
        let [a, b, c] = corners.map(|corner| corner.as_dvec3());
        let normal = (b - a).cross(c - a);
        let height = normal.dot(a - self.center);
        let sure = height.abs() > normal.abs().dot(self.half) * (1.0 + 1e-9);
        let is_whole = sure && self.is_near(a) && self.is_near(b) && self.is_near(c);
        is_whole.then_some(if height > 0.0 { self.handed } else { -self.handed })
    }
}
