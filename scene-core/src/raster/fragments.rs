//! All that lies over a pixel, not the nearest alone: fragments in order of their depth.

use glam::Mat4;
use rayon::prelude::*;

use super::MAX_SIDE;
use super::bins::BAND_ROWS;
use super::depth::{DepthConvention, DepthOptions, casters, drawing};
use super::draw::{RasterScratch, draw};
use super::pixels::{Face, Pixels};
use crate::Scene;

/// A face over a pixel's centre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fragment {
    /// Depth after projection, as a depth map holds it.
    pub depth: f32,
    /// The triangle, as an index into [`Scene::triangles`].
    pub triangle: u32,
}

/// Every face over every pixel's centre, row by row from the top left.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Fragments {
    /// Pixels a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Fragments of pixel i are `all[first[i]..first[i + 1]]`.
    first: Vec<u32>,
    all: Vec<Fragment>,
}

impl Fragments {
    /// The faces over a pixel, the nearest first; of equally near ones the one with the lowest triangle index. None for a
    /// pixel outside.
    #[inline]
    pub fn of(&self, column: u32, row: u32) -> &[Fragment] {
        if column >= self.width || row >= self.height {
            return &[];
        }
        let pixel = row as usize * self.width as usize + column as usize;
        &self.all[self.first[pixel] as usize..self.first[pixel + 1] as usize]
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.all.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.all.is_empty()
    }

    /// Where each pixel's fragments begin in [`all`](Self::all), and behind the last pixel's where they end.
    pub fn first(&self) -> &[u32] {
        &self.first
    }

    /// All fragments, pixel by pixel.
    pub fn all(&self) -> &[Fragment] {
        &self.all
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.first[..]) + size_of_val(&self.all[..])
    }
}

/// Draws every face of the casters over every pixel it covers, by the rules of [`render_depth`](super::render_depth):
/// the first fragment of a pixel is what a depth map holds. Memory grows with the layers of the scene: 8 bytes a
/// fragment while drawing twice.
///
/// # Panics
/// If a side is longer than [`MAX_SIDE`].
pub fn render_fragments(
    scene: &Scene,
    clip_from_world: Mat4,
    width: u32,
    height: u32,
    options: &DepthOptions<'_>,
    scratch: &mut RasterScratch,
) -> Fragments {
    assert!(width <= MAX_SIDE && height <= MAX_SIDE, "a side of {width} × {height} is above {MAX_SIDE}");
    let negate = options.convention == DepthConvention::Forward;
    let pixels = width as usize * height as usize;
    let per_band = (width as usize * BAND_ROWS).max(1);
    let mut bands: Vec<Band> = (0..pixels.div_ceil(per_band))
        .map(|band| Band { pixels: per_band.min(pixels - band * per_band), negate, ..Band::default() })
        .collect();
    draw(
        &drawing(scene, clip_from_world, options, width, height),
        casters(scene, options),
        scratch,
        bands.par_iter_mut().map(|band| BandPixels { band }),
    );
    let mut first = Vec::with_capacity(pixels + 1);
    let mut all = Vec::with_capacity(bands.iter().map(|band| band.sorted.len()).sum());
    for band in &bands {
        let begin = all.len() as u32;
        first.extend(band.first[..band.pixels].iter().map(|at| begin + at));
        all.extend_from_slice(&band.sorted);
    }
    first.push(all.len() as u32);
    Fragments { width, height, first, all }
}

/// What one thread draws.
#[derive(Debug, Default)]
struct Band {
    pixels: usize,
    negate: bool,
    /// Pixel and fragment in the order they are drawn; the depth is nearness.
    drawn: Vec<(u32, Fragment)>,
    first: Vec<u32>,
    sorted: Vec<Fragment>,
}

struct BandPixels<'a> {
    band: &'a mut Band,
}

impl Pixels for BandPixels<'_> {
    fn begin(&mut self) {}

    #[inline(always)]
    fn sample(&mut self, index: usize, nearness: f32, face: Face) {
        self.band.drawn.push((index as u32, Fragment { depth: nearness, triangle: face.id }));
    }

    #[inline(always)]
    fn block<S: fearless_simd::Simd>(
        &mut self,
        _simd: S,
        index: usize,
        nearness: fearless_simd::f32x8<S>,
        mask: fearless_simd::mask32x8<S>,
        face: Face,
    ) {
        super::pixels::samples(self, index, nearness, mask, face);
    }

    /// Counts, places, then sorts each pixel's few.
    fn finish(&mut self) {
        let Band { pixels, negate, drawn, first, sorted } = &mut *self.band;
        first.clear();
        first.resize(*pixels + 1, 0);
        for (pixel, _) in drawn.iter() {
            first[*pixel as usize + 1] += 1;
        }
        let mut sum = 0;
        for count in first.iter_mut() {
            sum += *count;
            *count = sum;
        }
        // Placing moves each beginning to its end, which is where the next one begins.
        sorted.resize(drawn.len(), Fragment { depth: 0.0, triangle: 0 });
        for (pixel, fragment) in drawn.iter() {
            let at = &mut first[*pixel as usize];
            sorted[*at as usize] = *fragment;
            *at += 1;
        }
        first.rotate_right(1);
        first[0] = 0;
        for pixel in 0..*pixels {
            let range = first[pixel] as usize..first[pixel + 1] as usize;
            if range.len() > 1 {
                sorted[range]
                    .sort_unstable_by(|a, b| b.depth.total_cmp(&a.depth).then(a.triangle.cmp(&b.triangle)));
            }
        }
        if *negate {
            sorted.iter_mut().for_each(|fragment| fragment.depth = 0.0 - fragment.depth);
        }
        *drawn = Vec::new();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::raster::{DepthMap, render_depth_and_triangles_into};
    use crate::scenes;

    /// The first of each pixel is the depth map's, and there are as many as faces counted apart.
    #[test]
    fn the_first_is_what_a_depth_map_holds_and_none_is_missing() {
        for name in ["layers", "fence", "knot"] {
            let setup = scenes::build(name, 0.0).expect("built in");
            let (scene, camera) = (&setup.scene, &setup.camera);
            let clip = camera.projection_from_world();
            let (width, height) = (131, 97);
            let mut scratch = RasterScratch::new();
            let options = DepthOptions::default();
            let fragments = render_fragments(scene, clip, width, height, &options, &mut scratch);
            let (mut map, mut ids) = (DepthMap { width, height, depth: Vec::new() }, Vec::new());
            render_depth_and_triangles_into(scene, clip, &options, &mut scratch, &mut map, &mut ids);
            let counts = super::super::count_layers(scene, clip, width, height);
            for (pixel, &id) in ids.iter().enumerate() {
                let of = fragments.of(pixel as u32 % width, pixel as u32 / width);
                let expected = (id != u32::MAX).then_some(Fragment { depth: map.depth[pixel], triangle: id });
                assert_eq!(of.first().copied(), expected, "{name}: pixel {pixel}");
                assert!(of.windows(2).all(|pair| pair[0].depth >= pair[1].depth));
                // Counting knows nothing of masks.
                let all = (counts.front[pixel] + counts.back[pixel]) as usize;
                assert!(of.len() == all || scene.has_alpha() && of.len() < all, "{name}: pixel {pixel}");
            }
            assert!(fragments.of(width, 0).is_empty() && fragments.len() > ids.len() / 4);
        }
    }
}
