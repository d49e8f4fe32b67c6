//! How many faces lie before each sample of the light, up to a constant: by the edges alone.
//!
//! # The sign of an edge
//! Call a face f *turned to the receiver* p if its corners are given so that p sees them counter-clockwise: s(f)·f with
//! s(f) = ±1 the facing of f from p. On the plane of the light all turned faces have the same orientation: with p in the
//! origin, n = (b − a) × (c − a) has n·(p − a) = −n·a = −det(a, b, c), so s(f) = −sign det(a, b, c). [`LightFrame::project`]
//! is linear, and det(projected) = det(M)·det(a, b, c) is the product of the three W times twice the signed area of
//! (a, b, c) on the plane. So if det M > 0, a turned face runs clockwise there, and has its inside to the right of each of its directed edges; if
//! det M < 0 ([`LightFrame::turn`] = −1), to the left.
//!
//! The faces at an edge e add up to m(e) = Σ sign(e, f)·s(f) ([`EdgeTopology`](scene_core::geometry::EdgeTopology)). So
//! whoever crosses the image of e from its left to its right has m(e)·turn more faces before him.
//!
//! For a face with all of the light on one side, s(f) is known without p: where its edge lies between p and a point q of the
//! light, the line pq crosses the face's plane there, so that p and q are on different sides of it, s(f) from p is the
//! opposite of that from q. Others are asked exactly at p.
//!
//! # The path
//! The number of faces before q, less that before the foot of the light's middle line u = 0, is the sum over the edges crossed
//! on the way from there: up the middle line to q's height, then across to q. No face may cross the way itself, nor the
//! rays to it: faces that touch the light are traced instead of counted. For the image of an edge, directed upwards with its
//! ends (u₀, v₀) and (u₁, v₁), that comes to a sum of
//!
//! | where q is | crossings |
//! | --- | --- |
//! | below the edge, v < v₀ | 0 |
//! | beside it, v₀ ≤ v < v₁ | \[q right of the edge\] − \[u₀ < 0\] |
//! | above it, v ≥ v₁ | \[u₁ < 0\] − \[u₀ < 0\] |
//!
//! Whether q is above an end, and whether an end is left of the middle line, is the same for all edges that meet in the end.
//! So rounding may put a sample on the wrong side of an edge that is nearer to it than 10⁻⁷ of the light, but no sum is ever torn:
//! the counts are those of an outline moved by as much. Ends that are cut off lie outside the light, where the three rows agree.
//!
//! After Laine, Aila, Assarsson, Lehtinen and Akenine-Möller, *Soft Shadow Volumes for Ray Tracing* (2005), who go from the
//! light's left border: the way along the middle stays inside of round lights.
//!
//! [`LightFrame::project`]: crate::area_light::LightFrame::project
//! [`LightFrame::turn`]: crate::area_light::LightFrame::turn

use crate::chord::Chord;
use crate::samples::{LANES, Samples};

/// Counts of one receiver, relative to each other.
#[derive(Clone, Debug, Default)]
pub struct DepthComplexity {
    counts: Vec<[i32; LANES]>,
}

impl DepthComplexity {
    /// Starts anew, with nothing before any of the samples.
    pub fn clear(&mut self, samples: &Samples) {
        self.counts.clear();
        self.counts.resize(samples.u.len(), [0; LANES]);
    }

