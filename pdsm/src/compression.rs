//! Step functions made short: the greedy compression of deep shadow maps (Lokovic and Veach 2000, section 3.3; section
//! 3.2 of the PDSM paper).
//!
//! V along a ray is a step function. It is replaced by segments, each as long as a straight line from the last node can
//! stay within `max_error` of the function on either side. A step that is higher than twice the bound cannot be passed
//! by any line and stays a step: two nodes at one depth. One shadow map of k makes steps of 1/k, so below a bound of
//! 1/(2k) every step costs two nodes.

use bytemuck::{Pod, Zeroable};

use crate::events::Event;

/// A point of a piecewise linear function of t. Of two nodes at the same t the first is the limit from before.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Node {
    /// Depth along the ray, in the layout's parameter.
    pub t: f32,
    /// V there; beyond 0 or 1 by up to the error bound, where the line that passes most of the function does so.
    pub visibility: f32,
}

/// Appends to `nodes` the function that `events`, ascending, of `views` maps make: V is 1 before the first node,
/// within `max_error` (at least 0) of the true step function everywhere, and stays what it is after the last. No event
/// leaves no node.
pub fn compress(events: &[Event], views: u32, max_error: f32, nodes: &mut Vec<Node>) {
    let Some(first) = events.first() else { return };
    let share = 1.0 / views.max(1) as f32;
    let mut line = Segment::new(Node { t: first.t(), visibility: 1.0 }, max_error, nodes);
    let (mut shadowed, mut index) = (0i32, 0);
    let mut before = 1.0;
    while index < events.len() {
        let t = events[index].t();
        // All that happens at one depth is one step.
        while index < events.len() && events[index].t() == t {
            shadowed += if events[index].is_exit() { -1 } else { 1 };
            index += 1;
        }
        // Exits are rounded to 2 ulps as entries are, so that none comes first; the bound is for free.
        let after = 1.0 - shadowed.clamp(0, views as i32) as f32 * share;
        if after != before {
            line.visit(Node { t, visibility: before });
            line.visit(Node { t, visibility: after });
            before = after;
        }
    }
    line.finish();
}

/// The segment being drawn: from `origin`, with any slope in a window.
struct Segment<'a> {
    nodes: &'a mut Vec<Node>,
    max_error: f32,
    origin: Node,
    /// Slopes that stay within the bound of everything visited.
    slopes: [f32; 2],
    /// t of the last point visited.
    last: f32,
    start: usize,
}

impl<'a> Segment<'a> {
    fn new(origin: Node, max_error: f32, nodes: &'a mut Vec<Node>) -> Self {
        let start = nodes.len();
        nodes.push(origin);
        let slopes = [f32::NEG_INFINITY, f32::INFINITY];
        Self { nodes, max_error, origin, slopes, last: origin.t, start }
    }

    fn begin(&mut self, origin: Node) {
        self.nodes.push(origin);
        self.origin = origin;
        self.slopes = [f32::NEG_INFINITY, f32::INFINITY];
        self.last = origin.t;
    }

    /// Carries the line on to a point of the function; where none can pass, ends it and begins another.
    fn visit(&mut self, point: Node) {
        if self.try_visit(point) {
            return;
        }
        self.end();
        if !self.try_visit(point) {
            self.begin(point);
        }
    }

    fn try_visit(&mut self, point: Node) -> bool {
        let (run, rise) = (point.t - self.origin.t, point.visibility - self.origin.visibility);
        if run <= 0.0 {
            return rise.abs() <= self.max_error;
        }
        let low = self.slopes[0].max((rise - self.max_error) / run);
        let high = self.slopes[1].min((rise + self.max_error) / run);
        let fits = low <= high;
        if fits {
            (self.slopes, self.last) = ([low, high], point.t);
        }
        fits
    }

    /// Puts a node where the line ends, if it has come anywhere.
    fn end(&mut self) {
        if self.last > self.origin.t {
            let slope = 0.5 * (self.slopes[0] + self.slopes[1]);
            let visibility = self.origin.visibility + slope * (self.last - self.origin.t);
            self.begin(Node { t: self.last, visibility });
        }
    }

    fn finish(mut self) {
        self.end();
        // A function that never left 1 by more than the bound is no function.
        if self.nodes[self.start..].iter().all(|node| node.visibility == 1.0) {
            self.nodes.truncate(self.start);
        }
    }
}

/// V at `t` of the function that [`compress`] made: 1 before its first node and without nodes; at a step the value after
/// it.
#[inline]
pub fn evaluate(nodes: &[Node], t: f32) -> f32 {
    let after = nodes.partition_point(|node| node.t <= t);
    let visibility = match (after.checked_sub(1).map(|before| nodes[before]), nodes.get(after)) {
        (None, _) => 1.0,
        (Some(last), None) => last.visibility,
        (Some(a), Some(b)) => {
            // Both differences are positive: a.t ≤ t < b.t.
            a.visibility + (b.visibility - a.visibility) * ((t - a.t) / (b.t - a.t))
        }
    };
    visibility.clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

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
        ) {
            let events = events_of(&intervals);
            let views = intervals.len() as u32;
            let mut nodes = Vec::new();
            compress(&events, views, max_error, &mut nodes);
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
            compress(&events, intervals.len() as u32, 0.0, &mut all);
            let mut few = Vec::new();
            compress(&events, intervals.len() as u32, 0.1, &mut few);
            prop_assert!(few.len() <= all.len());
            prop_assert!(all.len() <= 2 * events.len() + 1);
        }
    }

    #[test]
    fn no_event_is_no_node_and_lit() {
        let mut nodes = Vec::new();
        compress(&[], 8, 0.02, &mut nodes);
        assert!(nodes.is_empty());
        assert_eq!(evaluate(&nodes, 0.5), 1.0);
    }

    #[test]
    fn a_hard_shadow_is_two_nodes() {
        let mut nodes = Vec::new();
        compress(&[Event::new(0.5, false)], 1, 0.02, &mut nodes);
        assert_eq!(nodes.len(), 2);
        assert_eq!([evaluate(&nodes, 0.49), evaluate(&nodes, 0.5), evaluate(&nodes, 7.0)], [1.0, 0.0, 0.0]);
    }

    #[test]
    fn many_small_steps_are_one_line() {
        let events: Vec<_> = (0..64).map(|i| Event::new(0.1 + i as f32 / 128.0, false)).collect();
        let mut nodes = Vec::new();
        compress(&events, 64, 0.02, &mut nodes);
        assert!(nodes.len() <= 3, "{nodes:?}");
    }
}
