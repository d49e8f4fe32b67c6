//! Pixels of a tile that see one triangle, and what a texel is to all of them at once.
//!
//! Neighbouring pixels mostly see one triangle and are looked up in a few texels, far from any edge of a shadow. The
//! questions of [`receiver_plane`](crate::receiver_plane) are distances and angles, so they are asked once, for a box
//! around all the pixels' positions: where the answer is the same with the box's size and every rounding allowed for,
//! it is that of each pixel, bit for bit. To a filter it is also said which question alone is left: whether the pixel's own texel
//! shadows it, or where its plane lies. What is not certain is asked pixel by pixel.

use std::ops::Range;

use glam::{DVec3, Vec3};
use rayon::prelude::*;
use scene_core::geometry::Aabb;
use scene_core::light::LightPoint;
use scene_core::raster::DEPTH_POSITION_ERROR;
use scene_core::{GBuffer, Light, Scene};

use crate::receiver_plane::view_tolerance;

/// Side of a tile in pixels: its pixels are the bits of a `u64`.
pub const TILE: usize = 8;

/// Triangles of a tile that are told apart; pixels of more are asked one by one.
const MOST: usize = 6;

/// u = 2⁻²⁴, half an ulp: what one operation in f32 may be off, relative to its result.
const ROUNDING: f64 = 1.0 / 16_777_216.0;

/// [`plane_tolerance`](crate::receiver_plane::plane_tolerance) of a scene of size 1.
const PLANE_TOLERANCE: f64 = 1.0 / 524_288.0;

/// Pixels of one tile that see one triangle.
#[derive(Clone, Copy, Debug)]
pub struct Patch {
    /// A bit for each pixel, rows of [`TILE`].
    pub mask: u64,
    /// The object.
    pub object: u32,
    triangle: u32,
    /// Bounds of the positions.
    bounds: Aabb,
    /// The triangle's normal, turned to the camera, and the least and greatest product of it with a position.
    normal: Vec3,
    along: [f32; 2],
    /// Least and greatest [`view_tolerance`].
    tolerance: [f32; 2],
}

impl Patch {
    /// Whether both are parts of one triangle, seen from one side.
    #[inline]
    pub fn is_of_surface(&self, other: &Self) -> bool {
        self.triangle == other.triangle && self.normal == other.normal
    }

    /// Both parts of one triangle as one. Of several tiles the mask says nothing.
    #[must_use]
    pub fn joined(self, other: &Self) -> Self {
        Self {
            mask: self.mask | other.mask,
            bounds: self.bounds.union(other.bounds),
            along: [self.along[0].min(other.along[0]), self.along[1].max(other.along[1])],
            tolerance: [self.tolerance[0].min(other.tolerance[0]), self.tolerance[1].max(other.tolerance[1])],
            ..self
        }
    }
}

/// The patches of one row of tiles, and for each of its tiles where they end.
#[derive(Clone, Debug, Default)]
pub struct PatchRow {
    patches: Vec<Patch>,
    ends: Vec<u32>,
}

impl PatchRow {
    /// The patches of the tile in `column`.
    pub fn of(&self, column: usize) -> &[Patch] {
        self.of_tiles(column..column + 1)
    }

    /// The patches of the tiles in some columns.
    pub fn of_tiles(&self, columns: Range<usize>) -> &[Patch] {
        let end = |column: usize| if column == 0 { 0 } else { self.ends[column - 1] as usize };
        &self.patches[end(columns.start)..end(columns.end)]
    }
}

/// The patches of an image, by rows of tiles. Pixels that see nothing, or what does not receive, are in none.
pub fn patches_of(scene: &Scene, gbuffer: &GBuffer) -> Vec<PatchRow> {
    let width = gbuffer.width as usize;
    let row_of = |tile_row: usize| {
        let mut row = PatchRow::default();
        let rows = TILE.min(gbuffer.height as usize - tile_row * TILE);
        for x in (0..width).step_by(TILE) {
            let first = row.patches.len();
            let columns = TILE.min(width - x);
            let lines = (0..rows).map(|line| (tile_row * TILE + line) * width + x);
            let lines = lines.map(|start| start..start + columns);
            for (bit_row, line) in lines.enumerate() {
                add_line(scene, gbuffer, line, bit_row * TILE, first, &mut row.patches);
            }
            row.ends.push(row.patches.len() as u32);
        }
        row
    };
    (0..(gbuffer.height as usize).div_ceil(TILE)).into_par_iter().map(row_of).collect()
}

