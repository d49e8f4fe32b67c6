//! `coverage`: the area of the light behind each edge of one silhouette. Szabó, 7.7.
//!
//! # The sum
//! Let O be the light's middle, and c(q) the number of layers between the receiver and a point q of the light. Whoever goes
//! straight from O to q crosses edges of the silhouette, each of which changes c by its m(e) ([`depth_complexity`] says
//! with what sign). So the mean of c over the light is
//!
//! > c(O) + Σ m(e)·A(e) / |Λ|,
//!
//! where A(e) is the area of what lies behind the edge as seen from O: the sector of the light between the directions to
//! the ends of the edge's chord, less the triangle of O and the chord, and negative if the edge runs clockwise around O. V is
//! 1 less that mean, where no more than one layer lies before any point.
//!
//! | the light | sector between P and Q | triangle |
//! | --- | --- | --- |
//! | square | half the way along the border from P's direction to Q's: every side is 1 away from O | P × Q / 2 |
//! | disk | φ / 2, φ the angle | P × Q / 2 |
//! | cap, by solid angle | φ·(1 − cos θ) | spherical excess: tan(E/2) = P × Q / (\|P\|\|Q\| + \|P\| + \|Q\| + P·Q + 1) for (P, 1) of length \|P\| |
//!
//! # What it does not know
//! * The silhouette is that of the light's middle, not of each of its points.
//! * Layers add up: where two casters hide the same part of the light, it counts twice. V is clamped.
//!
//! [`depth_complexity`]: crate::depth_complexity

use std::f64::consts::TAU;

use glam::DVec2;

use crate::area_light::Outline;
use crate::chord::Chord;
use crate::exact::{Exact, Work};
use crate::layers::layers_before;
use crate::receiver::Receiver;
use crate::wedges::FromMiddle;

/// What is asked for V.
#[derive(Clone, Copy, Debug)]
pub struct Coverage<'a> {
    /// Scene, tree, edges and wedges.
    pub all: Exact<'a>,
    /// Layers.
    pub middle: &'a FromMiddle,
}

/// The share of the light behind a chord, as seen from its middle: positive if the chord runs counter-clockwise around it.
#[inline]
pub fn share_behind(outline: Outline, chord: &Chord) -> f64 {
    let chord = match outline {
        Outline::Square => *chord,
        Outline::Disk | Outline::Cap(_) => match chord.in_disk() {
            Some(chord) => chord,
            None => return 0.0,
        },
    };
    let (p, q) = (chord.start, chord.end);
    let across = p.perp_dot(q);
    let angle = || across.atan2(p.dot(q));
    match outline {
        Outline::Square => {
            let mut way = border(q) - border(p);
            // The shorter way round, which is the one that the chord's turn says.
            if way > 4.0 || (way == 4.0 && across < 0.0) {
                way -= 8.0;
            } else if way < -4.0 || (way == -4.0 && across >= 0.0) {
                way += 8.0;
            }
            (way - across) / 8.0
        }
        Outline::Disk => (angle() - across) / TAU,
        Outline::Cap(tan) => {
            let (p, q) = (p * tan, q * tan);
            let secant = tan.hypot(1.0);
            let height = tan * tan / (secant * (1.0 + secant));
            let (of_p, of_q) = (p.length().hypot(1.0), q.length().hypot(1.0));
            let excess = 2.0 * p.perp_dot(q).atan2(of_p * of_q + of_p + of_q + p.dot(q) + 1.0);
            (angle() * height - excess) / (TAU * height)
        }
    }
}

/// Where a direction from the middle leaves the square [−1, 1]², along its border, from 0 to 8.
#[inline]
fn border(d: DVec2) -> f64 {
    if d.x.abs() >= d.y.abs() {
        // The right and the left side; the middle itself is anywhere.
        let at = if d.x == 0.0 { 0.0 } else { d.y / d.x };
        let at = if d.x >= 0.0 { at } else { 4.0 + at };
        if at < 0.0 { at + 8.0 } else { at }
    } else {
        let at = -d.x / d.y;
        if d.y > 0.0 { 2.0 + at } else { 6.0 + at }
    }
}