    /// Adds an edge with `weight` faces more on its right than on its left, seen along its direction.
    #[inline(always)]
    pub fn add(&mut self, samples: &Samples, chord: &Chord, weight: i32) {
        let (mut low, mut high, mut weight) = (chord.start, chord.end, weight);
        if low.y > high.y {
            (low, high, weight) = (high, low, -weight);
        }
        // Neighbours must compare samples with the same numbers.
        let (low_v, high_v) = (low.y as f32, high.y as f32);
        let [left_low, left_high] = [low.x, high.x].map(|u| i32::from(u < 0.0));
        let above = (left_high - left_low) * weight;
        // a·u + b·v + c > 0 right of the edge.
        let (a, b) = (high.y - low.y, low.x - high.x);
        let c = -(a * low.x + b * low.y);
        let (a, b, c) = (a as f32, b as f32, c as f32);
        for (group, &[least, greatest]) in samples.span.iter().enumerate() {
            if greatest < low_v {
                continue;
            }
            let counts = &mut self.counts[group];
            if least >= high_v {
                if above == 0 {
                    break;
                }
                counts.iter_mut().for_each(|count| *count += above);
                continue;
            }
            let (u, v) = (&samples.u[group], &samples.v[group]);
            for lane in 0..LANES {
                let beside = weight * (i32::from(a * u[lane] + b * v[lane] + c > 0.0) - left_low);
                let not_below = if v[lane] >= high_v { above } else { beside };
                counts[lane] += if v[lane] >= low_v { not_below } else { 0 };
            }
        }
    }

    /// The first sample of those with the least count, and how many these are.
    #[inline(always)]
    pub fn least(&self, samples: &Samples) -> (usize, usize) {
        // What fills the last group up repeats a sample: the least stays the same.
        let mut of_lane = [i32::MAX; LANES];
        for counts in &self.counts {
            for lane in 0..LANES {
                of_lane[lane] = of_lane[lane].min(counts[lane]);
            }
        }
        let least = of_lane.into_iter().fold(i32::MAX, i32::min);
        let mut number = [0; LANES];
        for counts in &self.counts {
            for lane in 0..LANES {
                number[lane] += i32::from(counts[lane] == least);
            }
        }
        let mut number: i32 = number.into_iter().sum();
        let filled = self.counts.len() * LANES - samples.count;
        if samples.count > 0 && self.count(samples.count - 1) == least {
            number -= filled as i32;
        }
        let first = (0..samples.count).find(|&sample| self.count(sample) == least).unwrap_or(0);
        (first, number.max(0) as usize)
    }

    /// The count of a sample.
    #[inline]
    pub fn count(&self, sample: usize) -> i32 {
        self.counts[sample / LANES][sample % LANES]
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec2;
    use proptest::prelude::*;

    use super::*;

    proptest! {
        /// Triangles on the plane, by their edges, against the samples inside them.
        #[test]
        fn counts_are_those_of_the_faces(
            corners in prop::collection::vec(prop::array::uniform6(-2.0_f64..2.0), 1..5),
            is_round in any::<bool>(),
        ) {
            let samples = Samples::new(is_round, 61, 1, 2);
            let mut depth = DepthComplexity::default();
            depth.clear(&samples);
            let mut expected = vec![0; samples.count];
            for c in &corners {
                let mut p = [0, 2, 4].map(|i| DVec2::new(c[i], c[i + 1]));
                // Clockwise: the inside is on the right.
                if (p[1] - p[0]).perp_dot(p[2] - p[0]) > 0.0 {
                    p.swap(1, 2);
                }
                for (i, j) in [(0, 1), (1, 2), (2, 0)] {
                    if let Some(chord) = Chord::clipped(p[i].extend(1.0) * 0.5, p[j].extend(1.0) * 0.5, true) {
                        depth.add(&samples, &chord, 1);
                    }
                }
                for (sample, expected) in expected.iter_mut().enumerate() {
                    let q = samples.at(sample);
                    let right = |i: usize, j: usize| (p[j] - p[i]).perp_dot(q - p[i]) < 0.0;
                    *expected += i32::from(right(0, 1) && right(1, 2) && right(2, 0));
                }
            }
            let (first, number) = depth.least(&samples);
            let least = (0..samples.count).map(|sample| depth.count(sample)).min();
            prop_assert_eq!(Some(depth.count(first)), least);
            prop_assert_eq!(number, (0..samples.count).filter(|&s| Some(depth.count(s)) == least).count());
            let offset = depth.count(0) - expected[0];
            for (sample, expected) in expected.iter().enumerate() {
                prop_assert_eq!(depth.count(sample) - offset, *expected, "sample {}", samples.at(sample));
            }
        }
    }
}
