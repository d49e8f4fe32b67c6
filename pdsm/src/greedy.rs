//! Segments as the papers draw them: each from the end of the one before, as far as a line from there stays within the
//! bound. Some five times faster than looking for the fewest (`tunnel.rs`), at more nodes.

use crate::nodes::Node;

/// V by maps in shadow, as greedy lines take it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Levels {
    /// Maps in all.
    pub(crate) views: u32,
    /// What each of them hides.
    pub(crate) share: f32,
    /// How far lines may be off, where that is the same everywhere.
    pub(crate) bound: f32,
    /// Maps in shadow from which on V is farther from 1 than that.
    pub(crate) needed: u32,
}

impl Levels {
    /// V with so many maps in shadow, to an ulp of 1.
    #[inline]
    pub(crate) fn at(&self, shadowed: u32) -> f32 {
        1.0 - shadowed as f32 * self.share
    }
}

/// The segment being drawn: from `origin`, with any slope in a window.
#[derive(Debug)]
pub(crate) struct Greedy<'a> {
    nodes: &'a mut Vec<Node>,
    origin: Node,
    /// Slopes that stay within the bound of everything visited.
    slopes: [f32; 2],
    /// t of the last point visited.
    last: f32,
}

impl<'a> Greedy<'a> {
    pub(crate) fn new(origin: Node, nodes: &'a mut Vec<Node>) -> Self {
        nodes.push(origin);
        Self { nodes, origin, slopes: [f32::NEG_INFINITY, f32::INFINITY], last: origin.t }
    }

    #[inline]
    fn begin(&mut self, origin: Node) {
        self.nodes.push(origin);
        self.origin = origin;
        self.slopes = [f32::NEG_INFINITY, f32::INFINITY];
        self.last = origin.t;
    }

    /// Carries the line on to a point of the function, past which it may be off by `bound`; where none can pass, ends it
    /// and begins another.
    #[inline]
    fn visit(&mut self, point: Node, bound: f32) {
        if self.try_visit(point, bound) {
            return;
        }
        self.end();
        if !self.try_visit(point, bound) {
            self.begin(point);
        }
    }

    /// Visits both sides of a step, each value of V with its bound. Mostly the line passes both, which one look tells: slopes
    /// divide by the same run, and of two quotients the larger is that of the larger number, rounded as it is.
    #[inline]
    pub(crate) fn visit_step(&mut self, t: f32, sides: [[f32; 2]; 2]) {
        let run = t - self.origin.t;
        if run > 0.0 {
            let rises = sides.map(|[visibility, _]| visibility - self.origin.visibility);
            let least = (rises[0] - sides[0][1]).max(rises[1] - sides[1][1]);
            let most = (rises[0] + sides[0][1]).min(rises[1] + sides[1][1]);
            let low = self.slopes[0].max(least / run);
            let high = self.slopes[1].min(most / run);
            if low <= high {
                (self.slopes, self.last) = ([low, high], t);
                return;
            }
        }
        for [visibility, bound] in sides {
            self.visit(Node { t, visibility }, bound);
        }
    }

    #[inline]
    fn try_visit(&mut self, point: Node, bound: f32) -> bool {
        let (run, rise) = (point.t - self.origin.t, point.visibility - self.origin.visibility);
        if run <= 0.0 {
            return rise.abs() <= bound;
        }
        let low = self.slopes[0].max((rise - bound) / run);
        let high = self.slopes[1].min((rise + bound) / run);
        let fits = low <= high;
        if fits {
            (self.slopes, self.last) = ([low, high], point.t);
        }
        fits
    }

    /// Puts a node where the line ends, if it has come anywhere.
    pub(crate) fn end(&mut self) {
        if self.last > self.origin.t {
            let slope = 0.5 * (self.slopes[0] + self.slopes[1]);
            let visibility = self.origin.visibility + slope * (self.last - self.origin.t);
            self.begin(Node { t: self.last, visibility });
        }
    }
}
