//! Step functions made short: compression of deep shadow maps (Lokovic and Veach 2000, section 3.3; section 3.2 of the
//! PDSM paper).
//!
//! V along a ray is a step function. It is replaced by segments, each as long as a straight line can stay within the
//! error bound of the function on either side. The papers draw each segment from the end of the one before, which is
//! settled when the next is looked for (`greedy.rs`); there are fewest if segments may meet anywhere within the bound
//! (`tunnel.rs`). A step that is higher
//! than twice the bound cannot be passed by any line and stays a step: two nodes at one depth. One shadow map of k makes
//! steps of 1/k, so below a bound of 1/(2k) every step costs two nodes.

use serde::{Deserialize, Serialize};

use crate::error_bound::ErrorBound;
use crate::events::Event;
use crate::greedy::{Greedy, Levels};
use crate::greedy_lanes::LaneGreedy;
use crate::nodes::Node;
use crate::sorting::SortedStrip;
use crate::surfaces::Surface;
use crate::tunnel::{Gate, Tunnel};

/// Which segments are looked for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Segments {
    /// Each as long as it can be from the end of the one before, as in the papers: the fastest to find.
    #[default]
    Greedy,
    /// The fewest that there can be, meeting anywhere within the bound: for what is kept in files and looked up often.
    Fewest,
}

/// How functions are made short.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Compression {
    /// How far they may be from the true ones.
    pub bound: ErrorBound,
    /// Which segments are looked for.
    pub segments: Segments,
}

impl From<f32> for Compression {
    fn from(largest: f32) -> Self {
        Self { bound: largest.into(), segments: Segments::default() }
    }
}

/// Compresses functions one by one, keeping its memory.
#[derive(Clone, Debug, Default)]
pub struct Compressor {
    tunnel: Tunnel,
    lanes: LaneGreedy,
    /// Of one pixel.
    events: Vec<Event>,
    is_started: bool,
    /// By maps in shadow: V, and the bound there.
    levels: Vec<(f64, f64)>,
    known: Option<(ErrorBound, u32)>,
    /// Whether V is farther from 1 anywhere than the bound allows.
    is_needed: bool,
}

impl Compressor {
    /// [`compress`](Self::compress) of all pixels of a strip, whose numbers of nodes are appended to `counts`.
    pub(crate) fn compress_strip(
        &mut self,
        strip: &SortedStrip,
        views: u32,
        compression: Compression,
        counts: &mut Vec<u32>,
        nodes: &mut Vec<Node>,
    ) {
        if compression.segments == Segments::Greedy && !compression.bound.of_display {
            self.begin(compression.bound, views);
            let levels = self.greedy_levels();
            return self.lanes.compress(strip, &levels, counts, nodes);
        }
        let mut events = std::mem::take(&mut self.events);
        for pixel in 0..strip.counts().len() {
            let start = nodes.len();
            events.clear();
            events.extend(strip.pixel(pixel));
            self.compress(&events, views, compression, nodes);
            counts.push((nodes.len() - start) as u32);
        }
        self.events = events;
    }

    /// [`compress_at`](Self::compress_at) of all pixels of a strip at those of its surfaces, likewise.
    pub(crate) fn compress_strip_at(
        &mut self,
        strip: &SortedStrip,
        mut asked: &[Surface],
        views: u32,
        bound: ErrorBound,
        counts: &mut Vec<u32>,
        nodes: &mut Vec<Node>,
    ) {
        let mut events = std::mem::take(&mut self.events);
        for pixel in 0..strip.counts().len() {
            let end = asked.partition_point(|surface| surface.pixel as usize <= pixel);
            let (own, rest) = asked.split_at(end);
            let start = nodes.len();
            events.clear();
            events.extend(strip.pixel(pixel));
            self.compress_at(&events, own.iter().map(|surface| surface.range), views, bound, nodes);
            counts.push((nodes.len() - start) as u32);
            asked = rest;
        }
        self.events = events;
    }