impl Coverage<'_> {
    /// V of a receiver before clamping, by those of `edges` that are in question; `None` where no plane serves to
    /// draw edges on.
    #[inline(always)]
    pub fn unclamped(&self, receiver: &Receiver, edges: &[u32], work: &mut Work) -> Option<f64> {
        work.asked += 1;
        let Exact { scene, tree, wedges, skip } = self.all;
        let frame = wedges.light.frame(receiver.place())?;
        let (origin, place) = (receiver.origin, receiver.place());
        let (mut sum, mut crossed) = (0.0, false);
        work.pairs += edges.len() as u64;
        for &index in edges {
            if skip && !wedges.wedges[index as usize].holds(place) {
                continue;
            }
            work.inside += 1;
            let edge = &wedges.edges.candidates[index as usize];
            let (a, b) = (frame.project(edge.a - origin), frame.project(edge.b - origin));
            if let Some(chord) = Chord::clipped(a, b, frame.is_finite) {
                crossed = true;
                sum += f64::from(edge.fixed * frame.turn) * share_behind(frame.outline, &chord);
            }
        }
        work.penumbra += u64::from(crossed);
        let center = wedges.light.center();
        if !crossed {
            work.rays += 1;
            return Some(if tree.is_occluded(origin, center) { 0.0 } else { 1.0 });
        }
        work.rays += 1;
        let layers = layers_before(scene, tree, &self.middle.facing, origin, center);
        Some(1.0 - (f64::from(layers) + sum))
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    fn chord(a: [f64; 2], b: [f64; 2]) -> Chord {
        Chord { start: a.into(), end: b.into() }
    }

    #[test]
    fn the_border_runs_once_around() {
        for i in 0..64 {
            let at = f64::from(i) / 8.0;
            let on = match i / 8 {
                0 => DVec2::new(1.0, at),
                1 | 2 => DVec2::new(2.0 - at, 1.0),
                3 | 4 => DVec2::new(-1.0, 4.0 - at),
                5 | 6 => DVec2::new(at - 6.0, -1.0),
                _ => DVec2::new(1.0, at - 8.0),
            };
            assert!((border(on * 0.3) - at).abs() < 1e-12, "{at}: {on} {}", border(on));
        }
    }

    #[test]
    fn a_chord_across_cuts_off_what_is_behind_it() {
        for outline in [Outline::Square, Outline::Disk, Outline::Cap(0.7)] {
            for h in [0.0_f64, 0.25, 0.6, 0.9] {
                let expected = match outline {
                    Outline::Square => (1.0 - h) / 2.0,
                    Outline::Disk => (h.acos() - h * (1.0 - h * h).sqrt()) / PI,
                    Outline::Cap(tan) => {
                        // By slices: of the cap's rings with 1 − cos t uniform, what lies beyond the plane.
                        let height = 1.0 - 1.0 / tan.hypot(1.0);
                        let n = 20_000;
                        let ring = |i: i32| {
                            let cos = 1.0 - height * (f64::from(i) + 0.5) / f64::from(n);
                            let radius = (1.0 - cos * cos).sqrt() / cos / tan;
                            if radius > h { (h / radius).acos() / PI } else { 0.0 }
                        };
                        (0..n).map(ring).sum::<f64>() / f64::from(n)
                    }
                };
                // Counter-clockwise with the middle on the left, in four turns.
                for turn in 0..4 {
                    let r = DVec2::from_angle(f64::from(turn) * PI / 2.0);
                    let ends = [DVec2::new(h, -1.0), DVec2::new(h, 1.0)].map(|p| r.rotate(p));
                    let whole = share_behind(outline, &chord(ends[0].into(), ends[1].into()));
                    assert!((whole - expected).abs() < 1e-4, "{outline:?} {h}: {whole} {expected}");
                    if h > 0.0 {
                        let back = share_behind(outline, &chord(ends[1].into(), ends[0].into()));
                        assert!((whole + back).abs() < 1e-12);
                    }
                    // Parts add up.
                    let m = ends[0] + (ends[1] - ends[0]) * 0.37;
                    let parts = share_behind(outline, &chord(ends[0].into(), m.into()))
                        + share_behind(outline, &chord(m.into(), ends[1].into()));
                    assert!((parts - whole).abs() < 1e-12);
                }
            }
        }
    }
}
