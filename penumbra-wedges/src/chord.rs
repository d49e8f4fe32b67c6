//! An edge on the light's plane: projected from the receiver and clipped to the square around the light, in homogeneous
//! coordinates. Szabó, 7.7.

use glam::{DVec2, DVec3};

/// The part of an edge before the square [−1, 1]².
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Chord {
    /// Where it begins.
    pub start: DVec2,
    /// Where it ends.
    pub end: DVec2,
}

impl Chord {
    /// The chord of the edge from `a` to `b`, in the coordinates of
    /// [`LightFrame::project`](crate::area_light::LightFrame::project); `None` if no part of it lies between the receiver and
    /// the square.
    ///
    /// Inside are the points with |U| ≤ W and |V| ≤ W, which also have W ≥ 0: what is behind the receiver is clipped before
    /// anything is divided, and never comes out on the wrong side. Of a light at a place (`is_finite`) nothing beyond it
    /// counts, W ≤ 1. All of these are linear along the edge. An end that is inside stays as it is, to the bit, whatever
    /// edge it is an end of.
    #[inline(always)]
    pub fn clipped(a: DVec3, b: DVec3, is_finite: bool) -> Option<Self> {
        let heights = |p: DVec3| {
            let beyond = if is_finite { 1.0 - p.z } else { 0.0 };
            [p.z - p.x, p.z + p.x, p.z - p.y, p.z + p.y, beyond]
        };
        let (of_a, of_b) = (heights(a), heights(b));
        let (mut first, mut last) = (0.0_f64, 1.0_f64);
        for (a, b) in of_a.into_iter().zip(of_b) {
            if a < 0.0 {
                if b < 0.0 {
                    return None;
                }
                first = first.max(a / (a - b));
            } else if b < 0.0 {
                last = last.min(a / (a - b));
            }
        }
        if first > last {
            return None;
        }
        let start = if first > 0.0 { a + (b - a) * first } else { a };
        let end = if last < 1.0 { a + (b - a) * last } else { b };
        // An end in the receiver itself is nowhere on the plane.
        let has_place = start.z > 0.0 && end.z > 0.0;
        has_place.then(|| Self { start: start.truncate() / start.z, end: end.truncate() / end.z })
    }

    /// The part inside the unit circle.
    #[inline]
    pub fn in_disk(&self) -> Option<Self> {
        let way = self.end - self.start;
        let (squared, along) = (way.length_squared(), -self.start.dot(way));
        if squared == 0.0 {
            return (self.start.length_squared() <= 1.0).then_some(*self);
        }
        // |start + t·way|² = 1, by its middle and half its length in t.
        let across = self.start.perp_dot(way);
        let root = squared - across * across;
        if root <= 0.0 {
            return None;
        }
        let (middle, half) = (along / squared, root.sqrt() / squared);
        let (first, last) = ((middle - half).max(0.0), (middle + half).min(1.0));
        let at = |t: f64, end: DVec2| if t > 0.0 && t < 1.0 { self.start + way * t } else { end };
        (first < last).then(|| Self { start: at(first, self.start), end: at(last, self.end) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(u: f64, v: f64, w: f64) -> DVec3 {
        DVec3::new(u * w, v * w, w)
    }

    #[test]
    fn ends_inside_stay_and_others_are_cut() {
        let inside = at(0.3, -0.2, 0.5);
        let chord = Chord::clipped(inside, at(3.0, -0.2, 0.5), true).unwrap();
        assert_eq!(chord.start, inside.truncate() / 0.5);
        assert!((chord.end - DVec2::new(1.0, -0.2)).length() < 1e-15);
        assert!(Chord::clipped(at(1.1, 0.0, 0.5), at(3.0, 0.5, 0.2), true).is_none());
        // Past a corner.
        assert!(Chord::clipped(at(1.5, 0.0, 0.5), at(0.0, 1.5, 0.5), true).is_some());
        assert!(Chord::clipped(at(2.5, 0.0, 0.5), at(0.0, 2.5, 0.5), true).is_none());
    }

    #[test]
    fn what_is_behind_the_receiver_or_beyond_the_light_is_cut_off() {
        // From before the receiver through the plane W = 0 to behind it: the projection of the far end alone would lie at
        // (0.3, 0), inside.
        let behind = at(0.3, 0.0, -0.5);
        let chord = Chord::clipped(at(0.0, 0.0, 0.5), behind + DVec3::Y, true).unwrap();
        assert!(chord.end.y > 0.99 && chord.start == DVec2::ZERO);
        assert!(Chord::clipped(behind, at(0.1, 0.1, -2.0), true).is_none());
        assert!(Chord::clipped(at(0.1, 0.0, 1.5), at(0.0, 0.1, 1.2), true).is_none());
        assert!(Chord::clipped(at(0.1, 0.0, 1.5), at(0.0, 0.1, 1.2), false).is_some());
        let cut = Chord::clipped(DVec3::new(0.0, 0.0, 0.5), DVec3::new(1.0, 0.0, 1.5), true).unwrap();
        assert!((cut.end - DVec2::new(0.5, 0.0)).length() < 1e-15);
        assert!(Chord::clipped(DVec3::ZERO, at(0.1, 0.1, 0.5), true).is_none());
    }

    #[test]
    fn the_unit_circle_cuts_chords() {
        let chord = |a: [f64; 2], b: [f64; 2]| Chord { start: a.into(), end: b.into() }.in_disk();
        let cut = chord([-1.0, 0.6], [1.0, 0.6]).unwrap();
        assert!((cut.start - DVec2::new(-0.8, 0.6)).length() < 1e-15);
        assert!((cut.end - DVec2::new(0.8, 0.6)).length() < 1e-15);
        assert_eq!(
            chord([0.1, 0.2], [0.3, 0.4]),
            Some(Chord { start: [0.1, 0.2].into(), end: [0.3, 0.4].into() })
        );
        assert_eq!(chord([0.9, 0.9], [0.8, 0.9]), None);
        assert_eq!(chord([-1.0, 1.0], [1.0, 1.0]), None);
        assert_eq!(chord([0.9, 0.9], [0.9, 0.9]), None);
    }
}
