//! What a frame asks of the map: from the G-buffer, the receivers that need a lookup, tile by tile.
//!
//! `prepare.receivers` looks at every pixel once and keeps, of each tile and each image of the light, the nearest, the farthest
//! and a typical receiver: some thousand points, however large the picture. All parametrisations are made from these and
//! measured by them. Every pixel is asked again only for the window of the one that is taken ([`Seen::fit`]), and of those only
//! the tiles at the window's border.

use std::ops::Range;

use glam::{DVec3, Vec3};
use rayon::prelude::*;
use scene_core::camera::CameraRays;
use scene_core::light::LightPoint;
use scene_core::{Camera, GBuffer, Light, Scene};

use crate::caster_image::Within;
use crate::light_image::FACES;
use crate::warp::{Warp, Window, at};

/// Tiles a row or column of the larger side of the picture: a thousand samples, whose mean is known to 3 % of their spread.
const TILES: u32 = 32;

/// A tile's sides in pixels are a multiple of this, the side of a workgroup.
const STEP: u32 = 8;

/// Depths that are compared side by side.
const LANES: usize = STEP as usize;

/// Below this cosine between normal and light a surface receives next to nothing; errors are not counted there
/// ([`scene_core::reference::valid_pixels`]), nor is aliasing.
pub(crate) const GRAZING_COS: f32 = 0.05;

/// What depths are widened by: more than an f32 position is off (2⁻²⁴ of it).
pub(crate) const SLACK: f32 = 1.0 / 262_144.0;

/// A surface point that the camera sees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// World space.
    pub point: DVec3,
    /// Unit normal, world space.
    pub normal: DVec3,
    /// Column and row of its tile.
    pub tile: [u32; 2],
}

/// The receivers of one tile that lie in one image of the light. Pixels are [`GBuffer::NOTHING`] where there is none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tile {
    /// The pixel of the nearest receiver; of equal ones the first.
    pub nearest: u32,
    /// The pixel of the farthest receiver; of equal ones the first.
    pub farthest: u32,
    /// The pixel of the receiver nearest to the tile's middle that light does not graze.
    pub sample: u32,
}

impl Tile {
    /// A tile without receivers.
    pub const EMPTY: Self =
        Self { nearest: GBuffer::NOTHING, farthest: GBuffer::NOTHING, sample: GBuffer::NOTHING };
}

/// How a picture is cut into tiles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TileGrid {
    /// Pixels a side.
    pub side: u32,
    /// Tiles a row.
    pub columns: u32,
    /// Rows of tiles.
    pub rows: u32,
}

impl TileGrid {
    /// For a picture of this size: at most 32 × 32 tiles.
    pub fn new(width: u32, height: u32) -> Self {
        let side = width.max(height).div_ceil(TILES).max(1).next_multiple_of(STEP);
        Self { side, columns: width.div_ceil(side), rows: height.div_ceil(side) }
    }

    /// How far a pixel is from its tile's middle: the least is the tile's sample.
    #[inline]
    pub fn off_middle(&self, x: u32, y: u32) -> u32 {
        let half = self.side / 2;
        (x % self.side).abs_diff(half) + (y % self.side).abs_diff(half)
    }
}

/// The receivers of a picture that lie in one image of the light.
#[derive(Clone, Debug)]
pub struct Seen<'a> {
    wanted: &'a Wanted<'a>,
    grid: TileGrid,
    tiles: Vec<Tile>,
    /// Nearest and farthest depth along the view direction, scene units.
    pub depths: [f32; 2],
    /// Of each tile that has one, in order.
    pub samples: Vec<Sample>,
    /// The nearest and the farthest of each square of 2 × 2 tiles: together they span what is seen but for a tile's width.
    pub ends: Vec<DVec3>,
}

/// Which pixels need a lookup.
pub struct Wanted<'a> {
    gbuffer: &'a GBuffer,
    eye: DVec3,
    rays: CameraRays,
    center: LightPoint,
    receives: Vec<bool>,
    /// Whether every object does.
    all_receive: bool,
    /// A spot's place, unit axis and cosine, widened by 16 roundings of `Light::reaches`.
    cone: Option<(Vec3, Vec3, f32)>,
}

impl std::fmt::Debug for Wanted<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Wanted").field("center", &self.center).finish_non_exhaustive()
    }
}

impl<'a> Wanted<'a> {
    /// Of what `camera` sees in `gbuffer`.
    pub fn new(scene: &Scene, gbuffer: &'a GBuffer, camera: &Camera, light: &Light) -> Self {
        let cone = match *light {
            Light::Spot { position, direction, outer, .. } => {
                Some((position, direction.normalize_or_zero(), outer.cos() - 1.0 / 1_048_576.0))
            }
            _ => None,
        };
        let receives: Vec<_> = scene.objects().iter().map(|object| object.flags.receives).collect();
        Self {
            gbuffer,
            eye: camera.eye.as_dvec3(),
            rays: camera.rays(),
            center: light.center(),
            all_receive: receives.iter().all(|receives| *receives),
            receives,
            cone,
        }
    }

