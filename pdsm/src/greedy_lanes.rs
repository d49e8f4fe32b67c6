//! [`Greedy`](crate::greedy::Greedy) lines of sixteen pixels at once, a lane each: the same nodes, bit for bit.
//!
//! All lanes look at their n-th event together. Of two quotients by the same run the larger is that of the larger number,
//! rounded as it is, so that four quotients tell whether a line passes both sides of a step, the first alone or neither;
//! what follows from each is done under a mask, all lanes of one kind together.

use bytemuck::Zeroable;
use fearless_simd::prelude::*;
use fearless_simd::{Level, Simd, dispatch, f32x16, i32x16, mask32x16, u32x16};

use crate::greedy::Levels;
use crate::nodes::Node;
use crate::sorting::{LANES, NOTHING, Row, SortedStrip};

/// Nodes that a step may put: each of its sides ends a line and begins one.
const MOST_OF_A_STEP: usize = 4;

/// Draws lines, keeping its memory.
#[derive(Clone, Debug)]
pub(crate) struct LaneGreedy {
    level: Level,
    /// Nodes of a group, lane by lane.
    nodes: Vec<Node>,
}

impl Default for LaneGreedy {
    fn default() -> Self {
        Self { level: Level::new(), nodes: Vec::new() }
    }
}

impl LaneGreedy {
    /// Appends the functions of a strip's pixels to `nodes`, and how many nodes each has to `counts`.
    pub(crate) fn compress(
        &mut self,
        strip: &SortedStrip,
        levels: &Levels,
        counts: &mut Vec<u32>,
        nodes: &mut Vec<Node>,
    ) {
        let level = self.level;
        for group in 0..strip.groups() {
            let (events, rows) = strip.group(group);
            // The first node and the last, too.
            let most = MOST_OF_A_STEP * rows.len() + 2;
            if self.nodes.len() < LANES * most {
                self.nodes.resize(LANES * most, Node::zeroed());
            }
            let own = &mut self.nodes[..LANES * most];
            let ends = dispatch!(level, simd => draw(simd, rows, levels, most, own));
            for (lane, &end) in ends.iter().enumerate().take(events.len()) {
                let start = lane * most;
                nodes.extend_from_slice(&own[start..end as usize]);
                counts.push(end - start as u32);
            }
        }
    }
}

/// The segments being drawn: see [`Greedy`](crate::greedy::Greedy).
struct Lines<'a, S: Simd> {
    origin: [f32x16<S>; 2],
    low: f32x16<S>,
    high: f32x16<S>,
    last: f32x16<S>,
    nodes: &'a mut [Node],
    /// Where each lane's next node goes.
    ends: [u32; LANES],
}

