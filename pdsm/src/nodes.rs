//! The data array of figure 6: nodes of piecewise linear functions, as 32-bit floats or packed into 2 × 16 bits.
//!
//! Packing moves a node by at most half a step along either axis: t by 1/131,070 of the range of a window's nodes, V by
//! 1/65,535, since V reaches from −½ to 1½ (the error bound is at most ½). A segment moves no farther than its ends, so
//! that a packed function at t is within that step of V of some value that the function has within that step of t. The
//! lookup reads before the receiver by the one ([`Nodes::depth_error`]); the other adds to `max_error`.

use bytemuck::{Pod, Zeroable};

/// A point of a piecewise linear function of t. Of two nodes at the same t the first is the limit from before.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Node {
    /// Depth along the ray, in the layout's parameter.
    pub t: f32,
    /// V there; beyond 0 or 1 by up to the error bound, where the line that passes most of the function does so.
    pub visibility: f32,
}

/// A node in 32 bits: steps of t in the upper half, of V in the lower.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(transparent)]
pub struct PackedNode(pub u32);

/// V of step 0 of a packed node.
const LOWEST: f32 = -0.5;
/// V a step of a packed node.
const VISIBILITY_STEP: f32 = 2.0 / 65_535.0;

/// The t of packed nodes: `start` + steps · `step`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DepthSteps {
    /// t of step 0.
    pub start: f32,
    /// t a step.
    pub step: f32,
}

impl DepthSteps {
    /// 65,536 steps over all of `nodes`.
    fn over(nodes: &[Node]) -> Self {
        let low = nodes.iter().fold(f32::INFINITY, |low, node| low.min(node.t));
        let high = nodes.iter().fold(f32::NEG_INFINITY, |high, node| high.max(node.t));
        if nodes.is_empty() || high <= low {
            return Self { start: if nodes.is_empty() { 0.0 } else { low }, step: 1.0 };
        }
        Self { start: low, step: (high - low) / 65_535.0 }
    }

    fn pack(self, node: Node) -> PackedNode {
        let steps = |value: f32| value.round().clamp(0.0, 65_535.0) as u32;
        let t = steps((node.t - self.start) / self.step);
        PackedNode(t << 16 | steps((node.visibility - LOWEST) / VISIBILITY_STEP))
    }

    /// The node that was packed, to half a step.
    #[inline]
    pub(crate) fn unpack(self, node: PackedNode) -> Node {
        Node {
            t: self.start + (node.0 >> 16) as f32 * self.step,
            visibility: LOWEST + (node.0 & 0xffff) as f32 * VISIBILITY_STEP,
        }
    }
}

/// The nodes of all functions of a window, one function after the other.
#[derive(Clone, Debug, PartialEq)]
pub enum Nodes {
    /// 8 bytes a node.
    Full(Vec<Node>),
    /// 4 bytes a node.
    Packed(Vec<PackedNode>, DepthSteps),
}

impl Default for Nodes {
    fn default() -> Self {
        Self::Full(Vec::new())
    }
}