    /// Whether the pixel sees a surface that is turned to the light, reached by it, and shows shadows; and whether light
    /// does more than graze it.
    #[inline]
    fn at(&self, pixel: usize) -> Option<bool> {
        // NaN where nothing is seen: not turned to anything.
        let normal = self.gbuffer.normal[pixel];
        let (turned, length_squared) = match self.center {
            LightPoint::Towards(towards) => (normal.dot(towards), 1.0),
            LightPoint::At(place) => {
                let to_light = place - self.gbuffer.position[pixel];
                (normal.dot(to_light), to_light.length_squared())
            }
        };
        let receives =
            || self.all_receive || self.receives.get(self.gbuffer.object[pixel] as usize).is_some_and(|r| *r);
        let reached = || {
            self.cone.is_none_or(|(place, axis, cos)| {
                let from = self.gbuffer.position[pixel] - place;
                from.dot(axis) >= cos * from.length()
            })
        };
        let wanted = turned > 0.0 && self.gbuffer.depth[pixel].is_finite() && receives() && reached();
        wanted.then_some(turned * turned > GRAZING_COS * GRAZING_COS * length_squared)
    }

    /// `prepare.receivers`: the receivers of each of `images` images of the light, told apart by `image_of` a point.
    pub fn seen(&self, images: usize, image_of: impl Fn(Vec3) -> usize + Sync) -> Vec<Seen<'_>> {
        let grid = TileGrid::new(self.gbuffer.width, self.gbuffer.height);
        let columns = grid.columns as usize;
        let mut tiles = vec![Tile::EMPTY; images * columns * grid.rows as usize];
        tiles.par_chunks_mut((images * columns).max(1)).enumerate().for_each(|(row, tiles)| {
            for (column, tiles) in tiles.chunks_exact_mut(images).enumerate() {
                self.look_at(grid, [column, row], tiles, &image_of);
            }
        });
        let of_image = |image: usize| tiles.iter().skip(image).step_by(images).copied().collect();
        (0..images).map(|image| Seen::new(self, grid, of_image(image))).collect()
    }

    /// Pixels of a tile, row by row.
    fn pixels(&self, grid: TileGrid, [column, row]: [usize; 2]) -> impl Iterator<Item = (u32, u32, usize)> {
        let (width, height, side) = (self.gbuffer.width, self.gbuffer.height, grid.side);
        let (left, top) = (column as u32 * side, row as u32 * side);
        (top..(top + side).min(height)).flat_map(move |y| {
            (left..(left + side).min(width)).map(move |x| (x, y, y as usize * width as usize + x as usize))
        })
    }

    fn look_at(
        &self,
        grid: TileGrid,
        place: [usize; 2],
        tiles: &mut [Tile],
        image_of: &(impl Fn(Vec3) -> usize + Sync),
    ) {
        if let [tile] = tiles {
            return self.look_at_one(grid, place, tile);
        }
        let depth = &self.gbuffer.depth;
        let mut off_middle = [u32::MAX; FACES.len()];
        for (x, y, pixel) in self.pixels(grid, place) {
            let Some(counts) = self.at(pixel) else { continue };
            let image = image_of(self.gbuffer.position[pixel]);
            let (tile, off_middle) = (&mut tiles[image], &mut off_middle[image]);
            if tile.nearest == GBuffer::NOTHING || depth[pixel] < depth[tile.nearest as usize] {
                tile.nearest = pixel as u32;
            }
            if tile.farthest == GBuffer::NOTHING || depth[pixel] > depth[tile.farthest as usize] {
                tile.farthest = pixel as u32;
            }
            let off = grid.off_middle(x, y);
            if counts && off < *off_middle {
                (*off_middle, tile.sample) = (off, pixel as u32);
            }
        }
    }

    /// As [`look_at`](Self::look_at) where there is one image. Mostly the nearest and the farthest surface of a tile and its middle
    /// are receivers, and three pixels are asked; else every pixel whose depth or place could change something.
    fn look_at_one(&self, grid: TileGrid, [column, row]: [usize; 2], tile: &mut Tile) {
        let (width, height, side) = (self.gbuffer.width, self.gbuffer.height, grid.side);
        let (left, top) = (column as u32 * side, row as u32 * side);
        let (bottom, right) = ((top + side).min(height), (left + side).min(width));
        let span = |y: u32| (y * width + left) as usize..(y * width + right) as usize;
        let range = depth_range((top..bottom).map(|y| &self.gbuffer.depth[span(y)]));
        if range[0] > range[1] {
            return;
        }
        let first_with = |depth: f32| {
            let within = |row: Range<usize>| {
                self.gbuffer.depth[row.clone()].iter().position(|&d| d == depth).map(|x| row.start + x)
            };
            (top..bottom).map(span).find_map(within).filter(|&pixel| self.at(pixel).is_some())
        };
        let (mut nearest, mut farthest, mut off_middle) = (f32::INFINITY, f32::NEG_INFINITY, u32::MAX);
        if let Some(pixel) = first_with(range[0]) {
            (nearest, tile.nearest) = (range[0], pixel as u32);
        }
        if let Some(pixel) = first_with(range[1]) {
            (farthest, tile.farthest) = (range[1], pixel as u32);
        }
        let middle = (left + side / 2, top + side / 2);
        let pixel = middle.1 as usize * width as usize + middle.0 as usize;
        if middle.0 < width && middle.1 < height && self.at(pixel) == Some(true) {
            (off_middle, tile.sample) = (0, pixel as u32);
        }
        if [nearest, farthest] == range && off_middle == 0 {
            return;
        }
        for y in top..bottom {
            let first = span(y).start;
            let depths = &self.gbuffer.depth[span(y)];
            let off_row = (y - top).abs_diff(side / 2);
            for (x, &depth) in (0u32..).zip(depths) {
                let off = off_row + x.abs_diff(side / 2);
                // NaN and infinity are none of these.
                let spreads = depth < nearest || (depth > farthest && depth < f32::INFINITY);
                if !(spreads || off < off_middle) {
                    continue;
                }
                let pixel = first + x as usize;
                let Some(counts) = self.at(pixel) else { continue };
                if depth < nearest {
                    (nearest, tile.nearest) = (depth, pixel as u32);
                }
                if depth > farthest {
                    (farthest, tile.farthest) = (depth, pixel as u32);
                }
                if counts && off < off_middle {
                    (off_middle, tile.sample) = (off, pixel as u32);
                }
            }
        }
    }
}

