//! The fewest straight lines through a tunnel: a polyline over t that passes every gate, whose corners may lie anywhere
//! in the tunnel (Imai and Iri 1986; the greedy choice is optimal).
//!
//! Lines that pass all gates so far lie between two extreme ones: the steepest, which leans on a low corner and, later,
//! on a high one, and the flattest, the other way round. A gate that the steepest line misses because it lies too high is
//! missed by all; then the steepest line is taken as it is, and the next one may leave it anywhere between its high
//! corner, where no line can be higher, and the point where it leaves the tunnel. So the next line must stay below the
//! high corners from there on and above that exit: which is again a start with corners on both sides. Likewise for the
//! flattest line, mirrored. Corners come to lie on convex chains; each is put there and taken off at most twice, so that
//! the cost is in proportion to the gates.

use crate::nodes::Node;

/// What every line must pass: a value from `low` to `high` at `t`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Gate {
    pub(crate) t: f64,
    pub(crate) low: f64,
    pub(crate) high: f64,
    /// The tunnel's lower and upper wall since the gate before.
    pub(crate) walls: [f64; 2],
}

impl Gate {
    /// What keeps the steepest line (side 0) or the flattest one (side 1) from being steeper or flatter.
    fn cap(&self, side: usize) -> f64 {
        if side == 0 { self.high } else { self.low }
    }
}

/// 1 for the steepest line's side, −1 for the flattest one's, where all is mirrored.
const SIGN: [f64; 2] = [1.0, -1.0];

#[derive(Clone, Copy, Debug)]
struct Corner {
    t: f64,
    y: f64,
}

#[derive(Clone, Copy, Debug)]
struct Line {
    at: Corner,
    slope: f64,
}

impl Line {
    #[inline]
    fn value(&self, t: f64) -> f64 {
        self.at.y + self.slope * (t - self.at.t)
    }
}

/// An extreme line and the gate on whose cap it leans.
#[derive(Clone, Copy, Debug)]
struct Extreme {
    line: Line,
    gate: usize,
}

/// Corners that a line leans on, the left ones dropped as it turns.
#[derive(Clone, Debug, Default)]
struct Chain {
    corners: Vec<Corner>,
    first: usize,
}

impl Chain {
    fn start(&mut self) {
        self.corners.clear();
        self.first = 0;
    }

    /// Adds a corner to the right; those that no line can lean on any more are dropped.
    #[inline]
    fn push(&mut self, side: usize, c: Corner) {
        while let [.., a, b] = self.corners[self.first..] {
            let cross = (b.t - a.t) * (c.y - a.y) - (b.y - a.y) * (c.t - a.t);
            if cross * SIGN[side] < 0.0 {
                break;
            }
            self.corners.pop();
        }
        self.corners.push(c);
    }

    /// The extreme line of `side` that ends in `end`, to the right of all corners; `None` if it is vertical.
    #[inline]
    fn lean(&mut self, side: usize, end: Corner) -> Option<Line> {
        let mut best = *self.corners.get(self.first)?;
        while let Some(&next) = self.corners.get(self.first + 1) {
            let steeper = (end.y - next.y) * (end.t - best.t) - (end.y - best.y) * (end.t - next.t);
            if SIGN[side] * steeper >= 0.0 {
                break;
            }
            best = next;
            self.first += 1;
        }
        let slope = (end.y - best.y) / (end.t - best.t);
        slope.is_finite().then_some(Line { at: end, slope })
    }
}

/// Where the polyline may change from a line that is settled to the next one.
#[derive(Clone, Copy, Debug)]
struct Settled {
    line: Line,
    from: f64,
    until: f64,
}

/// A tunnel being passed, gate by gate. Keeps its memory from one to the next.
#[derive(Clone, Debug, Default)]
pub(crate) struct Tunnel {
    gates: Vec<Gate>,
    /// Corners that the steepest line leans on, low ones, and those of the flattest.
    chains: [Chain; 2],
    extremes: [Option<Extreme>; 2],
    settled: Option<Settled>,
}

impl Tunnel {
    /// Begins a tunnel at its first gate.
    pub(crate) fn start(&mut self, gate: Gate) {
        self.gates.clear();
        self.extremes = [None; 2];
        self.settled = None;
        self.chains.iter_mut().for_each(Chain::start);
        self.enter(gate);
    }

