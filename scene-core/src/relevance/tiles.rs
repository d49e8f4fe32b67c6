//! Where what a tile of the image sees lies: depths, and bounds in world and light space.

use glam::Mat4;
use rayon::prelude::*;

use crate::geometry::Aabb;
use crate::{GBuffer, Scene};

/// Side of a tile in pixels.
pub const TILE: u32 = 16;

/// How a light lies to all that a tile sees: see [`classify_tiles`](super::classify_tiles).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TileClass {
    /// No receiver is seen there.
    Empty,
    /// Proved: every pixel that sees a receiver has V = 1.
    Lit,
    /// Proved: every pixel that sees a receiver has V = 0.
    Umbra,
    /// Anything else.
    #[default]
    Mixed,
}

/// What a tile sees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tile {
    /// Pixels that count.
    pub seen: u32,
    /// Least distance along the view direction, in scene units; ∞ if nothing counts.
    pub depth_min: f32,
    /// Greatest distance; −∞ if nothing counts.
    pub depth_max: f32,
    /// Bounds of the positions; empty if nothing counts.
    pub bounds: Aabb,
}

impl Tile {
    const EMPTY: Self =
        Self { seen: 0, depth_min: f32::INFINITY, depth_max: f32::NEG_INFINITY, bounds: Aabb::EMPTY };

    /// Bounds in the normalised device coordinates of a light, of everything inside the tile's box.
    ///
    /// Empty for an empty tile. `None` if part of the box lies at or behind the plane of the light's eye: then it
    /// may project anywhere. Projected in f64 and rounded outwards by an ulp, so that a position projected in f64
    /// is never outside; who projects in f32 allows for its own rounding.
    pub fn projected(&self, clip_from_world: Mat4) -> Option<Aabb> {
        if self.seen == 0 {
            return Some(Aabb::EMPTY);
        }
        let clip_from_world = clip_from_world.as_dmat4();
        let mut bounds = Aabb::EMPTY;
        for corner in self.bounds.corners() {
            let clip = clip_from_world * corner.as_dvec3().extend(1.0);
            let ndc = clip.truncate() / clip.w;
            if !(clip.w > 0.0 && ndc.is_finite()) {
                return None;
            }
            let ndc = ndc.as_vec3();
            bounds.min = bounds.min.min(ndc.map(f32::next_down));
            bounds.max = bounds.max.max(ndc.map(f32::next_up));
        }
        Some(bounds)
    }
}

/// Tiles of an image, row by row from the top left; those at the right and the bottom may be cut.
#[derive(Clone, Debug, PartialEq)]
pub struct TileBounds {
    /// Tiles a row.
    pub columns: u32,
    /// Rows of tiles.
    pub rows: u32,
    /// The tiles.
    pub tiles: Vec<Tile>,
}

impl TileBounds {
    /// Bounds of everything seen.
    pub fn of(gbuffer: &GBuffer) -> Self {
        Self::of_objects(gbuffer, |_| true)
    }

    /// Bounds of what is seen of objects that receive shadows: all that a caster can matter to.
    pub fn of_receivers(scene: &Scene, gbuffer: &GBuffer) -> Self {
        Self::of_objects(gbuffer, |id| scene.objects().get(id as usize).is_some_and(|o| o.flags.receives))
    }

    /// Bounds of what is seen of the objects that `counts` accepts by their id.
    pub fn of_objects(gbuffer: &GBuffer, counts: impl Fn(u32) -> bool + Sync) -> Self {
        let (columns, rows) = (gbuffer.width.div_ceil(TILE), gbuffer.height.div_ceil(TILE));
        let tile_at = |index: u32| {
            let (x, y) = (index % columns * TILE, index / columns * TILE);
            let mut tile = Tile::EMPTY;
            for row in y..(y + TILE).min(gbuffer.height) {
                let start = row as usize * gbuffer.width as usize;
                for pixel in start + x as usize..start + (x + TILE).min(gbuffer.width) as usize {
                    if gbuffer.is_seen(pixel) && counts(gbuffer.object[pixel]) {
                        tile.seen += 1;
                        tile.depth_min = tile.depth_min.min(gbuffer.depth[pixel]);
                        tile.depth_max = tile.depth_max.max(gbuffer.depth[pixel]);
                        tile.bounds = tile.bounds.with_point(gbuffer.position[pixel]);
                    }
                }
            }
            tile
        };
        Self { columns, rows, tiles: (0..columns * rows).into_par_iter().map(tile_at).collect() }
    }

    /// Boxes of the tiles that see something, for [`super::Receivers::within`].
    pub fn boxes(&self) -> Vec<Aabb> {
        self.tiles.iter().filter(|tile| tile.seen > 0).map(|tile| tile.bounds).collect()
    }

    /// The box around everything that counts.
    pub fn bounds(&self) -> Aabb {
        self.tiles.iter().fold(Aabb::EMPTY, |sum, tile| sum.union(tile.bounds))
    }
}

#[cfg(test)]
mod tests {
    use glam::{Vec3, Vec4};

    use super::*;

    fn gbuffer() -> GBuffer {
        let mut gbuffer = GBuffer::new(20, 17);
        for (pixel, position, object) in
            [(0, Vec3::ONE, 0), (5, Vec3::new(-1.0, 2.0, 0.0), 0), (339, Vec3::splat(7.0), 1)]
        {
            gbuffer.position[pixel] = position;
            gbuffer.depth[pixel] = position.x.abs();
            (gbuffer.triangle[pixel], gbuffer.object[pixel]) = (0, object);
        }
        gbuffer
    }

    #[test]
    fn tiles_hold_what_their_pixels_see() {
        let tiles = TileBounds::of(&gbuffer());
        assert_eq!((tiles.columns, tiles.rows), (2, 2));
        assert_eq!(tiles.tiles.iter().map(|t| t.seen).collect::<Vec<_>>(), [2, 0, 0, 1]);
        assert_eq!(tiles.tiles[0].bounds.min, Vec3::new(-1.0, 1.0, 0.0));
        assert_eq!((tiles.tiles[3].depth_min, tiles.tiles[3].depth_max), (7.0, 7.0));
        assert_eq!(tiles.boxes().len(), 2);
        assert_eq!(TileBounds::of_objects(&gbuffer(), |id| id == 0).bounds().max, Vec3::new(1.0, 2.0, 1.0));
        assert!(TileBounds::of(&GBuffer::new(0, 0)).tiles.is_empty());
    }

    #[test]
    fn projected_bounds_hold_every_position() {
        let tiles = TileBounds::of(&gbuffer());
        let shift = Mat4::from_translation(Vec3::new(0.5, 0.0, 0.0));
        let bounds = tiles.tiles[0].projected(shift).unwrap();
        for p in [Vec3::new(1.5, 1.0, 1.0), Vec3::new(-0.5, 2.0, 0.0)] {
            assert!(bounds.min.cmple(p).all() && bounds.max.cmpge(p).all());
        }
        assert!(tiles.tiles[1].projected(shift).unwrap().is_empty());
        // An eye among the positions.
        let perspective = Mat4::from_cols(Vec4::X, Vec4::Y, Vec4::NEG_W, Vec4::Z * 0.1);
        assert_eq!(tiles.tiles[0].projected(perspective), None);
    }
}
