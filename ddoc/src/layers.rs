//! Step 1 for what the map alone knows: how many layers lie between a receiver and the light's centre.
//!
//! A cut-out mask has no edges but those that are taken from the map ([`mask_edges`](crate::mask_edges)), and `image-edges`
//! has none at all. Their layers are counted at a texel's centre. A receiver is not at a texel's centre, so the count found
//! there is carried over to the receiver by the outlines between the two, exactly:
//!
//! > n(p) = n(t) + Σ m(e)·([p left of e] − [t left of e])
//!
//! over the outlines e that the segment from the centre t to p crosses in the image, above the receiver's plane, with m(e)
//! as the light's centre sees it (the derivation is that of [`silhouettes`](mod@crate::silhouettes), with the centre in the
//! receiver's place). Coverage of t was decided on snapped places, so outlines are snapped, too, and a centre on an
//! outline belongs to the side that the top-left rule gives it to. An outline lies in one square of four centres, and so
//! does the segment: each receiver asks those of one square.
//!
//! # Near the receiver
//! Where a face lies as near to its receiver as its own surface may rise within a texel ([`is_near`]), the count at t says
//! little about p. There the face is asked by the receiver's own ray, and outlines as near are not counted: what is lost is
//! what a hard map loses, a caster nearer to its receiver than that and not over the texel's centre.

use glam::{Vec2, Vec3};
use gnomon_shadow_map::light_maps::Receiver;
use gnomon_shadow_map::receiver_plane::{is_behind, is_near, meets, rises_above};
use scene_core::Scene;
use scene_core::light::LightPoint;
use scene_core::raster::{DEPTH_POSITION_ERROR, Fragments};

use crate::grid::{Grid, TileLists};
use crate::light_image::LightImage;
use crate::silhouettes::Edge;

/// A view's map.
#[derive(Clone, Debug)]
pub struct Layers {
    /// Where its texels are.
    pub image: LightImage,
    /// Every face over every texel's centre.
    pub fragments: Fragments,
    /// Whether the nearest alone counts, as in a plain shadow map.
    pub single: bool,
    /// Outlines as the light's centre sees them.
    outlines: Vec<CenterEdge>,
    /// Which of them lie in each square of four centres.
    squares: TileLists,
}

/// An outline as the light's centre sees it, in the image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CenterEdge {
    /// Its ends, snapped.
    pub ends: [[f64; 2]; 2],
    /// m(e), never 0.
    pub multiplicity: i8,
    /// The edge.
    pub edge: u32,
}

/// A receiver and where it lies in a map.
#[derive(Clone, Copy, Debug)]
pub struct Placed<'r> {
    /// The receiver.
    pub receiver: &'r Receiver,
    /// Its place in the image.
    pub place: Vec2,
}

impl Layers {
    /// A map without outlines.
    pub fn new(image: LightImage, fragments: Fragments, single: bool) -> Self {
        let squares = TileLists::new(Grid::alone(1), 0, |_, _| {});
        Self { image, fragments, single, outlines: Vec::new(), squares }
    }

    /// Takes over its outlines: those of `edges` that the light's centre sees, numbered from `first`, relative to `origin`.
    pub fn set_outlines(&mut self, edges: &[Edge], first: u32, origin: Vec3) {
        if self.fragments.is_empty() {
            // No face is drawn here: there is nothing to count, nor squares to look into.
            return;
        }
        let seen = |(index, edge): (u32, &Edge)| {
            let ends = self.image.snapped([edge.a + origin, edge.b + origin])?;
            (edge.from_center != 0).then_some(CenterEdge {
                ends,
                multiplicity: edge.from_center,
                edge: index,
            })
        };
        self.outlines = (first..).zip(edges).filter_map(seen).collect();
        let side = self.image.size + 1;
        self.squares = TileLists::new(Grid::alone(side), self.outlines.len(), |index, enter| {
            let [a, b] = self.outlines[index].ends;
            // Its ends lie on two sides of one square, so that its middle is inside.
            let square = [0, 1].map(|i| ((0.5 * (a[i] + b[i]) + 0.5).floor() as u32).min(side - 1));
            enter(square[1] * side + square[0]);
        });
    }

    /// Outlines as the light's centre sees them.
    pub fn outlines(&self) -> &[CenterEdge] {
        &self.outlines
    }

    /// Which of them lie in each square of four centres, from the one left of and above the first centre on.
    pub fn squares(&self) -> &TileLists {
        &self.squares
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        self.fragments.bytes() + size_of_val(&self.outlines[..]) + self.squares.bytes()
    }

    /// Whether no face lies over these columns and rows of texels nor beside them, so that none counts before receivers there.
    pub fn is_clear(&self, [columns, rows]: [std::ops::Range<i64>; 2]) -> bool {
        let size = i64::from(self.image.size);
        let within = |range: std::ops::Range<i64>| {
            [(range.start - 1).clamp(0, size), (range.end + 1).clamp(0, size)].map(|at| at as usize)
        };
        let ([left, right], [top, bottom]) = (within(columns), within(rows));
        let first = self.fragments.first();
        self.fragments.is_empty()
            || (top..bottom).all(|row| {
                let line = row * self.image.size as usize;
                first[line + left] == first[line + right]
            })
    }