/// The least and the largest finite depth of `rows`, eight side by side; the least is above the other where there is none.
fn depth_range<'a>(rows: impl Iterator<Item = &'a [f32]>) -> [f32; 2] {
    let (mut low, mut high) = ([f32::INFINITY; LANES], [f32::NEG_INFINITY; LANES]);
    let mut take = |lane: usize, depth: f32| {
        // NaN is below and above nothing.
        let finite = if depth < f32::INFINITY { depth } else { f32::NEG_INFINITY };
        low[lane] = if depth < low[lane] { depth } else { low[lane] };
        high[lane] = if finite > high[lane] { finite } else { high[lane] };
    };
    for row in rows {
        let (eights, rest) = row.as_chunks::<LANES>();
        for eight in eights {
            (0..LANES).for_each(|lane| take(lane, eight[lane]));
        }
        rest.iter().enumerate().for_each(|(lane, &depth)| take(lane, depth));
    }
    [low.into_iter().fold(f32::INFINITY, f32::min), high.into_iter().fold(f32::NEG_INFINITY, f32::max)]
}

impl<'a> Seen<'a> {
    fn new(wanted: &'a Wanted<'a>, grid: TileGrid, tiles: Vec<Tile>) -> Self {
        let GBuffer { position, normal, depth, .. } = wanted.gbuffer;
        let mut seen = Self {
            wanted,
            grid,
            depths: [f32::INFINITY, 0.0],
            samples: Vec::with_capacity(tiles.len()),
            ends: Vec::with_capacity(tiles.len() / 2),
            tiles,
        };
        let columns = grid.columns as usize;
        for (top, left) in
            (0..grid.rows as usize).step_by(2).flat_map(|top| (0..columns).step_by(2).map(move |x| (top, x)))
        {
            let rows = top..(top + 2).min(grid.rows as usize);
            let square = rows.flat_map(|row| (left..(left + 2).min(columns)).map(move |x| row * columns + x));
            let tiles = square.map(|index| seen.tiles[index]).filter(|tile| tile.nearest != GBuffer::NOTHING);
            let ends = tiles.map(|tile| [tile.nearest, tile.farthest]).reduce(|[near, far], [n, f]| {
                let depth = |pixel: u32| depth[pixel as usize];
                [if depth(n) < depth(near) { n } else { near }, if depth(f) > depth(far) { f } else { far }]
            });
            let Some([near, far]) = ends.map(|ends| ends.map(|pixel| pixel as usize)) else { continue };
            seen.depths = [seen.depths[0].min(depth[near]), seen.depths[1].max(depth[far])];
            seen.ends.extend([near, far].map(|pixel| position[pixel].as_dvec3()));
        }
        let samples = seen.tiles.iter().enumerate().filter(|(_, tile)| tile.sample != GBuffer::NOTHING);
        seen.samples.extend(samples.map(|(index, tile)| Sample {
            tile: [(index % columns) as u32, (index / columns) as u32],
            point: position[tile.sample as usize].as_dvec3(),
            normal: normal[tile.sample as usize].as_dvec3(),
        }));
        seen.samples.retain(|sample| sample.point.is_finite());
        seen.ends.retain(|point| point.is_finite());
        seen
    }

