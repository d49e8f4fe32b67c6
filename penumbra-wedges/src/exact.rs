//! `exact`: the samples of the light that a receiver sees, by counting edges and one ray.

use scene_core::Scene;
use scene_core::bvh::Bvh;
use scene_core::light::LightPoint;
use scene_core::light::sampling::{LightView, SampleKey, Strata};

use crate::area_light::{LightFrame, Outline};
use crate::chord::Chord;
use crate::depth_complexity::DepthComplexity;
use crate::receiver::Receiver;
use crate::samples::Samples;
use crate::wedges::Wedges;

/// What is asked for V.
#[derive(Clone, Copy, Debug)]
pub struct Exact<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// All casters.
    pub tree: &'a Bvh,
    /// Edges and wedges.
    pub wedges: &'a Wedges,
    /// Look only at edges in whose wedge the receiver is.
    pub skip: bool,
}

/// A thread's buffers, and what it did.
#[derive(Debug, Default)]
pub struct Scratch {
    placed: Samples,
    depth: DepthComplexity,
    chords: Vec<(Chord, i32)>,
    points: Vec<LightPoint>,
    blocked: Vec<bool>,
    sample_of: Vec<u32>,
    /// Counts of what was done.
    pub work: Work,
}

/// What was done for some receivers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Work {
    /// Receivers that were asked.
    pub asked: u64,
    /// Those with an edge between them and the light.
    pub penumbra: u64,
    /// Pairs of a receiver and an edge of its tile.
    pub pairs: u64,
    /// Pairs in which the receiver is in the edge's wedge: the inner loop.
    pub inside: u64,
    /// Shadow rays.
    pub rays: u64,
    /// Receivers whose samples were traced instead.
    pub traced: u64,
    /// Receivers whose light is all below their surface.
    pub dark: u64,
    /// Tiles with receivers.
    pub tiles: u64,
    /// Tiles that are in no wedge.
    pub free_tiles: u64,
    /// Wedges left out, over all tiles.
    pub wedges_left_out: u64,
}

impl std::ops::AddAssign for Work {
    fn add_assign(&mut self, other: Self) {
        self.asked += other.asked;
        self.penumbra += other.penumbra;
        self.pairs += other.pairs;
        self.inside += other.inside;
        self.rays += other.rays;
        self.traced += other.traced;
        self.dark += other.dark;
        self.tiles += other.tiles;
        self.free_tiles += other.free_tiles;
        self.wedges_left_out += other.wedges_left_out;
    }
}

