//! Look-ups in the map along the lines from one receiver to the light, where the image does not answer.
//!
//! What a line costs is one read of a depth, at a place that turns from pixel to pixel. So depths are kept in tiles that a
//! cache line holds, the way to a texel is a line in the map's clip space, and a pyramid of nearest depths tells
//! whether any texel under the whole [footprint](crate::footprint) rises above the receiver's plane: where none does, every
//! line is lit.

use glam::{Vec2, Vec3, Vec3A};
use gnomon_shadow_map::filter_maps::FilterMaps;
use gnomon_shadow_map::light_cone::LightCone;
use gnomon_shadow_map::light_maps::{LightMaps, Occluder, Receiver};
use gnomon_shadow_map::receiver_plane::{is_near, meets, rises_above};
use gnomon_shadow_map::texel_plane::TexelPlane;
use rayon::prelude::*;
use scene_core::Light;
use scene_core::light::LightPoint;
use scene_core::raster::DepthMap;

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

/// The maps of a light, made ready for look-ups.
#[derive(Clone, Debug)]
pub struct LookUps<'a> {
    /// The maps, planes of their triangles, and nearest depths.
    pub filter: FilterMaps<'a>,
    /// Of a lone map; the faces of a cube are asked one by one.
    tiled: Option<TiledDepth>,
}

impl<'a> LookUps<'a> {
    /// `prepare.tiles`, beside what filters need.
    pub fn new(filter: FilterMaps<'a>) -> Self {
        let tiled = match filter.maps.maps.as_slice() {
            [lone] => Some(TiledDepth::new(&lone.map)),
            _ => None,
        };
        Self { filter, tiled }
    }

    /// The maps.
    pub fn maps(&self) -> &LightMaps<'a> {
        &self.filter.maps
    }

    /// Bytes beside those of `filter`.
    pub fn bytes(&self) -> u64 {
        self.tiled.as_ref().map_or(0, |tiled| size_of_val(tiled.tiles.as_slice()) as u64)
    }

    /// The lines from `receiver` to the light over `cone`.
    pub fn lines(&self, receiver: &Receiver, cone: &LightCone) -> Lines<'_, 'a> {
        let lone = match (self.maps().maps.as_slice(), &self.tiled) {
            ([map], Some(tiled)) => {
                let size = map.map.width;
                let clip = |v: Vec3, w: f32| {
                    let clip = map.view.projection_from_world * v.extend(w);
                    let half = 0.5 * size as f32;
                    Vec3A::new((clip.w + clip.x) * half, (clip.w - clip.y) * half, clip.w)
                };
                let ways = [cone.w, cone.u, cone.v].map(|axis| clip(axis, 0.0));
                let plane = TexelPlane::new(&map.view, size, receiver);
                Some(Lone { tiled, size, receiver: clip(receiver.point, 1.0), ways, plane })
            }
            _ => None,
        };
        let parallel = matches!(self.maps().light, Light::Directional { .. });
        Lines { look_ups: self, receiver: *receiver, cone: *cone, share: cone.share_axis(), parallel, lone }
    }
}

/// What a line meets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Met {
    /// Nothing that shadows the receiver.
    Nothing,
    /// A blocker at this share of the way.
    Blocker(f32),
}

/// The lines from one receiver to the points of the light.
#[derive(Clone, Copy, Debug)]
pub struct Lines<'l, 'a> {
    look_ups: &'l LookUps<'a>,
    receiver: Receiver,
    cone: LightCone,
    /// Its product with a vector from the receiver is a share of the way to the light.
    share: Vec3,
    parallel: bool,
    lone: Option<Lone<'l>>,
}

/// The lines in the texels of a lone map, before the division by the third coordinate.
#[derive(Clone, Copy, Debug)]
struct Lone<'l> {
    tiled: &'l TiledDepth,
    size: u32,
    receiver: Vec3A,
    /// To the light's centre, and along its half axes.
    ways: [Vec3A; 3],
    plane: TexelPlane,
}