    /// The texel that holds a place: column and row; `None` beside the map, where there is no caster.
    #[inline]
    fn texel(&self, place: Vec2) -> Option<[u32; 2]> {
        let size = self.image.size as f32;
        let inside = place.x >= 0.0 && place.y >= 0.0 && place.x <= size && place.y <= size;
        // The border belongs to the last texel.
        inside.then(|| place.to_array().map(|at| (at as u32).min(self.image.size - 1)))
    }

    /// World units of a texel's diagonal at a depth.
    #[inline]
    fn diagonal(&self, depth: f32) -> f32 {
        self.image.view.half_diagonal(depth) * (2.0 / self.image.size as f32)
    }

    /// Faces between the receiver and the light's `center`, by the texel's centre alone: right where no silhouette passes
    /// through the texel.
    #[inline]
    pub fn at_texel(&self, scene: &Scene, placed: &Placed<'_>, center: LightPoint) -> i32 {
        let Some(texel) = self.texel(placed.place) else { return 0 };
        let Receiver { point, normal, tolerance, .. } = *placed.receiver;
        let scale = 2.0 / self.image.size as f32;
        let middle = Vec2::from(texel.map(|at| at as f32 + 0.5)) * scale;
        let ndc = Vec2::new(middle.x - 1.0, 1.0 - middle.y);
        let mut count = 0;
        let all = self.fragments.of(texel[0], texel[1]);
        for fragment in if self.single { &all[..all.len().min(1)] } else { all } {
            if fragment.depth <= 0.0 {
                continue;
            }
            let stored = self.image.view.unproject(ndc, fragment.depth);
            let diagonal = self.diagonal(fragment.depth);
            if !rises_above(stored, point, normal, tolerance + diagonal * DEPTH_POSITION_ERROR) {
                continue;
            }
            let corners = scene.corners(fragment.triangle as usize);
            let counts = is_behind(corners, point, center, tolerance)
                && (!is_near(stored, point, normal, center, diagonal) || meets(corners, point, center));
            count += i32::from(counts);
        }
        count
    }

    /// What the silhouettes between the texel's centre and the receiver add to [`at_texel`](Self::at_texel). `ends` are
    /// those of an edge and the point seen past it, in world space.
    pub fn carried(&self, placed: &Placed<'_>, center: LightPoint, ends: impl Fn(u32) -> [Vec3; 3]) -> i32 {
        let Some(texel) = self.texel(placed.place).filter(|_| !self.outlines.is_empty()) else { return 0 };
        let from = texel.map(|at| f64::from(at) + 0.5);
        let to = placed.place.to_array().map(f64::from);
        // The segment stays in one of the four squares around the centre.
        let square = [0, 1].map(|i| texel[i] + u32::from(to[i] > from[i]));
        let mut sum = 0;
        for index in self.squares.of(square[1] * (self.image.size + 1) + square[0]) {
            let edge = &self.outlines[index as usize];
            let [a, b] = edge.ends;
            let (a_side, b_side) = (cross(from, to, a), cross(from, to, b));
            if (a_side >= 0.0) == (b_side >= 0.0) {
                continue;
            }
            let (starts, arrives) = (right_of(a, b, from), right_of(a, b, to));
            if starts == arrives {
                continue;
            }
            // In texels a_side / (a_side − b_side) is the share of the way that the image shows; depth makes it another one
            // in space. Both ends' distances weigh it: a central image divides by them.
            let [a, b, far] = ends(edge.edge);
            let weight = |end: Vec3| f64::from(self.image.weight(end));
            let (a_share, b_share) = (a_side * weight(a), b_side * weight(b));
            let crossed = a.lerp(b, (a_share / (a_share - b_share)).clamp(0.0, 1.0) as f32);
            if self.counts(placed.receiver, crossed, far, center) {
                // y runs down, so that right as the image shows it is right as the light sees it.
                sum += i32::from(edge.multiplicity) * (i32::from(starts) - i32::from(arrives));
            }
        }
        sum
    }

    /// Whether an edge at `crossed` lies above the receiver, `far` does not, and it is no part of the receiver's own surface.
    fn counts(&self, receiver: &Receiver, crossed: Vec3, far: Vec3, center: LightPoint) -> bool {
        let Receiver { point, normal, tolerance, .. } = *receiver;
        let diagonal = self.diagonal(self.image.view.depth_of(crossed));
        rises_above(crossed, point, normal, tolerance)
            && !rises_above(far, point, normal, tolerance)
            && !is_near(crossed, point, normal, center, diagonal)
    }
}

/// Twice the area of (a, b, p): positive if p lies right of the way from a to b, y down. Exact of snapped points.
#[inline]
fn cross(a: [f64; 2], b: [f64; 2], p: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0])
}

/// Whether p lies right of the way from a to b, by the rasteriser's top-left rule.
#[inline]
fn right_of(a: [f64; 2], b: [f64; 2], p: [f64; 2]) -> bool {
    let value = cross(a, b, p);
    let owns = b[1] < a[1] || (b[1] == a[1] && b[0] > a[0]);
    value > 0.0 || (value == 0.0 && owns)
}
