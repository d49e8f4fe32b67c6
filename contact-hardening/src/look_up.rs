//! Look-ups in the map along the lines from one receiver to the light, where the image does not answer.
//!
//! What a line costs is one read of a depth, at a place that turns from pixel to pixel. So depths are kept in tiles that a
//! cache line holds, and read for many lines at once, so that the memory is waited for once. The way to a texel is a line in the map's
//! clip space, and a pyramid of nearest depths tells whether any texel under the whole [footprint](crate::footprint) rises above the
//! receiver's plane: where none does, every line is lit.
//!
//! Of a cube's faces the receiver's own is asked so; lines that leave it are asked one by one.

use glam::{Vec2, Vec3, Vec3A};
use gnomon_shadow_map::filter_maps::FilterMaps;
use gnomon_shadow_map::light_cone::LightCone;
use gnomon_shadow_map::light_maps::{LightMaps, Occluder, Receiver, ShadowMapView};
use gnomon_shadow_map::receiver_plane::{NearSurface, meets, rises_above};
use gnomon_shadow_map::texel_plane::TexelPlane;
use rayon::prelude::*;
use scene_core::light::LightPoint;
use scene_core::raster::DepthMap;

use crate::backs::Backs;

/// Texels a side of a tile: 16 depths are 64 bytes.
const SIDE: usize = 4;

#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
struct Tile([f32; SIDE * SIDE]);

/// A map's depths, tile by tile. In rows a footprint touches a page of memory a row, and rows whose length is a
/// power of two share the places of the cache.
#[derive(Clone, Debug)]
struct TiledDepth {
    across: usize,
    tiles: Vec<Tile>,
}

impl TiledDepth {
    fn new(map: &DepthMap) -> Self {
        let (width, height) = (map.width as usize, map.height as usize);
        let across = width.div_ceil(SIDE);
        let mut tiles = vec![Tile([0.0; SIDE * SIDE]); across * height.div_ceil(SIDE)];
        tiles.par_chunks_mut(across.max(1)).enumerate().for_each(|(line, tiles)| {
            for row in line * SIDE..((line + 1) * SIDE).min(height) {
                let depths = &map.depth[row * width..][..width];
                for (tile, depths) in tiles.iter_mut().zip(depths.chunks(SIDE)) {
                    tile.0[row % SIDE * SIDE..][..depths.len()].copy_from_slice(depths);
                }
            }
        });
        Self { across, tiles }
    }

    #[inline]
    fn at(&self, column: usize, row: usize) -> f32 {
        self.tiles[row / SIDE * self.across + column / SIDE].0[row % SIDE * SIDE + column % SIDE]
    }
}

/// Lines that are read at once.
pub const BATCH: usize = 64;

/// Calls `take` with up to [`BATCH`] of `points` at a time.
pub fn batches(mut points: impl Iterator<Item = Vec2>, mut take: impl FnMut(&[Vec2])) {
    let mut batch = [Vec2::ZERO; BATCH];
    loop {
        let mut count = 0;
        for (slot, point) in batch.iter_mut().zip(&mut points) {
            *slot = point;
            count += 1;
        }
        if count == 0 {
            return;
        }
        take(&batch[..count]);
    }
}

/// The maps of a light, made ready for look-ups.
#[derive(Clone, Debug)]
pub struct LookUps<'a> {
    /// The maps, planes of their triangles, and nearest depths.
    pub filter: FilterMaps<'a>,
    /// Of a lone map; the faces of a cube are asked in rows.
    tiled: Option<TiledDepth>,
    backs: Backs,
}

impl<'a> LookUps<'a> {
    /// `prepare.tiles`, beside what filters need, for pictures in which up to `look_ups` are made: tiles are made where that is
    /// more than a map has texels, each of which has to be copied.
    pub fn new(filter: FilterMaps<'a>, look_ups: u64) -> Self {
        let tiled = match filter.maps.maps.as_slice() {
            [lone] if look_ups > lone.map.depth.len() as u64 => Some(TiledDepth::new(&lone.map)),
            _ => None,
        };
        Self { filter, tiled, backs: Backs::default() }
    }

    /// The same, with the [far sides](crate::backs) of solid casters.
    #[must_use]
    pub fn with_backs(self) -> Self {
        Self { backs: Backs::draw(&self.filter.maps), ..self }
    }

