//! Lookups of many receivers side by side (algorithm 2), four functions each.
//!
//! A search waits for memory at every step, and no step can be asked for before the one before it is answered. So
//! receivers are looked up [`BATCH`] at a time, stage by stage: where they lie, where their functions start, both ends of
//! each function, then the searches within, one step of each in turn. What a stage reads does not depend on what else it
//! reads, so that the processor waits for many of them at once. V is what one lookup after the other gives, bit for bit.

use glam::{Vec2, Vec3};
use gnomon_shadow_map::receiver_plane::view_tolerance;
use scene_core::{GBuffer, Light, Scene};

use crate::cpu::Window;
use crate::functions::Functions;
use crate::layout::WindowPoint;
use crate::maps::POSITION_ERROR;
use crate::nodes::{Node, Nodes, between};

/// Receivers that are looked up side by side.
pub(crate) const BATCH: usize = 32;

/// Functions that they are read from.
const FUNCTIONS: usize = 4 * BATCH;

/// What the lookups read.
#[derive(Clone, Copy, Debug)]
pub struct Lookup<'a> {
    /// Geometry, for what receives.
    pub scene: &'a Scene,
    /// The light.
    pub light: &'a Light,
    /// Its windows.
    pub windows: &'a [Window],
    /// Those of casters that have a PDSM of their own.
    pub moving: &'a [Window],
    /// [`gnomon_shadow_map::receiver_plane::plane_tolerance`].
    pub tolerance: f32,
    /// Pixels that interpolation reaches along each axis: 1 reads four pixels, 0 the nearest one.
    pub radius: u32,
}

/// Half the diagonal way from a texel's middle to its corner, in texels along each axis, and what the drawing of maps
/// adds (the rasteriser of scene-core half as much): how far the place whose depth a texel holds may be from the ray that
/// reads it.
const READ_DISTANCE: f32 = 0.5 + POSITION_ERROR;

/// What t may be off, relative to |t| + |1 − t|, between a receiver and the map's point of the same place: with u = 2⁻²⁴
/// the receiver's t is off by 3 u of F/z = 1 − t and u of t, the map's depth by 10 u of its own largest
/// ([`scene_core::raster::depth_error`]), which is as much of 1 − t, and the event by 4 u of t. Together below 24 u.
pub(crate) const T_ERROR: f32 = 24.0 / 16_777_216.0;

/// How much before a surface with this slope, in t a texel, it is read: see [`Lookup::surfaces`].
#[inline]
pub(crate) fn read_before(slope: Vec2) -> f32 {
    READ_DISTANCE * slope.abs().element_sum()
}

/// What is asked of a window.
#[derive(Clone, Copy, Default)]
struct Request {
    /// Which receiver of the batch asks.
    receiver: u32,
    /// Number of the window.
    window: u32,
    /// Position on the PDSM, in pixels.
    pixel: Vec2,
    /// Depth there.
    t: f32,
    /// How much it grows from pixel to pixel.
    slope: Vec2,
}

/// The requests of a batch.
struct Requests {
    all: [Request; BATCH],
    count: usize,
}

impl Requests {
    #[inline(always)]
    fn new() -> Self {
        Self { all: [Request::default(); BATCH], count: 0 }
    }

    /// Asks at a position on the window, at depth `t` there and `slope` more for every texel to the side.
    #[inline(always)]
    fn push(
        &mut self,
        receiver: usize,
        (number, window, at): (usize, &Window, WindowPoint),
        t: f32,
        slope: Vec2,
    ) {
        self.all[self.count] = Request {
            receiver: receiver as u32,
            window: number as u32,
            pixel: window.grid.from_texels(at.texel),
            t,
            slope: slope * window.grid.ratio as f32,
        };
        self.count += 1;
    }

    /// The requests, and V of each in `found`.
    #[inline(always)]
    fn answer(&self, windows: &[Window], radius: u32, found: &mut [f32; BATCH]) -> &[Request] {
        let all = &self.all[..self.count];
        let mut start = 0;
        while start < all.len() {
            let number = all[start].window;
            let end = start + all[start..].iter().take_while(|request| request.window == number).count();
            let functions = &windows[number as usize].functions;
            if radius == 1 {
                bilinear(functions, &all[start..end], &mut found[start..end]);
            } else {
                for (request, found) in all[start..end].iter().zip(&mut found[start..end]) {
                    *found = request.look_up(functions, radius);
                }
            }
            start = end;
        }
        all
    }
}