/// Adds a line of a tile, runs of one triangle at once.
#[inline]
fn add_line(
    scene: &Scene,
    gbuffer: &GBuffer,
    line: Range<usize>,
    bit: usize,
    first: usize,
    patches: &mut Vec<Patch>,
) {
    let (mut start, end) = (line.start, line.end);
    while start < end {
        let (triangle, normal) = (gbuffer.triangle[start], gbuffer.normal[start]);
        let mut last = start + 1;
        while last < end && gbuffer.triangle[last] == triangle && gbuffer.normal[last] == normal {
            last += 1;
        }
        let run = start..last;
        let mask = (u64::MAX >> (64 - run.len())) << (bit + start - line.start);
        start = last;
        if triangle == GBuffer::NOTHING {
            continue;
        }
        // Without the care for NaN of `f32::min`, which a seen surface has none of.
        let least = |a: f32, b: f32| if a < b { a } else { b };
        let most = |a: f32, b: f32| if a > b { a } else { b };
        let point = gbuffer.position[run.start];
        let (mut min, mut max, mut along) = (point, point, [normal.dot(point); 2]);
        for point in &gbuffer.position[run.clone()] {
            let product = normal.x * point.x + normal.y * point.y + normal.z * point.z;
            min = Vec3::new(least(min.x, point.x), least(min.y, point.y), least(min.z, point.z));
            max = Vec3::new(most(max.x, point.x), most(max.y, point.y), most(max.z, point.z));
            along = [least(along[0], product), most(along[1], product)];
        }
        let bounds = Aabb { min, max };
        let (mut near, mut far) = (f32::INFINITY, 0.0);
        for &depth in &gbuffer.depth[run] {
            (near, far) = (least(near, depth), most(far, depth));
        }
        let tolerance = [near, far].map(view_tolerance);
        // The last one is the likeliest.
        let found = patches[first..].iter_mut().rev().find(|p| p.triangle == triangle && p.normal == normal);
        if let Some(patch) = found {
            patch.mask |= mask;
            patch.bounds = patch.bounds.union(bounds);
            patch.along = [patch.along[0].min(along[0]), patch.along[1].max(along[1])];
            patch.tolerance = [patch.tolerance[0].min(tolerance[0]), patch.tolerance[1].max(tolerance[1])];
        } else {
            let object = gbuffer.object[line.start + (mask.trailing_zeros() as usize - bit)];
            if patches.len() - first < MOST && scene.objects()[object as usize].flags.receives {
                patches.push(Patch { mask, object, triangle, bounds, normal, along, tolerance });
            }
        }
    }
}

/// What a texel is to all pixels of a patch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// It shadows none of them.
    Clear,
    /// It shadows each of them.
    Blocks,
    /// To a filter, it shadows those of them that their own texel shadows: it is near each, and before it.
    AsOwn,
    /// To a filter, it shadows none but those: it is near each.
    AtMostOwn,
    /// To a filter, it shadows those at least: it is before each.
    AtLeastOwn,
    /// To a filter, it shadows those of them that it is before: it rises above their plane, and they lie behind its own.
    IfBefore,
    /// Each has to ask.
    Unknown,
}

/// Which form of the questions is asked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// Of a hard lookup: `LightMaps::hard`.
    Hard,
    /// Of a filter: [`Taps::blocks`](crate::taps::Taps::blocks).
    Filter,
    /// Of a filter that does not ask whether a caster is near.
    Ids,
}

/// The plane of a stored triangle, turned to the light.
#[derive(Clone, Copy, Debug)]
struct CasterPlane {
    anchor: DVec3,
    normal: DVec3,
    /// Product of two sides over twice the area: what roundings of the normal grow by.
    condition: f64,
}