    /// Carries the polyline on to a gate to the right of the last one; lines that are settled thereby become `nodes`.
    #[inline]
    pub(crate) fn pass(&mut self, gate: Gate, nodes: &mut Vec<Node>) {
        for (side, sign) in SIGN.into_iter().enumerate() {
            let Some(extreme) = self.extremes[side] else { continue };
            if sign * (extreme.line.value(gate.t) - gate.cap(1 - side)) < 0.0 {
                self.turn(side, extreme, &gate, nodes);
                break;
            }
        }
        self.enter(gate);
    }

    /// Narrows the extreme lines to those that pass `gate`.
    #[inline]
    fn enter(&mut self, gate: Gate) {
        let index = self.gates.len();
        for (side, sign) in SIGN.into_iter().enumerate() {
            let cap = gate.cap(side);
            let is_narrower =
                self.extremes[side].is_none_or(|extreme| sign * (cap - extreme.line.value(gate.t)) < 0.0);
            if is_narrower {
                let line = self.chains[side].lean(side, Corner { t: gate.t, y: cap });
                self.extremes[side] = line.map(|line| Extreme { line, gate: index });
            }
        }
        for side in 0..2 {
            self.chains[side].push(side, Corner { t: gate.t, y: gate.cap(1 - side) });
        }
        self.gates.push(gate);
    }

    /// Settles the extreme line of `side`, which misses `gate`, and starts the next one.
    fn turn(&mut self, side: usize, extreme: Extreme, gate: &Gate, nodes: &mut Vec<Node>) {
        let Extreme { line, gate: leaning } = extreme;
        let (last, leans) = (self.gates[self.gates.len() - 1], self.gates[leaning]);
        // It leaves through the tunnel's wall, or comes as far as the gate.
        let wall = gate.walls[side];
        let (here, there) = (line.value(last.t), line.value(gate.t));
        let until = if SIGN[side] * (there - wall) < 0.0 {
            let share = ((here - wall) / (here - there)).clamp(0.0, 1.0);
            last.t + (gate.t - last.t) * share
        } else {
            gate.t
        };
        self.put(line, nodes);
        self.settled = Some(Settled { line, from: leans.t, until });
        self.chains.iter_mut().for_each(Chain::start);
        if until < gate.t {
            self.chains[side].push(side, Corner { t: until, y: line.value(until) });
        }
        for passed in &self.gates[leaning..] {
            self.chains[1 - side].push(1 - side, Corner { t: passed.t, y: passed.cap(side) });
        }
        self.extremes[side] = None;
        // Entering the gate replaces it: its cap is what the line missed.
        self.extremes[1 - side] = Some(Extreme { line, gate: leaning });
    }

    /// Puts the node where `line` begins: at the first gate, or where it meets the line before.
    fn put(&self, line: Line, nodes: &mut Vec<Node>) {
        let corner = match self.settled {
            None => Corner { t: self.gates[0].t, y: line.value(self.gates[0].t) },
            Some(Settled { line: before, from, until }) => {
                let met = until + (line.value(until) - before.value(until)) / (before.slope - line.slope);
                // Parallel within rounding: anywhere.
                let t = if met.is_finite() { met.clamp(from, until) } else { until };
                Corner { t, y: before.value(t) }
            }
        };
        nodes.push(node(corner));
    }

    /// Ends the polyline at the last gate passed, as near to `value` there as its lines allow.
    pub(crate) fn finish(&mut self, value: f64, nodes: &mut Vec<Node>) {
        let last = self.gates[self.gates.len() - 1];
        let line = match self.extremes.map(|extreme| extreme.map(|extreme| extreme.line)) {
            [Some(steepest), Some(flattest)] => {
                let (low, high) = (flattest.value(last.t), steepest.value(last.t));
                let share = ((value - low) / (high - low)).clamp(0.0, 1.0);
                // Mixtures of two lines through the tunnel pass it, too.
                let share = if share.is_finite() { share } else { 0.5 };
                let y = low + (high - low) * share;
                let slope = flattest.slope + (steepest.slope - flattest.slope) * share;
                Line { at: Corner { t: last.t, y }, slope }
            }
            // The last gate is where a line was settled: any value of it is reached by a line as steep as need be.
            [Some(line), None] | [None, Some(line)] => line,
            [None, None] => {
                let y = value.clamp(last.low, last.high);
                return nodes.push(node(Corner { t: last.t, y }));
            }
        };
        self.put(line, nodes);
        nodes.push(node(Corner { t: last.t, y: line.value(last.t) }));
    }
}

#[inline]
fn node(corner: Corner) -> Node {
    Node { t: corner.t as f32, visibility: corner.y as f32 }
}