    /// The maps.
    pub fn maps(&self) -> &LightMaps<'a> {
        &self.filter.maps
    }

    /// Bytes beside those of `filter`.
    pub fn bytes(&self) -> u64 {
        self.backs.bytes() + self.tiled.as_ref().map_or(0, |tiled| size_of_val(tiled.tiles.as_slice()) as u64)
    }

    /// The lines from `receiver` to the light over `cone`.
    pub fn lines(&self, receiver: &Receiver, cone: &LightCone) -> Lines<'_, 'a> {
        let views = &self.maps().maps;
        let holds = |map: &ShadowMapView| map.view.project(receiver.point).is_some();
        let index = if views.len() == 1 { Some(0) } else { views.iter().position(holds) };
        let face = index.map(|index| {
            let map = &views[index];
            let size = map.map.width;
            let clip = |v: Vec3, w: f32| {
                let clip = map.view.projection_from_world * v.extend(w);
                let half = 0.5 * size as f32;
                Vec3A::new((clip.w + clip.x) * half, (clip.w - clip.y) * half, clip.w)
            };
            let ways = [cone.w, cone.u, cone.v].map(|axis| clip(axis, 0.0));
            let plane = TexelPlane::new(&map.view, size, receiver);
            let is_lone = views.len() == 1;
            let tiled = self.tiled.as_ref();
            Face { tiled, map, index, is_lone, size, receiver: clip(receiver.point, 1.0), ways, plane }
        });
        let center = self.maps().light.center();
        let parallel = matches!(center, LightPoint::Towards(_));
        let near = NearSurface::new(receiver.point, receiver.normal, center);
        Lines { look_ups: self, receiver: *receiver, cone: *cone, near, parallel, face }
    }
}

/// What a line meets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Met {
    /// Nothing that shadows the receiver.
    Nothing,
    /// A blocker; it need not lie on the line, nor in the cone.
    Blocker(Blocker),
}

/// A blocker's near side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Blocker {
    /// In the light's coordinates ([`LightCone::locate`]).
    pub located: Vec3,
    /// Where its far side is looked up.
    pub place: Place,
}

/// Where the [far side](crate::backs) of a blocker is looked up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Place {
    /// Nowhere: it has none.
    Thin,
    /// In this texel, column and row, of the receiver's own view.
    Texel([u32; 2]),
    /// In the texel that holds this point.
    Point(Vec3),
}

/// What is stored where a line is at some distance.
#[derive(Clone, Copy, Debug, Default)]
pub struct Texel {
    column: u32,
    row: u32,
    /// Reversed; 0 where there is nothing, NaN where another face holds the place.
    depth: f32,
}

impl Texel {
    const ELSEWHERE: Self = Self { column: 0, row: 0, depth: f32::NAN };
}

/// The lines from one receiver to the points of the light.
#[derive(Clone, Copy, Debug)]
pub struct Lines<'l, 'a> {
    look_ups: &'l LookUps<'a>,
    receiver: Receiver,
    cone: LightCone,
    near: NearSurface,
    parallel: bool,
    face: Option<Face<'l>>,
}

/// The lines in the texels of the view that holds the receiver, or of the lone one, before the division by the third coordinate.
#[derive(Clone, Copy, Debug)]
struct Face<'l> {
    tiled: Option<&'l TiledDepth>,
    map: &'l ShadowMapView,
    index: usize,
    /// Whether nothing is stored beside the map.
    is_lone: bool,
    size: u32,
    receiver: Vec3A,
    /// To the light's centre, and along its half axes.
    ways: [Vec3A; 3],
    plane: TexelPlane,
}

impl Face<'_> {
    #[inline]
    fn place(&self, at: Vec2, t: f32) -> Vec3A {
        self.receiver + (self.ways[0] + self.ways[1] * at.x + self.ways[2] * at.y) * t
    }

    /// The texel where the line to `at` is at `t`.
    #[inline]
    fn texel(&self, at: Vec2, t: f32) -> Texel {
        let place = self.place(at, t);
        let end = self.size as f32 * place.z;
        let inside = place.z > 0.0 && place.x >= 0.0 && place.y >= 0.0 && place.x <= end && place.y <= end;
        if !inside {
            return if self.is_lone { Texel::default() } else { Texel::ELSEWHERE };
        }
        // NDC 1 belongs to the last texel.
        let cell = |at: f32| ((at / place.z) as u32).min(self.size - 1);
        let (column, row) = (cell(place.x), cell(place.y));
        let depth = match self.tiled {
            Some(tiled) => tiled.at(column as usize, row as usize),
            None => self.map.map.depth[row as usize * self.size as usize + column as usize],
        };
        Texel { column, row, depth }
    }

    /// Least and greatest column and row under the footprint of the light, `reach` times as wide. `None` where it is
    /// unbounded.
    fn bounds(&self, reach: f32, t: f32) -> Option<(Vec2, Vec2)> {
        let (mut min, mut max) = (Vec2::INFINITY, Vec2::NEG_INFINITY);
        for corner in [Vec2::ONE, Vec2::NEG_ONE, Vec2::new(1.0, -1.0), Vec2::new(-1.0, 1.0)] {
            let place = self.place(corner * reach, t);
            let at = Vec2::new(place.x, place.y) / place.z;
            if !(place.z > 0.0 && at.is_finite()) {
                return None;
            }
            (min, max) = (min.min(at), max.max(at));
        }
        Some((min, max))
    }

    /// Whether no texel under the footprint of the light, `reach` times as wide, rises above the receiver's plane.
    fn is_clear(&self, maps: &FilterMaps<'_>, reach: f32, t: f32) -> bool {
        let Some((min, max)) = self.bounds(reach, t) else { return false };
        // Places are rounded: a texel more on each side holds every line.
        let (min, max) = (min - 1.0, max + 1.0);
        let end = self.size as f32 - 1.0;
        if !self.is_lone && (min.cmplt(Vec2::ZERO).any() || max.cmpgt(Vec2::splat(end)).any()) {
            return false;
        }
        let min = min.max(Vec2::ZERO);
        if max.cmplt(Vec2::ZERO).any() || min.cmpgt(Vec2::splat(end + 1.0)).any() {
            return true;
        }
        let [first, last] = [min, max].map(|at| at.min(Vec2::splat(end)).to_array().map(f32::floor));
        let whole = |at: [f32; 2]| at.map(|at| at as usize);
        let nearest = maps.pyramids[self.index].nearest(&self.map.map, whole(first), whole(last));
        self.plane.hides_none(first, last, nearest)
    }
}