impl Nodes {
    /// The same functions in 16 bits a number.
    pub fn packed(nodes: &[Node]) -> Self {
        let steps = DepthSteps::over(nodes);
        Self::Packed(nodes.iter().map(|&node| steps.pack(node)).collect(), steps)
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        match self {
            Self::Full(nodes) => nodes.len(),
            Self::Packed(nodes, _) => nodes.len(),
        }
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The array as it lies in memory, on the GPU and in files.
    pub fn words(&self) -> &[u32] {
        match self {
            Self::Full(nodes) => bytemuck::cast_slice(nodes),
            Self::Packed(nodes, _) => bytemuck::cast_slice(nodes),
        }
    }

    /// Node number `index`.
    ///
    /// # Panics
    /// If there are not so many.
    pub fn get(&self, index: usize) -> Node {
        match self {
            Self::Full(nodes) => nodes[index],
            Self::Packed(nodes, steps) => steps.unpack(nodes[index]),
        }
    }

    /// By how much t of a node may be off: half a step of packed ones, and 2 ulps of the largest for the unpacking.
    pub fn depth_error(&self) -> f32 {
        match self {
            Self::Full(_) => 0.0,
            Self::Packed(_, steps) => {
                let largest = steps.start.abs().max((steps.start + 65_535.0 * steps.step).abs());
                0.5 * steps.step + 2.0 * f32::EPSILON * largest
            }
        }
    }

    /// V at `t` of the function whose nodes are `range`: 1 before its first node and without nodes; at a step the value
    /// after it.
    #[inline]
    pub fn evaluate(&self, range: std::ops::Range<usize>, t: f32) -> f32 {
        match self {
            Self::Full(nodes) => evaluate_with(&nodes[range], t, |node| node),
            Self::Packed(nodes, steps) => evaluate_with(&nodes[range], t, |node| steps.unpack(node)),
        }
    }
}

/// V at `t` of the function with these nodes: see [`Nodes::evaluate`].
#[inline]
pub fn evaluate(nodes: &[Node], t: f32) -> f32 {
    evaluate_with(nodes, t, |node| node)
}

#[inline(always)]
fn evaluate_with<N: Copy>(nodes: &[N], t: f32, node: impl Fn(N) -> Node) -> f32 {
    // Most receivers lie before or behind all of a function, and most functions are short.
    let Some(&last) = nodes.last() else { return 1.0 };
    let last = node(last);
    if last.t <= t {
        return last.visibility.clamp(0.0, 1.0);
    }
    let after = nodes.partition_point(|&n| node(n).t <= t);
    let Some(before) = after.checked_sub(1) else { return 1.0 };
    between(node(nodes[before]), node(nodes[after]), t)
}

/// V at `t` between two nodes.
#[inline(always)]
pub(crate) fn between(a: Node, b: Node, t: f32) -> f32 {
    // Both differences are positive: a.t ≤ t < b.t.
    let visibility = a.visibility + (b.visibility - a.visibility) * ((t - a.t) / (b.t - a.t));
    visibility.clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn packing_moves_a_function_by_half_a_step(
            nodes in prop::collection::vec((-2.0f32..1.0, -0.2f32..1.2), 2..40),
            at in prop::collection::vec(0.0f32..1.0, 50),
        ) {
            let mut nodes: Vec<_> = nodes.iter().map(|&(t, visibility)| Node { t, visibility }).collect();
            nodes.sort_by(|a, b| a.t.total_cmp(&b.t));
            let packed = Nodes::packed(&nodes);
            let (first, last) = (nodes[0].t, nodes[nodes.len() - 1].t);
            let reach = packed.depth_error() + 1e-6;
            for share in at {
                let t = first + (last - first) * share;
                // Extremes of a piecewise linear function lie at the ends of an interval and at the nodes within.
                let ends = [t - reach, t + reach];
                let within = nodes.iter().filter(|n| (ends[0]..=ends[1]).contains(&n.t)).map(|n| n.visibility.clamp(0.0, 1.0));
                let values = ends.iter().map(|&t| evaluate(&nodes, t)).chain(within);
                let (low, high) = values.fold((1.0f32, 0.0f32), |(a, b), v| (a.min(v), b.max(v)));
                let got = packed.evaluate(0..nodes.len(), t);
                let bound = 0.5 * VISIBILITY_STEP + 2e-6;
                prop_assert!(got >= low - bound && got <= high + bound, "{} not in {} to {} at {}", got, low, high, t);
            }
        }
    }

    #[test]
    fn packed_nodes_keep_their_order_and_their_ends() {
        let nodes = [(-1.5, 1.0), (-1.5, 0.25), (0.125, 0.0)].map(|(t, visibility)| Node { t, visibility });
        let packed = Nodes::packed(&nodes);
        assert_eq!((packed.len(), packed.words().len()), (3, 3));
        assert_eq!(packed.get(0).t, packed.get(1).t);
        assert_eq!(packed.evaluate(0..3, -2.0), 1.0);
        assert!(packed.evaluate(0..3, 0.5) < 2e-5);
        let one = Nodes::packed(&nodes[..1]);
        assert_eq!(one.get(0).t, -1.5);
        assert!(Nodes::packed(&[]).is_empty());
    }
}