    /// Appends to `nodes` the function that `events`, ascending, of `views` maps make: V is 1 before the first node,
    /// within `bound` of the true step function everywhere, and stays what it is after the last. A
    /// function that is nowhere farther from 1 leaves no node.
    pub fn compress(
        &mut self,
        events: &[Event],
        views: u32,
        compression: Compression,
        nodes: &mut Vec<Node>,
    ) {
        let start = nodes.len();
        self.begin(compression.bound, views);
        let mut steps = Steps::new(events, views);
        let mut before = 0;
        if compression.segments == Segments::Greedy {
            return self.greedy(steps, start, nodes);
        }
        while let Some((t, after)) = steps.next() {
            if after != before {
                self.step(t, [before, after], false, nodes);
                before = after;
            }
        }
        self.end(before, start, nodes);
    }

    /// [`compress`](Self::compress), within `bound` at the depths in `asked` alone, which ascend and are apart;
    /// between them V may be anything.
    pub fn compress_at(
        &mut self,
        events: &[Event],
        asked: impl Iterator<Item = [f32; 2]>,
        views: u32,
        bound: ErrorBound,
        nodes: &mut Vec<Node>,
    ) {
        let start = nodes.len();
        self.begin(bound, views);
        let mut steps = Steps::new(events, views);
        let mut value = 0;
        for [first, last] in asked {
            while let Some((_, after)) = steps.next_until(first) {
                value = after;
            }
            self.step(f64::from(first), [value; 2], true, nodes);
            let mut reached = f64::from(first);
            while let Some((t, after)) = steps.next_until(last) {
                if after != value {
                    self.step(t, [value, after], false, nodes);
                    (value, reached) = (after, t);
                }
            }
            if f64::from(last) > reached {
                self.step(f64::from(last), [value; 2], false, nodes);
            }
        }
        self.end(value, start, nodes);
    }

    fn greedy(&mut self, mut steps: Steps<'_>, start: usize, nodes: &mut Vec<Node>) {
        let Some(first) = steps.events.first() else { return };
        let levels = self.greedy_levels();
        let mut line = Greedy::new(Node { t: first.t(), visibility: 1.0 }, nodes);
        let mut before = 0;
        while let Some((t, after)) = steps.next() {
            if after == before {
                continue;
            }
            self.is_needed |= after >= levels.needed;
            let sides = [before, after]
                .map(|shadowed| [levels.at(shadowed), self.levels[shadowed as usize].1 as f32]);
            line.visit_step(t as f32, sides);
            before = after;
        }
        line.end();
        if !self.is_needed {
            nodes.truncate(start);
        }
    }

    /// What greedy lines need to know of the levels. Both V and the bound fall with maps in shadow, V faster: from some number on
    /// V is farther from 1 than the bound allows.
    fn greedy_levels(&self) -> Levels {
        let needed = self.levels.partition_point(|&(visibility, bound)| 1.0 - visibility <= bound);
        Levels {
            views: self.levels.len() as u32 - 1,
            share: (self.levels.len() as f32 - 1.0).max(1.0).recip(),
            bound: self.levels[0].1 as f32,
            needed: needed as u32,
        }
    }

    fn begin(&mut self, bound: ErrorBound, views: u32) {
        (self.is_started, self.is_needed) = (false, false);
        if self.known != Some((bound, views)) {
            self.known = Some((bound, views));
            let of = |shadowed: u32| 1.0 - f64::from(shadowed) / f64::from(views.max(1));
            self.levels.clear();
            self.levels.extend((0..=views).map(of).map(|visibility| (visibility, bound.at(visibility))));
        }
    }

    /// Carries the line on to `t`, where the maps in shadow change from `before` to `after`. Since the step before they
    /// were `before`, unless V is `free` to have been anything.
    #[inline]
    fn step(&mut self, t: f64, [before, after]: [u32; 2], free: bool, nodes: &mut Vec<Node>) {
        let ((before, bound_before), (after, bound)) =
            (self.levels[before as usize], self.levels[after as usize]);
        self.is_needed |= 1.0 - after > bound;
        let within = [before - bound_before, before + bound_before];
        let walls = if free { [f64::NEG_INFINITY, f64::INFINITY] } else { within };
        let (low, high) = (within[0].max(after - bound), within[1].min(after + bound));
        if low > high {
            // No line passes the step.
            if self.is_started {
                self.tunnel.pass(Gate { t, low: within[0], high: within[1], walls }, nodes);
                self.tunnel.finish(before, nodes);
            }
            self.tunnel.start(Gate { t, low: after - bound, high: after + bound, walls });
        } else if self.is_started {
            self.tunnel.pass(Gate { t, low, high, walls }, nodes);
        } else {
            self.tunnel.start(Gate { t, low, high, walls });
        }
        self.is_started = true;
    }