impl Lookup<'_> {
    /// `shade.lookup` of at most [`BATCH`] pixels of the G-buffer from `first` on: V, NaN where no surface is seen.
    ///
    /// A function is read before the receiver's own surface, by what that surface can differ within a texel. On its
    /// plane t changes by g a texel of the window. In the map of a sample with step D a ray at t − b lies where the
    /// plane is at t − b·(g'·D), with g' = g/(1 + g·D) the slope in that map, and the texel's depth was taken up to
    /// [`READ_DISTANCE`] = r away along both axes. The plane does not shadow itself if b·(1 − g'·D) ≥ r·|g'|₁; since
    /// 1 − g'·D = 1/(1 + g·D) that is b ≥ r·|g|₁, the same for every map.
    ///
    /// Four pixels are read each where its own ray meets the receiver's plane.
    #[inline(always)]
    pub(crate) fn surfaces(&self, gbuffer: &GBuffer, first: usize, values: &mut [f32]) {
        let mut asked = [false; BATCH];
        for ((value, asked), pixel) in values.iter_mut().zip(&mut asked).zip(first..) {
            *value = if !gbuffer.is_seen(pixel) {
                f32::NAN
            } else if !self.scene.objects()[gbuffer.object[pixel] as usize].flags.receives {
                1.0
            } else if !self.light.reaches(gbuffer.position[pixel]) {
                0.0
            } else {
                *asked = true;
                1.0
            };
        }
        // Which part of the light still and moving casters hide is not known: the product takes the parts to be independent.
        for windows in [self.windows, self.moving] {
            if !windows.is_empty() {
                self.multiply_surfaces(windows, gbuffer, first, &asked, values);
            }
        }
    }

    /// Multiplies V of the pixels that are `asked` for by that of these windows.
    #[inline(always)]
    fn multiply_surfaces(
        &self,
        windows: &[Window],
        gbuffer: &GBuffer,
        first: usize,
        asked: &[bool; BATCH],
        values: &mut [f32],
    ) {
        let mut requests = Requests::new();
        for (i, value) in values.iter_mut().enumerate().filter(|&(i, _)| asked[i]) {
            let (receiver, normal) = (gbuffer.position[first + i], gbuffer.normal[first + i]);
            let Some((number, window, at)) = locate(windows, receiver) else { continue };
            let layout = &window.layout;
            let (slope, lift) = layout.plane_slope(receiver, normal, at.t);
            let rounding = (self.tolerance + view_tolerance(gbuffer.depth[first + i])) * lift
                + T_ERROR * (at.t.abs() + (1.0 - at.t).abs())
                + window.functions.nodes().depth_error();
            let before = at.t - read_before(slope) - rounding;
            if before.is_finite() {
                requests.push(i, (number, window, at), before, slope);
            } else {
                // The plane holds the light's middle: half of the light is below it at best.
                *value *= layout.share_above(receiver, normal);
            }
        }
        let mut found = [1.0; BATCH];
        let requests = requests.answer(windows, self.radius, &mut found);
        for (request, &visibility) in requests.iter().zip(&found) {
            let pixel = first + request.receiver as usize;
            let above = if visibility == 0.0 {
                0.0
            } else {
                let layout = &windows[request.window as usize].layout;
                layout.share_above(gbuffer.position[pixel], gbuffer.normal[pixel])
            };
            values[request.receiver as usize] *= visibility.min(above);
        }
    }

    /// V at at most [`BATCH`] free points, which have no surface of their own; NaN at what is no point.
    #[inline(always)]
    pub(crate) fn free_points(&self, points: &[Vec3], values: &mut [f32]) {
        let mut asked = [false; BATCH];
        for ((value, asked), &point) in values.iter_mut().zip(&mut asked).zip(points) {
            *value = if !point.is_finite() {
                f32::NAN
            } else if !self.light.reaches(point) {
                0.0
            } else {
                *asked = true;
                1.0
            };
        }
        // Windows of parts come first, and answer for surfaces alone.
        let parts = self.windows.partition_point(|window| window.layout.is_of_part());
        for windows in [&self.windows[parts..], self.moving] {
            let mut requests = Requests::new();
            for (i, &point) in points.iter().enumerate().filter(|&(i, _)| asked[i]) {
                if let Some(found) = locate(windows, point) {
                    requests.push(i, found, found.2.t, Vec2::ZERO);
                }
            }
            let mut found = [1.0; BATCH];
            let requests = requests.answer(windows, self.radius, &mut found);
            for (request, visibility) in requests.iter().zip(found) {
                values[request.receiver as usize] *= visibility;
            }
        }
    }
}