impl Lone<'_> {
    #[inline]
    fn place(&self, at: Vec2, t: f32) -> Vec3A {
        self.receiver + (self.ways[0] + self.ways[1] * at.x + self.ways[2] * at.y) * t
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
    fn is_clear(&self, map: &FilterMaps<'_>, reach: f32, t: f32) -> bool {
        let Some((min, max)) = self.bounds(reach, t) else { return false };
        // Places are rounded: a texel more on each side holds every line.
        let (min, max) = ((min - 1.0).max(Vec2::ZERO), max + 1.0);
        let end = self.size as f32 - 1.0;
        if max.cmplt(Vec2::ZERO).any() || min.cmpgt(Vec2::splat(end + 1.0)).any() {
            return true;
        }
        let [first, last] = [min, max].map(|at| at.min(Vec2::splat(end)).to_array().map(f32::floor));
        let whole = |at: [f32; 2]| at.map(|at| at as usize);
        let nearest = map.pyramids[0].nearest(&map.maps.maps[0].map, whole(first), whole(last));
        self.plane.hides_none(first, last, nearest)
    }
}

impl Lines<'_, '_> {
    /// Whether it is proved that no line meets anything within the footprint at `t`, `reach` times the light's.
    pub fn is_clear(&self, reach: f32, t: f32) -> bool {
        self.lone.is_some_and(|lone| lone.is_clear(&self.look_ups.filter, reach, t))
    }

    /// How many texels the footprint at `t` is wide where it is narrowest, `reach` times the light's. `None` where it is
    /// unbounded, or the faces of a cube hold it.
    pub fn width(&self, reach: f32, t: f32) -> Option<f32> {
        let (min, max) = self.lone.as_ref()?.bounds(reach, t)?;
        Some((max - min).min_element())
    }

    /// The surface stored where the line to the light's point `at` is at `t`, if it shadows the receiver.
    #[inline]
    pub fn look_up(&self, at: Vec2, t: f32) -> Met {
        let stored = match &self.lone {
            Some(lone) => self.stored(lone, at, t),
            None => {
                let Receiver { point, normal, tolerance, .. } = self.receiver;
                let stored = self.look_ups.maps().occluder(point + self.cone.direction(at) * t);
                stored.filter(|stored| rises_above(stored.point, point, normal, tolerance))
            }
        };
        stored.map_or(Met::Nothing, |stored| self.ask(&stored, at))
    }

    /// What the texel holds, if that rises above the receiver's plane.
    #[inline]
    fn stored(&self, lone: &Lone<'_>, at: Vec2, t: f32) -> Option<Occluder> {
        let place = lone.place(at, t);
        let end = lone.size as f32 * place.z;
        let inside = place.z > 0.0 && place.x >= 0.0 && place.y >= 0.0 && place.x <= end && place.y <= end;
        if !inside {
            return None;
        }
        // NDC 1 belongs to the last texel.
        let cell = |at: f32| ((at / place.z) as usize).min(lone.size as usize - 1);
        let (column, row) = (cell(place.x), cell(place.y));
        let depth = lone.tiled.at(column, row);
        if depth <= 0.0 || lone.plane.rise(column as f32, row as f32, depth) <= 0.0 {
            return None;
        }
        let map = &self.look_ups.maps().maps[0];
        let texel = 2.0 / lone.size as f32;
        let center = Vec2::new(column as f32 + 0.5, row as f32 + 0.5) * texel;
        Some(Occluder {
            point: map.view.unproject(Vec2::new(center.x - 1.0, 1.0 - center.y), depth),
            triangle: map.triangles[row * lone.size as usize + column] as usize,
            texel: map.view.half_diagonal(depth) * texel,
        })
    }

    /// The questions of shadow-map's `receiver_plane`; a neighbour on the same surface is asked outright, by the line to
    /// this point of the light.
    #[inline]
    fn ask(&self, stored: &Occluder, at: Vec2) -> Met {
        let Receiver { point, normal, tolerance, .. } = self.receiver;
        let maps = self.look_ups.maps();
        let share = self.share.dot(stored.point - point);
        let before_light = share > 0.0 && (share < 1.0 || self.parallel);
        if !(before_light && self.look_ups.filter.is_behind(stored.triangle, point, tolerance)) {
            return Met::Nothing;
        }
        let line = || LightPoint::Towards(self.cone.direction(at));
        let blocks = !is_near(stored.point, point, normal, maps.light.center(), stored.texel)
            || meets(maps.scene.corners(stored.triangle), point, line());
        if blocks { Met::Blocker(share) } else { Met::Nothing }
    }
}