impl CasterPlane {
    /// `None` for a triangle so thin, so small or so nearly edge-on that its side is not certain in f32.
    fn new([a, b, c]: [Vec3; 3], light: LightPoint) -> Option<Self> {
        let anchor = a.as_dvec3();
        let [ab, ac] = [b, c].map(|corner| corner.as_dvec3() - anchor);
        let (cross, sides) = (ab.cross(ac), ab.length() * ac.length());
        let to_light = match light {
            LightPoint::At(place) => place.as_dvec3() - anchor,
            LightPoint::Towards(direction) => direction.as_dvec3(),
        };
        let (length, side) = (cross.length(), cross.dot(to_light));
        // In f32 the cross product is off by less than 14·u·`sides`, its product with the way to the light by four more.
        let is_certain = length * 256.0 >= sides
            && side.abs() >= length * to_light.length() * (1.0 / 1024.0)
            && (1e-15..1e15).contains(&length);
        is_certain.then(|| Self {
            anchor,
            normal: cross * (side.signum() / length),
            condition: sides / length,
        })
    }
}

/// A patch as the light sees it: the questions, for all of its pixels at once.
#[derive(Clone, Copy, Debug)]
pub struct Questions {
    center: DVec3,
    half: DVec3,
    radius: f64,
    normal: DVec3,
    along: [f64; 2],
    tolerance: [f64; 2],
    light: LightPoint,
    /// From the middle to the light, a unit vector, and what it differs by for any other pixel.
    to_light: DVec3,
    turn: f64,
    /// At most and at least as much as 1 + tan θ of every pixel.
    slope: [f64; 2],
    /// Largest coordinate of scene and light: windows of maps reach as far.
    magnitude: f64,
    /// The last stored triangle asked about, and its plane.
    last: (u32, Option<CasterPlane>),
}

impl Questions {
    /// `None` where it is not certain that each pixel faces the light and is reached by it.
    pub fn new(patch: &Patch, light: &Light, tolerance: f32) -> Option<Self> {
        let (min, max) = (patch.bounds.min.as_dvec3(), patch.bounds.max.as_dvec3());
        let (center, half) = ((min + max) * 0.5, (max - min) * 0.5);
        let (radius, normal) = (half.length(), patch.normal.as_dvec3());
        // Three products and two sums in f32.
        let rounded = 4.0 * ROUNDING * normal.abs().dot(center.abs() + half);
        let point = match *light {
            Light::Spot { .. } => return None,
            _ => light.center(),
        };
        let (to_light, turn) = match point {
            LightPoint::Towards(direction) => (direction.as_dvec3().normalize(), 0.0),
            LightPoint::At(place) => {
                let way = place.as_dvec3() - center;
                let distance = way.length();
                if distance <= 4.0 * radius {
                    return None;
                }
                (way / distance, radius / (distance - radius))
            }
        };
        // In f32 the cosine is off by less than 16 roundings, and the root of 1 − cos² by 2⁻¹⁰ at most.
        let off = turn + 16.0 * ROUNDING;
        let cos = [-off, off].map(|off| normal.dot(to_light) + off);
        if cos[0].is_nan() || cos[0] <= 1.0 / 64.0 {
            return None;
        }
        let tangent = cos.map(|cos| (1.0 - cos * cos).max(0.0).sqrt() / cos);
        let rounded_tangent = [
            (tangent[1] * (1.0 - 1.0 / 256.0) - 1.0 / 256.0).max(0.0),
            tangent[0] * (1.0 + 1.0 / 256.0) + 1.0 / 256.0,
        ];
        let slope = rounded_tangent.map(|tangent| 1.0 + tangent);
        Some(Self {
            center,
            half,
            radius,
            normal,
            along: [f64::from(patch.along[0]) - rounded, f64::from(patch.along[1]) + rounded],
            // Added in f32, as for each pixel: adding does not change the order.
            tolerance: patch.tolerance.map(|view| f64::from(tolerance + view)),
            light: point,
            to_light,
            turn,
            slope,
            magnitude: f64::from(tolerance) / PLANE_TOLERANCE,
            last: (GBuffer::NOTHING, None),
        })
    }