impl<S: Simd> Lines<'_, S> {
    /// Begins lines at these points, with any slope.
    #[inline(always)]
    fn begin(&mut self, simd: S, lanes: mask32x16<S>, [t, visibility]: [f32x16<S>; 2]) {
        let [origin_t, origin_v] = self.origin;
        self.origin = [lanes.select(t, origin_t), lanes.select(visibility, origin_v)];
        self.low = lanes.select(f32x16::splat(simd, f32::NEG_INFINITY), self.low);
        self.high = lanes.select(f32x16::splat(simd, f32::INFINITY), self.high);
        self.last = lanes.select(t, self.last);
        let mut bits = lanes.to_bitmask();
        let (t, visibility) = (t.to_array(), visibility.to_array());
        while bits != 0 {
            let lane = bits.trailing_zeros() as usize % LANES;
            bits &= bits - 1;
            let end = &mut self.ends[lane];
            self.nodes[*end as usize] = Node { t: t[lane], visibility: visibility[lane] };
            *end += 1;
        }
    }

    /// Slopes from the origins by which lines pass within the bound of V at `t`, of those that they have.
    #[inline(always)]
    fn narrowed(
        &self,
        [low, high]: [f32x16<S>; 2],
        run: f32x16<S>,
        visibility: f32x16<S>,
        bound: f32x16<S>,
    ) -> [f32x16<S>; 2] {
        let rise = visibility - self.origin[1];
        [low.max((rise - bound) / run), high.min((rise + bound) / run)]
    }

    /// V at `t` of the lines in the middle of these slopes.
    #[inline(always)]
    fn value(&self, [low, high]: [f32x16<S>; 2], t: f32x16<S>) -> f32x16<S> {
        self.origin[1] + (low + high) * 0.5 * (t - self.origin[0])
    }

    /// Visits both sides of a step at `t`: see [`Greedy::visit_step`](crate::greedy::Greedy::visit_step).
    #[inline(always)]
    fn visit_step(
        &mut self,
        simd: S,
        steps: mask32x16<S>,
        t: f32x16<S>,
        sides: [f32x16<S>; 2],
        bound: f32x16<S>,
    ) {
        let run = t - self.origin[0];
        let ahead = steps & run.simd_gt(0.0);
        let before = self.narrowed([self.low, self.high], run, sides[0], bound);
        let both = self.narrowed(before, run, sides[1], bound);
        let passes = ahead & both[0].simd_le(both[1]);
        self.low = passes.select(both[0], self.low);
        self.high = passes.select(both[1], self.high);
        self.last = passes.select(t, self.last);
        let rest = steps & !passes;
        if !rest.any_true() {
            return;
        }
        // Of lines that pass no more than the first side, what ends at the step.
        let mut ends = ahead & !passes & before[0].simd_le(before[1]);
        let mut at_step = self.value(before, t);
        let neither = ahead & !passes & !ends;
        if neither.any_true() {
            // They end where they were last, and new ones pass the first side, whatever it is.
            let met = self.value([self.low, self.high], self.last);
            self.begin(simd, neither, [self.last, met]);
            let run = t - self.origin[0];
            let any = [f32::NEG_INFINITY, f32::INFINITY].map(|slope| f32x16::splat(simd, slope));
            let before = self.narrowed(any, run, sides[0], bound);
            let both = self.narrowed(before, run, sides[1], bound);
            let passes = neither & both[0].simd_le(both[1]);
            self.low = passes.select(both[0], self.low);
            self.high = passes.select(both[1], self.high);
            self.last = passes.select(t, self.last);
            let fails = neither & !passes;
            at_step = fails.select(self.value(before, t), at_step);
            ends |= fails;
        }
        self.begin(simd, ends, [t, at_step]);
        // At the origin itself no slope helps: the step is passed or not. That of the very first step is 1, too.
        let here = (rest & !ahead) | ends;
        let misses = here & (sides[1] - self.origin[1]).abs().simd_gt(bound);
        if misses.any_true() {
            self.begin(simd, misses, [t, sides[1]]);
        }
    }
}

#[inline(always)]
fn events<S: Simd>(simd: S, row: &Row) -> i32x16<S> {
    u32x16::from_slice(simd, &row.0).bitcast()
}

/// Depths of events: see [`Event::t`](crate::events::Event::t).
#[inline(always)]
fn depth<S: Simd>(simd: S, events: i32x16<S>) -> f32x16<S> {
    let [lowest, all] = [i32::MIN, -1].map(|bits| i32x16::splat(simd, bits));
    ((events & !1) ^ events.simd_lt(0).select(lowest, all)).bitcast()
}

