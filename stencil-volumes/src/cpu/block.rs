//! A block of tiles: what its tiles see, how they hang together, and their counts.

use fearless_simd::Simd;
use glam::DVec3;
use scene_core::bvh::shadow_origin;
use scene_core::light::LightPoint;
use scene_core::raster::SnappedView;

use super::tile::{PIXELS, Tile};
use super::{Asked, BLOCK, BLOCK_TILES, Receivers, TILE, Work};
use crate::bounds::{BoxGroup, LANES};
use crate::crossing::{SideFromApex, crossing};
use crate::outline::SeenPoint;
use crate::runs::Shaft;
use crate::volumes::{Start, Volumes};

/// Tiles of a block.
const TILES: usize = BLOCK_TILES * BLOCK_TILES;

/// A chord from a tile's start to the start of the tile it hangs on.
#[derive(Clone, Copy, Debug, Default)]
struct Link {
    /// The tile it hangs on, or itself for the first.
    parent: usize,
    /// The start's count less that of the parent's start.
    change: i32,
}

/// The outline of a triangle as seen from the eye: the planes through the eye and its edges.
struct Outline {
    triangle: u32,
    edges: [DVec3; 3],
}

impl Outline {
    const NONE: Self = Self { triangle: u32::MAX, edges: [DVec3::ZERO; 3] };

    fn new(receivers: &Receivers<'_>, triangle: u32, eye: DVec3) -> Self {
        let [a, b, c] = receivers.scene.corners(triangle as usize).map(|p| p.as_dvec3() - eye);
        Self { triangle, edges: [a.cross(b), b.cross(c), c.cross(a)] }
    }

    /// Whether a direction from the eye passes through the triangle.
    fn holds(&self, direction: DVec3) -> bool {
        let [a, b, c] = self.edges.map(|normal| normal.dot(direction));
        (a > 0.0 && b > 0.0 && c > 0.0) || (a < 0.0 && b < 0.0 && c < 0.0)
    }
}

/// A block of the image.
#[derive(Debug)]
pub(super) struct Block {
    tiles: Vec<Tile>,
    links: [Link; TILES],
    /// The first tile's start.
    pub(super) start: Option<Start>,
    /// Its count.
    pub(super) start_count: i32,
    /// Per row, a bit a pixel: lit.
    pub(super) lit: [u64; BLOCK],
    /// The silhouette edges that pass before the block, and a bit for each tile that they pass before.
    passing: Vec<(u32, u64)>,
    /// What was done.
    pub(super) work: Work,
    /// The rectangle of centres of the block.
    min: [f64; 2],
    max: [f64; 2],
}

impl Block {
    /// Looks at the pixels from `corner` on, and at the silhouette's edges before them.
    #[inline(always)]
    pub(super) fn new<S: Simd>(
        simd: S,
        volumes: &Volumes,
        receivers: &Receivers<'_>,
        corner: [usize; 2],
    ) -> Self {
        let center = |x: usize, y: usize| SnappedView::center(x as u32, y as u32).map(f64::from);
        let last = [corner[0] + BLOCK - 1, corner[1] + BLOCK - 1];
        let mut block = Self {
            tiles: Vec::new(),
            links: [Link::default(); TILES],
            start: None,
            start_count: 0,
            lit: [0; BLOCK],
            passing: Vec::new(),
            work: Work::default(),
            min: center(corner[0], corner[1]),
            max: center(last[0], last[1]),
        };
        block.tiles.resize(TILES, Tile::EMPTY);
        for index in 0..TILES {
            let at = [index % BLOCK_TILES * TILE, index / BLOCK_TILES * TILE];
            block.tiles[index].corner = center(corner[0] + at[0], corner[1] + at[1]);
            block.look(index, volumes, receivers, corner, at);
        }
        let sides = block.find_passing(simd, volumes);
        let eye = LightPoint::At(volumes.screen.eye.as_vec3());
        // The rasteriser compares depths of snapped triangles: where surfaces cross, and on those seen edge-on, the place it
        // finds may lie behind another. From there nothing can be counted.
        let is_before_all = |place: DVec3| !volumes.tree.is_occluded(place.as_vec3(), eye);
        for (index, sides) in sides.into_iter().enumerate() {
            if sides > volumes.dense || !block.tiles[index].choose_start(is_before_all) {
                block.trace(index, volumes, receivers.light.center());
            }
        }
        block.hang(volumes);
        block
    }