    /// Bounds of the patch: middle and half sides.
    pub fn bounds(&self) -> (DVec3, DVec3) {
        (self.center, self.half)
    }

    /// What `triangle`, stored at `stored` in a texel with diagonal `texel` and moved by `snapping` at most, is to the patch.
    pub fn ask(
        &mut self,
        form: Form,
        scene: &Scene,
        triangle: u32,
        stored: impl FnOnce() -> (Vec3, f32),
    ) -> Outcome {
        if self.last.0 != triangle {
            self.last = (triangle, CasterPlane::new(scene.corners(triangle as usize), self.light));
        }
        let Some(plane) = self.last.1 else {
            return if form == Form::Ids { Outcome::IfBefore } else { Outcome::Unknown };
        };
        // Question 2. A product with the plane's normal is made of that with the patch's own, which is the same for all
        // pixels but for rounding, and of what is left along the patch.
        let cos = plane.normal.dot(self.normal);
        let rest = plane.normal - self.normal * cos;
        let spread = rest.abs().dot(self.half);
        let level = rest.dot(self.center) - plane.normal.dot(plane.anchor);
        let [a, b] = self.along.map(|along| cos * along + level);
        let (low, high) = (a.min(b) - spread, a.max(b) + spread);
        // In f32 with stored planes or with corners: `receiver_plane::is_behind`, `FilterMaps::is_behind`.
        let reach = (self.center - plane.anchor).length() + self.radius;
        let sizes = plane.normal.abs().dot(self.center.abs() + self.half + plane.anchor.abs());
        let error = ROUNDING * (32.0 * plane.condition * (reach + self.tolerance[1]) + 16.0 * sizes);
        if low - error >= -self.tolerance[0] {
            return Outcome::Clear;
        }
        let is_behind = high + error < -self.tolerance[1];
        // Question 1.
        let (stored, texel) = stored();
        let (stored, texel) = (stored.as_dvec3(), f64::from(texel));
        let way = stored - self.center;
        let farthest = way.length() + self.radius;
        // In f32 from points or from the view's own axes: sums of a dozen terms, none above the scene's size.
        let error = 64.0 * ROUNDING * (farthest + 8.0 * self.magnitude);
        let [most, least] = self.along.map(|along| self.normal.dot(stored) - along);
        let snapping = texel * f64::from(DEPTH_POSITION_ERROR);
        if most + error <= self.tolerance[0] + snapping {
            return Outcome::Clear;
        }
        let is_risen = least - error > self.tolerance[1] + snapping;
        match form {
            Form::Hard if !(is_risen && is_behind) => return Outcome::Unknown,
            Form::Ids => return if is_risen && is_behind { Outcome::Blocks } else { Outcome::IfBefore },
            Form::Hard | Form::Filter => {}
        }
        // Question 3.
        let along = way.dot(self.to_light);
        let lateral = (way - self.to_light * along).length();
        let off = self.radius + farthest * (self.turn + 1.0 / 512.0);
        let off_along = self.radius + farthest * (self.turn + 32.0 * ROUNDING);
        let near = |lateral: f64| if form == Form::Filter { texel.max(2.0 * lateral) } else { texel };
        let is_far = along - off_along > near(lateral + off) * self.slope[1] * (1.0 + 1.0 / 1024.0);
        let is_near = form == Form::Filter
            && (along + off_along) * (1.0 + 1.0 / 1024.0) <= near(lateral - off) * self.slope[0];
        match (is_risen, is_behind) {
            (true, true) if is_far => Outcome::Blocks,
            (true, true) if is_near => Outcome::AsOwn,
            (true, true) if form == Form::Filter => Outcome::AtLeastOwn,
            _ if is_far => Outcome::IfBefore,
            _ if is_near => Outcome::AtMostOwn,
            _ => Outcome::Unknown,
        }
    }
}
