//! Where the rays of a PDSM cross from texel to texel of one shadow map.
//!
//! In the layouts of this crate ([`crate::layout`]) the ray of a PDSM pixel with centre q lies, in the map of the light
//! sample S, at q + D·t: all rays of a map are translates of one another, so one list of crossings serves them all. A
//! centre is the middle of a texel at t = 0; along an axis with D ≠ 0 the crossing number h, any whole number, lies at
//! t = (h + ½)/|D| and leads from the offset sign(D)·h to the next. The two axes are merged by t, x first where both
//! cross at once. Walk and emission use these very numbers, so that their events agree bit for bit.

use glam::Vec2;

/// Crossings along one axis within the range of t, ascending.
#[derive(Clone, Debug, Default)]
pub struct AxisCrossings {
    /// Direction of travel in texels, 1 or −1.
    pub sign: i32,
    /// Number h of the first crossing in range; the offset before it is `sign`·`first`.
    pub first: i32,
    /// |D|, texels per unit of t.
    speed: f32,
    /// 1/|D|.
    inverse: f32,
    /// t of each crossing.
    pub t: Vec<f32>,
    /// Per crossing, how many of the other axis come before it.
    pub others: Vec<u32>,
}

impl AxisCrossings {
    /// Crossings with `start` < t ≤ `end`, for `d` texels per unit of t.
    fn new(d: f32, start: f32, end: f32) -> Self {
        let speed = d.abs();
        let sign = if d < 0.0 { -1 } else { 1 };
        let inverse = 1.0 / speed;
        let at = |h: i32| (h as f32 + 0.5) * inverse;
        // The guess is off by rounding only.
        let mut first = (start * speed - 0.5).floor().clamp(-1e9, 1e9) as i32 - 1;
        while at(first) <= start {
            first += 1;
        }
        let t: Vec<f32> = (first..).map(at).take_while(|&t| t <= end).collect();
        Self { sign, first, speed, inverse, t, others: Vec::new() }
    }

    /// How many crossings have t ≤ `depth`, and how many t < `depth`; all for an infinite one. Without branches, so that a
    /// loop over it becomes vector code.
    #[inline(always)]
    pub fn passed_both(&self, depth: f32) -> [u32; 2] {
        let at = |h: f32| (h + 0.5) * self.inverse;
        // The guess is off by one at most: it rounds a number below 2²³.
        let guess = (depth * self.speed + 0.5).floor();
        let guess = if at(guess) <= depth { guess + 1.0 } else { guess };
        let passed = if at(guess - 1.0) > depth { guess - 1.0 } else { guess };
        let count = passed - self.first as f32;
        let length = self.t.len() as f32;
        let is_on = (at(passed - 1.0) == depth) & (count >= 1.0) & (count <= length);
        let until = count.max(0.0).min(length) as i32 as u32;
        [until, until - u32::from(is_on)]
    }

    /// Offset in texels after `count` crossings.
    #[inline]
    pub fn offset(&self, count: u32) -> i32 {
        self.sign * (self.first + count as i32)
    }

    fn count_others(&mut self, counts: impl Fn(f32) -> usize) {
        self.others = self.t.iter().map(|&t| counts(t) as u32).collect();
    }
}

/// The crossings of every ray in one map.
#[derive(Clone, Debug, Default)]
pub struct Crossings {
    /// Along x.
    pub x: AxisCrossings,
    /// Along y.
    pub y: AxisCrossings,
}

impl Crossings {
    /// For rays that move by `step` texels per unit of t, where t lies in (`range[0]`, `range[1]`].
    pub fn new(step: Vec2, range: [f32; 2]) -> Self {
        let [mut x, mut y] = [step.x, step.y].map(|d| AxisCrossings::new(d, range[0], range[1]));
        // x first: a y crossing at the same t comes after.
        x.count_others(|t| y.t.partition_point(|&other| other < t));
        y.count_others(|t| x.t.partition_point(|&other| other <= t));
        Self { x, y }
    }

    /// The cells of the ray in order: t at which each is entered (−∞ for the first) and its offset from the texel at
    /// t = 0.
    pub fn cells(&self) -> impl Iterator<Item = (f32, [i32; 2])> + '_ {
        let (x, y) = (&self.x, &self.y);
        let (mut i, mut j) = (0, 0);
        let steps = std::iter::from_fn(move || {
            let t = match (x.t.get(i), y.t.get(j)) {
                (Some(&a), Some(&b)) if a <= b => (a, &mut i),
                (Some(&a), None) => (a, &mut i),
                (_, Some(&b)) => (b, &mut j),
                (None, None) => return None,
            };
            *t.1 += 1;
            let t = t.0;
            Some((t, [x.offset(i as u32), y.offset(j as u32)]))
        });
        std::iter::once((f32::NEG_INFINITY, [x.offset(0), y.offset(0)])).chain(steps)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ray_steps_by_one_texel_at_a_time() {
        for step in [Vec2::new(3.7, -1.2), Vec2::new(-0.2, 5.0), Vec2::new(2.0, 2.0), Vec2::ZERO] {
            let crossings = Crossings::new(step, [-2.0, 1.0]);
            let cells: Vec<_> = crossings.cells().collect();
            assert_eq!(cells.len(), 1 + crossings.x.t.len() + crossings.y.t.len());
            for pair in cells.windows(2) {
                let [(before, a), (after, b)] = [pair[0], pair[1]];
                assert!(before <= after);
                assert_eq!((a[0] - b[0]).abs() + (a[1] - b[1]).abs(), 1, "{step}: {a:?} {b:?}");
            }
            // The cell in which a point of the ray lies is the one it rounds to.
            for t in [-1.87f32, -0.61, 0.0, 0.3, 0.97] {
                let (_, cell) = cells.iter().rev().find(|(start, _)| *start <= t).copied().unwrap();
                let place = step * t;
                assert_eq!(cell, [place.x.round() as i32, place.y.round() as i32], "{step} {t}");
            }
        }
    }

    #[test]
    fn passed_counts_what_lies_at_or_before() {
        let axis = AxisCrossings::new(-7.3, -3.0, 1.0);
        for (index, &t) in axis.t.iter().enumerate() {
            let index = index as u32;
            assert_eq!(axis.passed_both(t), [index + 1, index]);
            assert_eq!(axis.passed_both(t.next_down()), [index; 2]);
            assert_eq!(axis.passed_both(t.next_up()), [index + 1; 2]);
        }
        let all = axis.t.len() as u32;
        assert_eq!(axis.passed_both(f32::INFINITY), [all; 2]);
        assert_eq!(axis.passed_both(f32::NEG_INFINITY), [0; 2]);
        // No speed, no crossings.
        assert_eq!(AxisCrossings::new(0.0, -3.0, 1.0).passed_both(0.5), [0; 2]);
    }

    #[test]
    fn the_other_axis_is_counted_as_the_merged_order_has_it() {
        // Equal speeds: every crossing is a tie.
        let crossings = Crossings::new(Vec2::new(2.0, -2.0), [-1.0, 1.0]);
        assert_eq!(crossings.x.others, [0, 1, 2, 3]);
        assert_eq!(crossings.y.others, [1, 2, 3, 4]);
    }
}