    /// Finds the edges that pass before the block and marks the pixels that are close to one. How many pass before each tile.
    #[inline(always)]
    fn find_passing<S: Simd>(&mut self, simd: S, volumes: &Volumes) -> [u32; TILES] {
        let mut counted = [0; TILES];
        let side = (TILE * SnappedView::STEPS as usize) as f64;
        let reach = ((TILE - 1) * SnappedView::STEPS as usize) as f64;
        let depth = self.tiles.iter().map(|tile| tile.depth).fold(f64::NEG_INFINITY, f64::max);
        let runs = (0..volumes.runs.len())
            .filter(|&run| volumes.runs.may_pass(run, self.min, self.max, depth))
            .flat_map(|run| volumes.runs.edges(run));
        for edge in runs {
            let outline = &volumes.outlines[edge];
            if !outline.may_pass(self.min, self.max, depth) {
                continue;
            }
            let mut passed = 0;
            // A float becomes the nearest integer there is: rows and columns from the first to the last.
            let [columns, rows] = [0, 1].map(|axis| {
                let [low, high] = outline.range(axis).map(|x| (x - self.min[axis]) / side);
                ((low - 1.0).max(0.0) as usize)..(high.max(-1.0) + 1.0).min(BLOCK_TILES as f64) as usize
            });
            for index in rows.flat_map(|row| columns.clone().map(move |column| row * BLOCK_TILES + column)) {
                let tile = &mut self.tiles[index];
                let high = [tile.corner[0] + reach, tile.corner[1] + reach];
                if tile.len > 0 && outline.may_pass(tile.corner, high, tile.depth) {
                    passed |= 1 << index;
                    counted[index] += 1;
                    if counted[index] <= volumes.dense {
                        tile.mark_close(simd, outline);
                    }
                }
            }
            self.passing.push((edge as u32, passed));
        }
        counted
    }

    /// Traces all asked pixels of a tile, and forgets them.
    fn trace(&mut self, index: usize, volumes: &Volumes, light: LightPoint) {
        let at = [index % BLOCK_TILES * TILE, index / BLOCK_TILES * TILE];
        let tile = &mut self.tiles[index];
        for i in 0..tile.len {
            // The place is an f32 that was widened.
            let lit = tile.unlit >> i & 1 == 0 && !volumes.tree.is_occluded(tile.place(i).as_vec3(), light);
            let pixel = tile.pixel[i] as usize;
            self.lit[at[1] + pixel / TILE] |= u64::from(lit) << (at[0] + pixel % TILE);
        }
        self.work.traced += tile.len as u64;
        tile.len = 0;
    }

    /// Packs the asked pixels of a tile.
    fn look(
        &mut self,
        index: usize,
        volumes: &Volumes,
        receivers: &Receivers<'_>,
        corner: [usize; 2],
        at: [usize; 2],
    ) {
        let center = |x: usize, y: usize| SnappedView::center(x as u32, y as u32).map(f64::from);
        let gbuffer = receivers.gbuffer;
        let mut seen = Outline::NONE;
        let (width, height) = (gbuffer.width as usize, gbuffer.height as usize);
        let tile = &mut self.tiles[index];
        for row in 0..TILE {
            for column in 0..TILE {
                let (bx, by) = (at[0] + column, at[1] + row);
                let (x, y) = (corner[0] + bx, corner[1] + by);
                if x >= width || y >= height {
                    continue;
                }
                let pixel = y * width + x;
                let asked = receivers.ask(pixel);
                let unlit = asked == Asked::Dark;
                match asked {
                    Asked::Nothing => {}
                    Asked::Lit => self.lit[by] |= 1 << bx,
                    Asked::Dark if receivers.skip_unlit => self.work.unreached += 1,
                    Asked::Dark | Asked::Yes => {
                        let origin = shadow_origin(
                            gbuffer.position[pixel],
                            gbuffer.normal[pixel],
                            receivers.magnitude,
                        );
                        // Where rays see no shadow there is none to be counted.
                        if !origin.is_finite() {
                            self.lit[by] |= u64::from(!unlit) << bx;
                            continue;
                        }
                        if seen.triangle != gbuffer.triangle[pixel] {
                            seen = Outline::new(receivers, gbuffer.triangle[pixel], volumes.screen.eye);
                        }
                        let from_eye = gbuffer.position[pixel].as_dvec3() - volumes.screen.eye;
                        let place = SeenPoint {
                            center: center(x, y),
                            from_eye: origin.as_dvec3() - volumes.screen.eye,
                        };
                        if !seen.holds(from_eye)
                            || volumes.screen.is_off_center(&place)
                            || volumes.crosses_near_cap(from_eye)
                        {
                            let lit = !volumes.tree.is_occluded(origin, receivers.light.center());
                            self.lit[by] |= u64::from(lit && !unlit) << bx;
                            self.work.traced += 1;
                            continue;
                        }
                        let depth = f64::from(gbuffer.depth[pixel]);
                        tile.push(row * TILE + column, origin.to_array(), depth, unlit);
                    }
                }
            }
        }
        self.work.tiles += u64::from(tile.len > 0);
        self.work.asked += tile.len as u64;
    }