impl Lines<'_, '_> {
    /// Whether it is proved that no line meets anything within the footprint at `t`, `reach` times the light's.
    pub fn is_clear(&self, reach: f32, t: f32) -> bool {
        self.face.is_some_and(|face| face.is_clear(&self.look_ups.filter, reach, t))
    }

    /// How many texels the footprint at `t` is wide where it is narrowest, `reach` times the light's. `None` where it is
    /// unbounded, or no map holds the receiver.
    pub fn width(&self, reach: f32, t: f32) -> Option<f32> {
        let (min, max) = self.face.as_ref()?.bounds(reach, t)?;
        Some((max - min).min_element())
    }

    /// Reads what is stored where the lines to `points` are at `t` of their index; those without a `t` are left out.
    #[inline]
    pub fn read(&self, points: &[Vec2], t: impl Fn(usize) -> Option<f32>, texels: &mut [Texel]) {
        let Some(face) = &self.face else {
            texels.fill(Texel::ELSEWHERE);
            return;
        };
        for (index, (&at, texel)) in points.iter().zip(texels).enumerate() {
            if let Some(t) = t(index) {
                *texel = face.texel(at, t);
            }
        }
    }

    /// The surface stored where the line to the light's point `at` is at `t`, if it shadows the receiver.
    #[inline]
    pub fn look_up(&self, at: Vec2, t: f32) -> Met {
        let texel = self.face.as_ref().map_or(Texel::ELSEWHERE, |face| face.texel(at, t));
        self.meet(&texel, at, t)
    }

    /// The same where the texel is [read](Self::read) already.
    #[inline]
    pub fn meet(&self, texel: &Texel, at: Vec2, t: f32) -> Met {
        match &self.face {
            Some(face) if !texel.depth.is_nan() => {
                let rises = texel.depth > 0.0
                    && face.plane.rise(texel.column as f32, texel.row as f32, texel.depth) > 0.0;
                if !rises {
                    return Met::Nothing;
                }
                let place = [texel.column as usize, texel.row as usize];
                self.ask(&face.map.occluder(place, texel.depth), at, Place::Texel([texel.column, texel.row]))
            }
            _ => self.meet_elsewhere(at, t),
        }
    }

    #[cold]
    fn meet_elsewhere(&self, at: Vec2, t: f32) -> Met {
        let Receiver { point, normal, tolerance, .. } = self.receiver;
        let stored = self.look_ups.maps().occluder(point + self.cone.direction(at) * t);
        let stored = stored.filter(|stored| rises_above(stored.point, point, normal, tolerance));
        stored.map_or(Met::Nothing, |stored| self.ask(&stored, at, Place::Point(stored.point)))
    }

    /// The questions of shadow-map's `receiver_plane`; a neighbour on the same surface is asked outright, by the line to
    /// this point of the light.
    #[inline]
    fn ask(&self, stored: &Occluder, at: Vec2, place: Place) -> Met {
        let Receiver { point, tolerance, .. } = self.receiver;
        let maps = self.look_ups.maps();
        let located = self.cone.locate(stored.point);
        let before_light = located.z > 0.0 && (located.z < 1.0 || self.parallel);
        if !(before_light && self.look_ups.filter.is_behind(stored.triangle, point, tolerance)) {
            return Met::Nothing;
        }
        let line = || LightPoint::Towards(self.cone.direction(at));
        let blocks = !self.near.holds(stored.point - point, stored.texel)
            || meets(maps.scene.corners(stored.triangle), point, line());
        if blocks { Met::Blocker(Blocker { located, place }) } else { Met::Nothing }
    }

    /// The third coordinate of a blocker's far side: that of its near side unless it is solid.
    #[inline]
    pub fn far_side(&self, blocker: &Blocker) -> f32 {
        let backs = &self.look_ups.backs;
        let far = match blocker.place {
            _ if backs.is_empty() => None,
            Place::Thin => None,
            Place::Texel(texel) => self
                .face
                .as_ref()
                .and_then(|face| backs.point(face.map, face.index, texel.map(|at| at as usize))),
            Place::Point(stored) => {
                let mut views = self.look_ups.maps().maps.iter().enumerate();
                let found = views.find_map(|(index, map)| Some((index, map, map.view.project(stored)?)));
                found.and_then(|(index, map, ndc)| backs.point(map, index, map.texel(ndc)))
            }
        };
        far.map_or(blocker.located.z, |far| self.cone.share_of(far).min(blocker.located.z))
    }
}