#[inline(always)]
fn locate(windows: &[Window], point: Vec3) -> Option<(usize, &Window, WindowPoint)> {
    for (number, window) in windows.iter().enumerate() {
        if let Some(at) = window.layout.locate(point) {
            return Some((number, window, at));
        }
    }
    None
}

impl Request {
    /// Far outside of the window, and for what is no number, there is nothing; the limit keeps conversions to integers from
    /// saturating.
    #[inline(always)]
    fn is_near(&self) -> bool {
        self.pixel.abs().max_element() < 1e6
    }

    /// Of the nearest pixel, or with a tent over 4·radius² pixels, weights along an axis summing to the radius. Each pixel is
    /// read where its own ray meets the receiver's plane, so that a wide filter shadows no more of a plane than a narrow one.
    fn look_up(&self, functions: &Functions, radius: u32) -> f32 {
        let &Self { pixel, t, slope, .. } = self;
        if !self.is_near() {
            return 1.0;
        }
        let read = |at: Vec2| functions.visibility(at.x as i32, at.y as i32, t + slope.dot(at - pixel));
        if radius == 0 {
            return read(pixel.round());
        }
        let reach = radius as f32;
        let first = pixel.floor() - (reach - 1.0);
        let mut sum = 0.0;
        for row in 0..2 * radius {
            for column in 0..2 * radius {
                let at = first + Vec2::new(column as f32, row as f32);
                let weight = 1.0 - (at - pixel).abs() / reach;
                sum += weight.x * weight.y * read(at);
            }
        }
        (sum / (reach * reach)).clamp(0.0, 1.0)
    }
}

/// V of at most [`BATCH`] requests to one window, interpolated between four pixels each.
#[inline(always)]
fn bilinear(functions: &Functions, requests: &[Request], found: &mut [f32]) {
    let mut four = Four::new(functions, requests);
    match functions.nodes() {
        Nodes::Full(nodes) => four.search(nodes, |node| node),
        Nodes::Packed(nodes, steps) => four.search(nodes, |node| steps.unpack(node)),
    }
    for ((found, weight), values) in found.iter_mut().zip(&four.weights).zip(four.values.as_chunks().0) {
        let &[a, b, c, d]: &[f32; 4] = values;
        let (top, bottom) = (a + (b - a) * weight.x, c + (d - c) * weight.x);
        *found = top + (bottom - top) * weight.y;
    }
}

/// Four functions for each of a batch of requests, one after the other.
struct Four {
    /// How far a request lies from its first pixel.
    weights: [Vec2; BATCH],
    /// Where their nodes start and end.
    ranges: [[u32; 2]; FUNCTIONS],
    /// Depths that are asked for.
    depths: [f32; FUNCTIONS],
    /// V there.
    values: [f32; FUNCTIONS],
    count: usize,
}

impl Four {
    #[inline(always)]
    fn new(functions: &Functions, requests: &[Request]) -> Self {
        let mut four = Self {
            weights: [Vec2::ZERO; BATCH],
            ranges: [[0; 2]; FUNCTIONS],
            depths: [0.0; FUNCTIONS],
            values: [1.0; FUNCTIONS],
            count: 4 * requests.len(),
        };
        let of = four.ranges.as_chunks_mut().0.iter_mut().zip(four.depths.as_chunks_mut().0);
        for ((request, weight), (ranges, depths)) in requests.iter().zip(&mut four.weights).zip(of) {
            if !request.is_near() {
                continue;
            }
            let &Request { pixel, t, slope, .. } = request;
            let low = pixel.floor();
            *weight = pixel - low;
            let first = t - slope.dot(*weight);
            *ranges = functions.four(low.x as i32, low.y as i32);
            *depths = [first, first + slope.x, first + slope.y, first + slope.x + slope.y];
        }
        four
    }