    /// Joins the tiles to a tree, by the neighbour on the left or above whose depth is nearer.
    fn hang(&mut self, volumes: &Volumes) {
        let eye = volumes.screen.eye;
        let depth = |tile: &Tile| volumes.screen.depth(tile.place(tile.start) - eye);
        let mut before = None;
        for index in 0..TILES {
            if self.tiles[index].len == 0 {
                continue;
            }
            let own = depth(&self.tiles[index]);
            let left = (index % BLOCK_TILES > 0).then(|| index - 1);
            let above = index.checked_sub(BLOCK_TILES);
            let neighbours = [left, above].into_iter().flatten().filter(|&n| self.tiles[n].len > 0);
            let parent = neighbours
                .min_by(|&a, &b| {
                    let gap = |n: usize| (depth(&self.tiles[n]) - own).abs();
                    gap(a).total_cmp(&gap(b))
                })
                .or(before);
            if parent.is_none() {
                let tile = &self.tiles[index];
                let place = tile.place(tile.start);
                self.start = Some(Start::new(place, place - eye, &volumes.light));
            }
            self.links[index].parent = parent.unwrap_or(index);
            before = Some(index);
        }
    }

    /// Counts all pixels. The first start's count is known.
    #[inline(always)]
    pub(super) fn count<S: Simd>(&mut self, simd: S, volumes: &Volumes, light: LightPoint) {
        if self.start.is_none() {
            return;
        }
        let mut sides = [0_u32; TILES];
        self.count_links(simd, volumes, &mut sides);
        self.count_sides(simd, volumes, &mut sides);
        let mut starts = [0; TILES];
        for index in 0..TILES {
            let tile = &self.tiles[index];
            if tile.len == 0 {
                continue;
            }
            let Link { parent, change } = self.links[index];
            starts[index] = if parent == index { self.start_count } else { starts[parent] + change };
            let at = [index % BLOCK_TILES * TILE, index / BLOCK_TILES * TILE];
            let is_dense = sides[index] > volumes.dense;
            self.work.uniform += u64::from(sides[index] == 0 && !is_dense);
            for i in 0..tile.len {
                let lit = if is_dense || tile.close >> i & 1 == 1 {
                    self.work.traced += 1;
                    // The place is an f32 that was widened.
                    !volumes.tree.is_occluded(tile.place(i).as_vec3(), light)
                } else if starts[index] + tile.count(i) != 0 || tile.unlit >> i & 1 == 1 {
                    false
                } else if volumes.masked.may_block(tile.place(i), light) {
                    self.work.asked_of_masks += 1;
                    !volumes.tree.is_occluded(tile.place(i).as_vec3(), light)
                } else {
                    self.work.free_of_masks += u64::from(!volumes.masked.is_empty());
                    true
                };
                let pixel = tile.pixel[i] as usize;
                let lit = lit && tile.unlit >> i & 1 == 0;
                self.lit[at[1] + pixel / TILE] |= u64::from(lit) << (at[0] + pixel % TILE);
            }
        }
        self.tiles = Vec::new();
    }