/// Draws the lines of a group, each lane's nodes from its number times `most` on; where they end.
#[inline(always)]
fn draw<S: Simd>(simd: S, rows: &[Row], levels: &Levels, most: usize, nodes: &mut [Node]) -> [u32; LANES] {
    let starts: [u32; LANES] = std::array::from_fn(|lane| (lane * most) as u32);
    let Some(first) = rows.first() else { return starts };
    let zero = f32x16::splat(simd, 0.0);
    let one = f32x16::splat(simd, 1.0);
    let bound = f32x16::splat(simd, levels.bound);
    let mut lines = Lines { origin: [zero, one], low: zero, high: zero, last: zero, nodes, ends: starts };
    let mut now = events(simd, first);
    let has = !now.simd_eq(NOTHING as i32);
    lines.begin(simd, has, [depth(simd, now), one]);
    let none = i32x16::splat(simd, 0);
    let (mut shadowed, mut before, mut side) = (none, none, one);
    let mut needed = mask32x16::splat(simd, false);
    for place in 0..rows.len() {
        let next = match rows.get(place + 1) {
            Some(row) => events(simd, row),
            None => i32x16::splat(simd, NOTHING as i32),
        };
        // One more in shadow, or one less.
        let change = i32x16::splat(simd, 1) - ((now & 1) << 1);
        shadowed += now.simd_eq(NOTHING as i32).select(none, change);
        let after = shadowed.max(0).min(levels.views as i32);
        // All that happens at one depth is one step.
        let steps = !((now ^ next) & !1).simd_eq(0) & !after.simd_eq(before);
        if steps.any_true() {
            let value = one - after.to_float::<f32x16<S>>() * levels.share;
            needed |= steps & after.simd_ge(levels.needed as i32);
            lines.visit_step(simd, steps, depth(simd, now), [side, value], bound);
            side = steps.select(value, side);
            before = steps.select(after, before);
        }
        now = next;
    }
    let ends = has & lines.last.simd_gt(lines.origin[0]);
    let value = lines.value([lines.low, lines.high], lines.last);
    lines.begin(simd, ends, [lines.last, value]);
    let needed = needed.to_bitmask();
    std::array::from_fn(|lane| if needed >> lane & 1 == 1 { lines.ends[lane] } else { starts[lane] })
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::compression::{Compression, Compressor};
    use crate::events::{Event, PlacedEvent};

    proptest! {
        #![proptest_config(ProptestConfig { cases: 400, ..ProptestConfig::default() })]

        /// Side by side is one after the other, bit for bit: functions of any length side by side, steps at one depth, any
        /// bound.
        #[test]
        fn lanes_are_greedy(
            intervals in prop::collection::vec(
                (0u32..40, prop_oneof![-2.0f32..1.0, (-8i32..4).prop_map(|i| i as f32 * 0.25)], 0.0f32..2.0, any::<bool>()),
                0..400,
            ),
            views in 1u32..80,
            max_error in prop_oneof![Just(0.0f32), 0.0f32..0.2],
        ) {
            let placed: Vec<_> = intervals
                .iter()
                .flat_map(|&(pixel, start, length, is_level)| {
                    let length = if is_level { length.floor() * 0.25 } else { length };
                    let events = [Event::new(start, false), Event::new(start + length, true)];
                    // Some pixels are crowded, and some empty.
                    events.map(|event| PlacedEvent { pixel: pixel * pixel / 40, event })
                })
                .collect();
            let mut strip = SortedStrip::default();
            strip.sort(40, &[&placed]);
            let compression: Compression = max_error.into();
            let (mut counts, mut nodes) = (Vec::new(), Vec::new());
            Compressor::default().compress_strip(&strip, views, compression, &mut counts, &mut nodes);
            let (mut expected_counts, mut expected) = (Vec::new(), Vec::new());
            for pixel in 0..40 {
                let (events, start) = (strip.pixel(pixel).collect::<Vec<_>>(), expected.len());
                Compressor::default().compress(&events, views, compression, &mut expected);
                expected_counts.push((expected.len() - start) as u32);
            }
            let bits = |nodes: &[Node]| -> Vec<[u32; 2]> {
                nodes.iter().map(|node| [node.t.to_bits(), node.visibility.to_bits()]).collect()
            };
            prop_assert_eq!(counts, expected_counts);
            prop_assert_eq!(bits(&nodes), bits(&expected));
        }
    }
}