    /// Finds V of all: see [`Nodes::evaluate`].
    #[inline(always)]
    fn search<N: Copy>(&mut self, nodes: &[N], node: impl Fn(N) -> Node) {
        let Some(most) = nodes.len().checked_sub(1) else { return };
        // Both ends of each, without a branch that would wait for them. A function without nodes reads its neighbours'.
        let (mut firsts, mut lasts) = ([0.0; FUNCTIONS], [[0.0; 2]; FUNCTIONS]);
        for ((&[start, end], first), last) in
            self.ranges[..self.count].iter().zip(&mut firsts).zip(&mut lasts)
        {
            *first = node(nodes[most.min(start as usize)]).t;
            let Node { t, visibility } = node(nodes[(end as usize).max(1) - 1]);
            *last = [t, visibility];
        }
        // Those whose depth is between their ends, and how many nodes the one before it may be.
        let (mut within, mut count) = ([0u8; FUNCTIONS], 0);
        let mut left = [0; FUNCTIONS];
        for k in 0..self.count {
            let ([start, end], t) = (self.ranges[k], self.depths[k]);
            let [last, behind] = lasts[k];
            let is_behind = (start < end) & (last <= t);
            self.values[k] = if is_behind { behind.clamp(0.0, 1.0) } else { 1.0 };
            left[k] = end.saturating_sub(start + 1);
            within[count] = k as u8;
            count += usize::from((start < end) & (firsts[k] <= t) & !is_behind);
        }
        // One step of each in turn; those that are found leave.
        let (mut searched, mut rest) = (within, 0);
        for &k in &within[..count] {
            searched[rest] = k;
            rest += usize::from(left[k as usize] > 1);
        }
        while rest > 0 {
            let mut still = 0;
            for i in 0..rest {
                let k = searched[i] as usize;
                let half = left[k] / 2;
                let middle = self.ranges[k][0] + half;
                let is_before = node(nodes[middle as usize]).t <= self.depths[k];
                // A product: a branch would be guessed wrong every other time.
                self.ranges[k][0] += half * u32::from(is_before);
                left[k] -= half;
                searched[still] = k as u8;
                still += usize::from(left[k] > 1);
            }
            rest = still;
        }
        for &k in &within[..count] {
            let k = k as usize;
            let start = self.ranges[k][0] as usize;
            self.values[k] = between(node(nodes[start]), node(nodes[start + 1]), self.depths[k]);
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// V of a request, one function after the other.
    fn apart(functions: &Functions, request: &Request) -> f32 {
        let Request { pixel, t, slope, .. } = *request;
        if !request.is_near() {
            return 1.0;
        }
        let low = pixel.floor();
        let weight = pixel - low;
        let first = t - slope.dot(weight);
        let at = |x: i32, y: i32, t| functions.visibility(low.x as i32 + x, low.y as i32 + y, t);
        let (a, b) = (at(0, 0, first), at(1, 0, first + slope.x));
        let (c, d) = (at(0, 1, first + slope.y), at(1, 1, first + slope.x + slope.y));
        let (top, bottom) = (a + (b - a) * weight.x, c + (d - c) * weight.x);
        top + (bottom - top) * weight.y
    }

    fn depth() -> impl Strategy<Value = f32> {
        prop_oneof![
            4 => (-10i32..10).prop_map(|t| t as f32),
            4 => -10.0f32..10.0,
            1 => Just(f32::NAN),
            1 => Just(f32::INFINITY),
        ]
    }

    proptest! {
        /// Side by side is one after the other, bit for bit: before, between, at and behind nodes, beside the PDSM, in functions
        /// without nodes, and for what is no number.
        #[test]
        fn side_by_side_is_one_after_the_other(
            functions in prop::collection::vec(prop::collection::vec((-8i32..8, -0.1f32..1.1), 0..40), 9),
            requests in prop::collection::vec((-2.0f32..4.0, -2.0f32..4.0, depth(), -1.0f32..1.0, -1.0f32..1.0), 0..=BATCH),
            far in prop_oneof![Just(f32::NAN), Just(f32::INFINITY), Just(-1e7f32)],
        ) {
            let (mut nodes, mut index) = (Vec::new(), vec![0]);
            for mut function in functions {
                function.sort_by_key(|node| node.0);
                nodes.extend(function.iter().map(|&(t, visibility)| Node { t: t as f32, visibility }));
                index.push(nodes.len() as u32);
            }
            let mut requests: Vec<_> = requests
                .iter()
                .map(|&(x, y, t, dx, dy)| Request { pixel: Vec2::new(x, y), t, slope: Vec2::new(dx, dy), ..Default::default() })
                .collect();
            if let Some(request) = requests.last_mut() {
                request.pixel.x = far;
            }
            for nodes in [Nodes::packed(&nodes), Nodes::Full(nodes)] {
                let functions = Functions::from_parts(3, index.clone(), nodes, Default::default()).expect("ascending nodes");
                let mut found = [1.0; BATCH];
                bilinear(&functions, &requests, &mut found);
                for (request, found) in requests.iter().zip(found) {
                    prop_assert_eq!(found.to_bits(), apart(&functions, request).to_bits());
                }
            }
        }
    }
}