    /// Whether there is no receiver.
    pub fn is_empty(&self) -> bool {
        self.ends.is_empty()
    }

    /// The window of `warp` around all receivers that lie `within` a part of the light's image, and the range of w over them. `is_of`
    /// takes those of this image.
    ///
    /// The ends give most of it; a tile is asked pixel by pixel only if the part of the view that holds its receivers
    /// reaches beyond.
    pub fn fit(
        &self,
        warp: &Warp,
        within: Within<'_>,
        is_of: impl Fn(Vec3) -> bool + Sync,
    ) -> (Window, [f64; 2]) {
        let Within { image, part } = within;
        let holds = |point: DVec3| part.is_everywhere() || part.holds(image.place(point));
        let with = |(window, [low, high]): (Window, [f64; 2]), point: DVec3| {
            let w = at(warp.w, point);
            (window.with(warp.place(point)), [low.min(w), high.max(w)])
        };
        let nothing = (Window::EMPTY, [f64::INFINITY, f64::NEG_INFINITY]);
        let first = self.ends.iter().copied().filter(|&p| holds(p)).fold(nothing, with);
        let (window, [least, largest]) = first;
        // Not so for NaN.
        let spans = |point: DVec3| {
            let (w, place) = (at(warp.w, point), warp.place(point));
            (least..=largest).contains(&w) && place.cmpge(window.min).all() && place.cmple(window.max).all()
        };
        let position = &self.wanted.gbuffer.position;
        let columns = self.grid.columns as usize;
        let asked = self.tiles.par_iter().enumerate().filter_map(|(index, tile)| {
            if tile.nearest == GBuffer::NOTHING {
                return None;
            }
            let place = [index % columns, index / columns];
            let corners = self.corners(place, tile);
            let around = corners.into_iter().fold(nothing, with);
            let is_inside = around.1[0] > 0.0
                && first.0.union(around.0) == first.0
                && around.1[0] >= first.1[0]
                && around.1[1] <= first.1[1];
            let is_beside = || {
                !part.is_everywhere()
                    && corners.iter().all(|&p| at(image.w, p) > 0.0)
                    && part.is_beside(&corners.map(|p| image.place(p)))
            };
            if is_inside || is_beside() {
                return None;
            }
            let pixels = self.wanted.pixels(self.grid, place).map(|(_, _, pixel)| pixel);
            // Of most pixels the place alone tells that they add nothing.
            let adds = pixels.filter(|&pixel| !spans(position[pixel].as_dvec3()));
            let points = adds.filter(|&pixel| self.wanted.at(pixel).is_some()).map(|pixel| position[pixel]);
            let of_image = points.filter(|&p| is_of(p)).map(Vec3::as_dvec3).filter(|&p| holds(p));
            Some(of_image.fold(nothing, with))
        });
        asked.reduce(
            || first,
            |(a, [low, high]), (b, [lower, higher])| (a.union(b), [low.min(lower), high.max(higher)]),
        )
    }

    /// Corners of the part of the view that holds a tile's receivers: from the pixels' outer borders, half a pixel beyond
    /// any centre, which is more than positions are rounded by as long as the scene's place has fewer digits than they.
    fn corners(&self, [column, row]: [usize; 2], tile: &Tile) -> [DVec3; 8] {
        let Wanted { gbuffer, eye, rays, .. } = self.wanted;
        let side = self.grid.side as f32;
        let depth = |pixel: u32| gbuffer.depth[pixel as usize];
        let depths = [depth(tile.nearest) * (1.0 - SLACK), depth(tile.farthest) * (1.0 + SLACK)];
        let low = glam::Vec2::new(column as f32, row as f32) * side;
        let high = (low + side).min(glam::Vec2::new(gbuffer.width as f32, gbuffer.height as f32));
        let directions: [DVec3; 4] = std::array::from_fn(|i| {
            let pixel = glam::Vec2::new([low.x, high.x][i & 1], [low.y, high.y][i >> 1]);
            rays.direction(pixel).as_dvec3()
        });
        std::array::from_fn(|i| *eye + directions[i & 3] * f64::from(depths[i >> 2]))
    }
}