    fn end(&mut self, shadowed: u32, start: usize, nodes: &mut Vec<Node>) {
        if self.is_started {
            self.tunnel.finish(self.levels[shadowed as usize].0, nodes);
        }
        if !self.is_needed {
            nodes.truncate(start);
        }
    }
}

/// The steps that events make: t and how many maps are in shadow from there on.
struct Steps<'a> {
    events: &'a [Event],
    shadowed: i32,
    views: i32,
}

impl<'a> Steps<'a> {
    fn new(events: &'a [Event], views: u32) -> Self {
        Self { events, shadowed: 0, views: views as i32 }
    }

    /// All that happens at one depth is one step.
    #[inline]
    fn next(&mut self) -> Option<(f64, u32)> {
        let t = self.events.first()?.t();
        while let Some((event, rest)) = self.events.split_first().filter(|(event, _)| event.t() == t) {
            self.shadowed += if event.is_exit() { -1 } else { 1 };
            self.events = rest;
        }
        // Exits are rounded to 2 ulps as entries are, so that none comes first; the bound is for free.
        Some((f64::from(t), self.shadowed.clamp(0, self.views) as u32))
    }

    #[inline]
    fn next_until(&mut self, last: f32) -> Option<(f64, u32)> {
        self.events.first().filter(|event| event.t() <= last)?;
        self.next()
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::nodes::evaluate;

    fn fewest(largest: f32) -> Compression {
        Compression { segments: Segments::Fewest, ..largest.into() }
    }

    fn exact(events: &[Event], views: u32, t: f32) -> f32 {
        let shadowed: i32 =
            events.iter().filter(|e| e.t() <= t).map(|e| if e.is_exit() { -1 } else { 1 }).sum();
        1.0 - shadowed as f32 / views as f32
    }

    /// Intervals in shadow, one or two a map.
    fn intervals() -> impl Strategy<Value = Vec<(f32, f32)>> {
        let depth = || prop_oneof![-2.0f32..1.0, (-8i32..4).prop_map(|i| i as f32 * 0.25)];
        prop::collection::vec((depth(), 1e-3f32..2.0), 1..80)
    }

    fn events_of(intervals: &[(f32, f32)]) -> Vec<Event> {
        let mut events: Vec<_> = intervals
            .iter()
            .flat_map(|&(start, length)| [Event::new(start, false), Event::new(start + length, true)])
            .collect();
        events.sort();
        events
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 400, ..ProptestConfig::default() })]

        #[test]
        fn the_error_stays_within_the_bound(
            intervals in intervals(),
            max_error in prop_oneof![Just(0.0f32), 0.0f32..0.2],
            fewest in any::<bool>(),
        ) {
            let events = events_of(&intervals);
            let views = intervals.len() as u32;
            let segments = if fewest { Segments::Fewest } else { Segments::Greedy };
            let mut nodes = Vec::new();
            let compression = Compression { bound: max_error.into(), segments };
            Compressor::default().compress(&events, views, compression, &mut nodes);
            prop_assert!(nodes.windows(2).all(|pair| pair[0].t <= pair[1].t));
            // Rounding: values lie in [0, 1] and a node's is off by a few ulps of 1; a slope's product too.
            let bound = max_error + 1e-5;
            let depths: Vec<f32> = events.iter().map(|e| e.t()).collect();
            let between = depths.windows(2).map(|pair| 0.5 * (pair[0] + pair[1]));
            let around = depths.iter().flat_map(|t| [t.next_down(), *t, t.next_up()]);
            for t in between.chain(around).chain([-9.0, 9.0]) {
                let (is, should) = (evaluate(&nodes, t), exact(&events, views, t));
                // Beside a step the line's slope carries an ulp of t to anywhere within the step.
                let near = exact(&events, views, t - 4.0 * f32::EPSILON * t.abs());
                let far = exact(&events, views, t + 4.0 * f32::EPSILON * t.abs());
                let (low, high) = (should.min(near).min(far), should.max(near).max(far));
                prop_assert!(
                    is >= low - bound && is <= high + bound,
                    "at {}: {} for {}, bound {}", t, is, should, max_error
                );
            }
        }

        #[test]
        fn a_wider_bound_never_needs_more_than_the_steps(intervals in intervals()) {
            let events = events_of(&intervals);
            let mut all = Vec::new();
            Compressor::default().compress(&events, intervals.len() as u32, fewest(0.0), &mut all);
            let mut few = Vec::new();
            Compressor::default().compress(&events, intervals.len() as u32, fewest(0.1), &mut few);
            prop_assert!(few.len() <= all.len());
            prop_assert!(all.len() <= 2 * events.len() + 1);
        }
    }

    #[test]
    fn a_display_shows_errors_in_the_dark_most() {
        let bound = ErrorBound { largest: 0.1, of_display: true };
        assert!((bound.at(1.0) - 0.1).abs() < 1e-8 && (0.028..0.029).contains(&bound.at(0.0)));
        // V = (1 − t)² to the umbra and back: all is within the bound of its place, and the dark takes more nodes.
        let bound = ErrorBound { largest: 0.02, of_display: true };
        let at = |i: i32| 1.0 - (1.0 - i as f32 / 64.0).sqrt();
        let event =
            |i: i32| if i < 64 { Event::new(at(i), false) } else { Event::new(2.0 - at(127 - i), true) };
        let events: Vec<_> = (0..128).map(event).collect();
        assert!(events.is_sorted());
        let [mut nodes, mut uniform] = [Vec::new(), Vec::new()];
        Compressor::default().compress(
            &events,
            64,
            Compression { bound, segments: Segments::Fewest },
            &mut nodes,
        );
        Compressor::default().compress(&events, 64, fewest(0.02), &mut uniform);
        assert!(nodes.len() > uniform.len());
        for i in 0..4000 {
            let t = i as f32 / 1900.0 + 1e-4;
            let should = exact(&events, 64, t);
            assert!(f64::from((evaluate(&nodes, t) - should).abs()) <= bound.at(f64::from(should)) + 1e-5);
        }
    }

    /// The papers' way: each line starts where the one before ended, in the middle of what its slopes reach.
    fn segments_from_fixed_starts(events: &[Event], views: u32, bound: f64) -> usize {
        let mut points: Vec<(f64, f64)> = Vec::new();
        let mut steps: Vec<f32> = events.iter().map(|e| e.t()).collect();
        steps.dedup();
        let mut before = 1.0;
        for &t in &steps {
            let after = f64::from(exact(events, views, t));
            points.extend([(f64::from(t), before), (f64::from(t), after)]);
            before = after;
        }
        let (mut origin, mut slopes, mut nodes) = (points[0], [f64::NEG_INFINITY, f64::INFINITY], 1);
        let mut last = origin.0;
        for point in points {
            let visit = |origin: (f64, f64), slopes: [f64; 2]| {
                let (run, rise) = (point.0 - origin.0, point.1 - origin.1);
                let window = [(rise - bound) / run, (rise + bound) / run];
                let narrow = [slopes[0].max(window[0]), slopes[1].min(window[1])];
                if run <= 0.0 { (rise.abs() <= bound, slopes) } else { (narrow[0] <= narrow[1], narrow) }
            };
            let (mut fits, mut narrow) = visit(origin, slopes);
            if !fits && last > origin.0 {
                origin = (last, origin.1 + 0.5 * (slopes[0] + slopes[1]) * (last - origin.0));
                nodes += 1;
                (fits, narrow) = visit(origin, [f64::NEG_INFINITY, f64::INFINITY]);
            }
            if !fits {
                (origin, narrow) = (point, [f64::NEG_INFINITY, f64::INFINITY]);
                nodes += 1;
            }
            (slopes, last) = (narrow, point.0);
        }
        nodes + usize::from(last > origin.0)
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 400, ..ProptestConfig::default() })]

        /// Where the bound lets lines pass every step, no choice of fixed starts takes fewer nodes.
        #[test]
        fn free_starts_never_need_more(depths in prop::collection::vec(-2.0f32..1.0, 1..80)) {
            let mut events: Vec<_> =
                depths.iter().enumerate().map(|(i, &t)| Event::new(t, i % 3 == 2)).collect();
            events.sort();
            let views = events.len() as u32;
            let bound = 2.0 / views as f32;
            let mut nodes = Vec::new();
            Compressor::default().compress(&events, views, fewest(bound), &mut nodes);
            let fixed = segments_from_fixed_starts(&events, views, f64::from(bound) - 1e-6);
            prop_assert!(nodes.len() <= fixed, "{} > {}", nodes.len(), fixed);
        }
    }

    proptest! {
        /// Right where it is asked for, and no longer than the whole.
        #[test]
        fn what_is_asked_for_alone_is_kept(
            intervals in intervals(),
            asked in prop::collection::vec((-2.0f32..1.5, 0.0f32..0.1), 1..8),
            max_error in 0.0f32..0.1,
        ) {
            let events = events_of(&intervals);
            let views = intervals.len() as u32;
            let mut asked: Vec<_> = asked.iter().map(|&(t, length)| [t, t + length]).collect();
            asked.sort_by(|a, b| a[0].total_cmp(&b[0]));
            asked.dedup_by(|next, kept| {
                let overlaps = next[0] <= kept[1];
                kept[1] = if overlaps { kept[1].max(next[1]) } else { kept[1] };
                overlaps
            });
            let mut nodes = Vec::new();
            Compressor::default().compress_at(&events, asked.iter().copied(), views, max_error.into(), &mut nodes);
            for [first, last] in asked {
                for i in 0..=16 {
                    let t = first + (last - first) * (i as f32 / 16.0);
                    let is = evaluate(&nodes, t);
                    let ulps = 4.0 * f32::EPSILON * t.abs();
                    let around = [t - ulps, t, t + ulps].map(|t| exact(&events, views, t));
                    let bound = max_error + 1e-5;
                    let (low, high) = around.iter().fold((1.0f32, 0.0f32), |(a, b), &v| (a.min(v), b.max(v)));
                    prop_assert!(is >= low - bound && is <= high + bound, "at {}: {}, not {} to {}", t, is, low, high);
                }
            }
        }
    }

    #[test]
    fn a_bend_is_two_lines() {
        // Down by one in 32 equal steps, and back up: V is a ramp to 0 and one to 1.
        let step = |i: i32| Event::new(i as f32 / 32.0, i >= 32);
        let events: Vec<_> = (0..64).map(step).collect();
        let mut nodes = Vec::new();
        Compressor::default().compress(&events, 32, fewest(0.03), &mut nodes);
        assert_eq!(nodes.len(), 3, "{nodes:?}");
    }

    #[test]
    fn no_event_is_no_node_and_lit() {
        let mut nodes = Vec::new();
        Compressor::default().compress(&[], 8, fewest(0.02), &mut nodes);
        assert!(nodes.is_empty());
        assert_eq!(evaluate(&nodes, 0.5), 1.0);
    }

    #[test]
    fn a_hard_shadow_is_one_node() {
        let mut nodes = Vec::new();
        Compressor::default().compress(&[Event::new(0.5, false)], 1, fewest(0.02), &mut nodes);
        assert_eq!(nodes.len(), 1);
        assert_eq!([evaluate(&nodes, 0.49), evaluate(&nodes, 0.5), evaluate(&nodes, 7.0)], [1.0, 0.0, 0.0]);
    }

    #[test]
    fn many_small_steps_are_one_line() {
        let events: Vec<_> = (0..64).map(|i| Event::new(0.1 + i as f32 / 128.0, false)).collect();
        let mut nodes = Vec::new();
        Compressor::default().compress(&events, 64, fewest(0.02), &mut nodes);
        assert_eq!(nodes.len(), 2, "{nodes:?}");
    }
}