    /// What the sides change.
    #[inline(always)]
    fn count_sides<S: Simd>(&mut self, simd: S, volumes: &Volumes, counted: &mut [u32; TILES]) {
        let mut bounds = [const { BoxGroup::EMPTY }; TILES / LANES];
        let mut chords = [const { BoxGroup::EMPTY }; TILES / LANES];
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for index in 0..TILES {
            let tile = &self.tiles[index];
            if tile.len == 0 {
                continue;
            }
            let places = (0..tile.len).map(|i| tile.place(i));
            let (min, max) =
                places.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(min, max), p| (min.min(p), max.max(p)));
            (low, high) = (low.min(min), high.max(max));
            bounds[index / LANES].set(index % LANES, min, max);
            let parent = self.links[index].parent;
            if parent != index {
                let (a, b) = (tile.place(tile.start), self.tiles[parent].place(self.tiles[parent].start));
                chords[index / LANES].set(index % LANES, a.min(b), a.max(b));
            }
        }
        let (center, half) = ((low + high) * 0.5, (high - low) * 0.5);
        let shaft = Shaft::to_light(low, high, &volumes.light);
        let mut groups = Vec::new();
        for group in 0..volumes.runs.len().div_ceil(LANES) {
            let mut within = volumes.runs.within(simd, group, &shaft);
            while within != 0 {
                let run = group * LANES + within.trailing_zeros() as usize;
                within &= within - 1;
                let edges = volumes.runs.edges(run);
                groups.push(edges.start / LANES..edges.end.div_ceil(LANES));
            }
        }
        self.work.run_pairs += groups.len() as u64;
        self.work.runs_skipped += (volumes.runs.len() - groups.len()) as u64;
        for group in groups.into_iter().flatten() {
            let side = &volumes.sides[group];
            let mut found = side.may_cross_box(simd, center, half);
            while found != 0 {
                let lane = found.trailing_zeros() as usize;
                found &= found - 1;
                let edge = &volumes.edges[group * LANES + lane];
                for row in 0..TILES / LANES {
                    let mut tiles = side.may_cross_boxes(simd, lane, &bounds[row]);
                    while tiles != 0 {
                        let index = row * LANES + tiles.trailing_zeros() as usize;
                        tiles &= tiles - 1;
                        counted[index] += 1;
                        if counted[index] <= volumes.dense {
                            self.tiles[index].add_side(simd, edge, &volumes.light);
                            self.work.pairs += 1;
                            self.work.pixel_pairs += self.tiles[index].len as u64;
                        }
                    }
                    let mut tiles = side.may_cross_boxes(simd, lane, &chords[row]);
                    while tiles != 0 {
                        let index = row * LANES + tiles.trailing_zeros() as usize;
                        tiles &= tiles - 1;
                        let (from, to) = self.chord(index);
                        let q = to - from;
                        let side = SideFromApex::new(edge, &volumes.light, from);
                        let plane = edge.plane(&volumes.light);
                        let begins = edge.is_outside(plane, from);
                        let ends = edge.is_outside(plane, to);
                        let beyond = side.edge.dot(q) >= 0.0;
                        self.links[index].change +=
                            edge.multiplicity * crossing(&side, q, beyond, begins, ends);
                    }
                }
            }
        }
    }

    /// The ends of the chord from a tile's parent's start to its own.
    #[inline(always)]
    fn chord(&self, index: usize) -> (DVec3, DVec3) {
        let (parent, own) = (&self.tiles[self.links[index].parent], &self.tiles[index]);
        (parent.place(parent.start), own.place(own.start))
    }

    /// What the silhouette's edges on the screen link.
    #[inline(always)]
    fn count_links<S: Simd>(&mut self, simd: S, volumes: &Volumes, counted: &mut [u32; TILES]) {
        let eye = volumes.screen.eye;
        for (edge, mut passed) in std::mem::take(&mut self.passing) {
            let (edge, outline) = (&volumes.edges[edge as usize], &volumes.outlines[edge as usize]);
            for (index, tile) in self.tiles.iter().enumerate() {
                let parent = self.links[index].parent;
                if tile.len == 0 || parent == index {
                    continue;
                }
                let above = &self.tiles[parent];
                let (from, to) = (above.center(above.start), tile.center(tile.start));
                let least = [from[0].min(to[0]), from[1].min(to[1])];
                let greatest = [from[0].max(to[0]), from[1].max(to[1])];
                if outline.may_pass(least, greatest, tile.depth.max(above.depth)) {
                    let (from, to) = self.chord(index);
                    let beyond = (edge.a - from).cross(edge.b - from).dot(to - from) >= 0.0;
                    let link = outline.link(edge, eye, from - eye, to - eye, beyond);
                    self.links[index].change += edge.multiplicity * link;
                }
            }
            while passed != 0 {
                let index = passed.trailing_zeros() as usize;
                passed &= passed - 1;
                if self.tiles[index].len > 0 {
                    counted[index] += 1;
                    self.tiles[index].add_link(simd, edge, outline, eye);
                    self.work.pairs += 1;
                    self.work.pixel_pairs += self.tiles[index].len as u64;
                }
            }
        }
    }
}

const _: () = assert!(PIXELS <= u8::MAX as usize + 1 && BLOCK == u64::BITS as usize);