impl Exact<'_> {
    /// V of a receiver, by those of `edges` that are in question.
    #[inline(always)]
    pub fn visibility(&self, receiver: &Receiver, edges: &[u32], scratch: &mut Scratch) -> f32 {
        scratch.work.asked += 1;
        let Some(frame) = self.wedges.light.frame(receiver.place()) else {
            return self.traced(receiver, scratch);
        };
        self.find_chords(receiver, &frame, edges, scratch);
        scratch.work.penumbra += u64::from(!scratch.chords.is_empty());
        let is_simple = receiver.sees_all && self.wedges.traced.is_none();
        if is_simple && scratch.chords.is_empty() {
            // No face begins or ends before the light: one ray tells of all.
            scratch.work.rays += 1;
            let is_hidden = self.tree.is_occluded(receiver.origin, self.wedges.light.center());
            return f32::from(u8::from(!is_hidden));
        }
        let Scratch { placed, depth, chords, .. } = scratch;
        let pattern = &self.wedges.patterns[receiver.pattern];
        let samples: &Samples = if matches!(frame.outline, Outline::Cap(_)) {
            pattern.placed(frame.outline, placed);
            placed
        } else {
            pattern
        };
        depth.clear(samples);
        chords.iter().for_each(|(chord, weight)| depth.add(samples, chord, *weight));
        if is_simple {
            let (first, number) = depth.least(samples);
            let point = self.wedges.light.point(&frame, receiver.place(), samples.at(first));
            scratch.work.rays += 1;
            let is_hidden = self.tree.is_occluded(receiver.origin, point);
            return if is_hidden { 0.0 } else { number as f32 / samples.count as f32 };
        }
        self.seen_share(receiver, &frame, scratch)
    }

    /// Puts into `scratch.chords` the edges that lie before the light, with the faces more on their right.
    #[inline(always)]
    fn find_chords(&self, receiver: &Receiver, frame: &LightFrame, edges: &[u32], scratch: &mut Scratch) {
        let wedges = self.wedges;
        let Scratch { chords, work, .. } = scratch;
        let (origin, place) = (receiver.origin, receiver.place());
        chords.clear();
        work.pairs += edges.len() as u64;
        for &index in edges {
            if self.skip && !wedges.wedges[index as usize].holds(place) {
                continue;
            }
            work.inside += 1;
            let edge = &wedges.edges.candidates[index as usize];
            // Rounded once, as rays see it.
            let (a, b) = (frame.project(edge.a - origin), frame.project(edge.b - origin));
            let Some(chord) = Chord::clipped(a, b, frame.is_finite) else { continue };
            let weight = wedges.edges.multiplicity(edge, self.scene, origin) * frame.turn;
            if weight != 0 {
                chords.push((chord, weight));
            }
        }
    }

    /// The share of samples that are seen, from their relative counts, where some are below the surface or hidden by faces
    /// that are traced: the lowest count of the others belongs to seen samples if to any, and one ray tells.
    #[inline(always)]
    fn seen_share(&self, receiver: &Receiver, frame: &LightFrame, scratch: &mut Scratch) -> f32 {
        let Scratch { placed, depth, points, blocked, sample_of, work, .. } = scratch;
        let samples: &Samples = if matches!(frame.outline, Outline::Cap(_)) {
            placed
        } else {
            &self.wedges.patterns[receiver.pattern]
        };
        let point = |sample: usize| self.wedges.light.point(frame, receiver.place(), samples.at(sample));
        points.clear();
        sample_of.clear();
        for sample in 0..samples.count {
            let point = point(sample);
            if receiver.is_above(point) {
                points.push(point);
                sample_of.push(sample as u32);
            }
        }
        if let Some(tree) = &self.wedges.traced {
            work.rays += points.len() as u64;
            blocked.clear();
            blocked.resize(points.len(), false);
            tree.occluded_from(receiver.origin, points, blocked);
            let mut hidden = blocked.iter();
            sample_of.retain(|_| hidden.next() == Some(&false));
        }
        let Some(&first) = sample_of.iter().min_by_key(|&&sample| depth.count(sample as usize)) else {
            return 0.0;
        };
        work.rays += 1;
        if self.tree.is_occluded(receiver.origin, point(first as usize)) {
            return 0.0;
        }
        let least = depth.count(first as usize);
        let seen = sample_of.iter().filter(|&&sample| depth.count(sample as usize) == least).count();
        seen as f32 / samples.count as f32
    }

    /// The samples of the light that a receiver would count, as shadow rays see them.
    pub fn sample_points(&self, receiver: &Receiver, points: &mut Vec<LightPoint>) {
        let light = &self.wedges.light;
        let pattern = &self.wedges.patterns[receiver.pattern];
        points.clear();
        if let Some(frame) = light.frame(receiver.place()) {
            let mut placed = Samples::default();
            pattern.placed(frame.outline, &mut placed);
            points.extend((0..placed.count).map(|s| light.point(&frame, receiver.place(), placed.at(s))));
        } else {
            let view = LightView::new(&light.light, receiver.origin);
            points.resize(pattern.count, light.center());
            let key = SampleKey::new(0, receiver.pattern as u64);
            Strata::new(pattern.count as u32, view.aspect()).fill(&view, key, points);
        }
    }

    /// What casters whose shadow is not counted leave of the light, as the share of samples, and the share of samples above
    /// the surface.
    pub fn seen_of_traced(&self, receiver: &Receiver, scratch: &mut Scratch) -> (f32, f32) {
        if receiver.sees_all && self.wedges.traced.is_none() {
            return (1.0, 1.0);
        }
        let Scratch { points, blocked, work, .. } = scratch;
        self.sample_points(receiver, points);
        let count = points.len() as f32;
        points.retain(|&point| receiver.is_above(point));
        let above = points.len() as f32 / count;
        let Some(tree) = &self.wedges.traced else { return (1.0, above) };
        work.rays += points.len() as u64;
        blocked.clear();
        blocked.resize(points.len(), false);
        tree.occluded_from(receiver.origin, points, blocked);
        let seen = blocked.iter().filter(|&&blocked| !blocked).count() as f32;
        (seen / (points.len() as f32).max(1.0), above)
    }

    /// V by one shadow ray a sample.
    pub fn traced(&self, receiver: &Receiver, scratch: &mut Scratch) -> f32 {
        let Scratch { points, blocked, work, .. } = scratch;
        work.traced += 1;
        self.sample_points(receiver, points);
        let count = points.len();
        points.retain(|&point| receiver.is_above(point));
        work.rays += points.len() as u64;
        blocked.clear();
        blocked.resize(points.len(), false);
        self.tree.occluded_from(receiver.origin, points, blocked);
        let seen = blocked.iter().filter(|&&blocked| !blocked).count();
        seen as f32 / count as f32
    }
}
