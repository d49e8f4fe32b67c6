//! Where the visibility functions of all PDSM pixels are kept: an index and a data array (section 4.1, figure 6), laid
//! out alike in memory, on the GPU and in files.

use bytemuck::Zeroable;
use rayon::prelude::*;

use crate::compression::{Compression, Compressor};
use crate::events::EventStrips;
use crate::guide::Guide;
use crate::nodes::{Node, Nodes};
use crate::sorting::SortedStrip;
use crate::surfaces::Surfaces;

/// The functions of a PDSM of n × n pixels.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Functions {
    /// Pixels a side.
    size: u32,
    /// n² + 1 numbers: where each pixel's nodes start in [`nodes`](Self::nodes), and their end.
    index: Vec<u32>,
    nodes: Nodes,
    statistics: Statistics,
    guide: Guide,
}

/// How long the functions are.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Statistics {
    /// Events of all pixels before compression.
    pub events: u64,
    /// Of the pixel with most.
    pub most_events: u32,
    /// Nodes of the pixel with most.
    pub most_nodes: u32,
}

impl Functions {
    /// Sorts and compresses the events of `views` maps, given in any number of parts: the sum of the parts counts, not
    /// how they are split.
    ///
    /// With `surfaces` the functions are right at the depths of those alone.
    pub fn new(
        size: u32,
        parts: &[EventStrips],
        views: u32,
        compression: Compression,
        surfaces: Option<&Surfaces>,
    ) -> Self {
        struct Strip {
            /// Nodes per pixel.
            counts: Vec<u32>,
            nodes: Vec<Node>,
            statistics: Statistics,
        }
        let layout = EventStrips::new(size);
        let strips: Vec<Strip> = (0..layout.strip_count())
            .into_par_iter()
            .map_init(<(SortedStrip, Compressor)>::default, |(sorted, compressor), index| {
                let events: Vec<_> = parts.iter().flat_map(|part| part.strip(index)).collect();
                let pixels = (size * layout.strip_rows(index)) as usize;
                sorted.sort(pixels, &events);
                let (mut counts, mut nodes) = (Vec::with_capacity(pixels), Vec::new());
                if let Some(surfaces) = surfaces {
                    let asked = surfaces.strip(index);
                    compressor.compress_strip_at(
                        sorted,
                        asked,
                        views,
                        compression.bound,
                        &mut counts,
                        &mut nodes,
                    );
                } else {
                    compressor.compress_strip(sorted, views, compression, &mut counts, &mut nodes);
                }
                let statistics = Statistics {
                    events: sorted.counts().iter().map(|&count| u64::from(count)).sum(),
                    most_events: sorted.counts().iter().max().copied().unwrap_or(0),
                    most_nodes: counts.iter().max().copied().unwrap_or(0),
                };
                Strip { counts, nodes, statistics }
            })
            .collect();
        let mut functions = Self { size, ..Self::default() };
        functions.index.reserve(size as usize * size as usize + 1);
        let mut start = 0;
        for strip in &strips {
            for count in &strip.counts {
                functions.index.push(start);
                start += count;
            }
            let statistics = &mut functions.statistics;
            statistics.events += strip.statistics.events;
            statistics.most_events = statistics.most_events.max(strip.statistics.most_events);
            statistics.most_nodes = statistics.most_nodes.max(strip.statistics.most_nodes);
        }
        // Each strip to its place by itself: fresh memory costs most of the copying.
        let mut nodes = vec![Node::zeroed(); start as usize];
        let mut rest = nodes.as_mut_slice();
        let mut places = Vec::with_capacity(strips.len());
        for strip in &strips {
            let (place, after) = rest.split_at_mut(strip.nodes.len());
            places.push(place);
            rest = after;
        }
        functions.index.push(start);
        let mut guide = Guide::with_room(size, start as usize);
        let rows = if strips.is_empty() { 1 } else { layout.strip_rows(0) };
        let parts = guide.parts(size, rows, &functions.index);
        places.into_par_iter().zip(&strips).zip(parts).for_each(|((place, strip), part)| {
            place.copy_from_slice(&strip.nodes);
            part.fill(|node| strip.nodes[node]);
        });
        functions.guide = guide;
        functions.nodes = Nodes::Full(nodes);
        functions
    }

    /// Functions that were kept as they lie in memory. `None` unless there are `size`² + 1 entries of the index, ascending
    /// from 0 to the number of nodes, and each function's nodes are finite and ascend.
    pub fn from_parts(size: u32, index: Vec<u32>, nodes: Nodes, statistics: Statistics) -> Option<Self> {
        let pixels = (size as usize).checked_mul(size as usize)?;
        let is_whole = Some(index.len()) == pixels.checked_add(1)
            && index[0] == 0
            && index[pixels] as usize == nodes.len()
            && index.is_sorted();
        let is_function = |pair: &[u32]| {
            let mut last = f32::NEG_INFINITY;
            (pair[0] as usize..pair[1] as usize).all(|place| {
                let node = nodes.get(place);
                let ascends = node.t.is_finite() && node.visibility.is_finite() && node.t >= last;
                last = node.t;
                ascends
            })
        };
        (is_whole && index.windows(2).all(is_function))
            .then(|| Self { size, index, nodes, statistics, guide: Guide::default() }.guided())
    }

    /// The same functions with 16 bits a number.
    pub fn into_packed(self) -> Self {
        let nodes = match self.nodes {
            Nodes::Full(nodes) => Nodes::packed(&nodes),
            packed @ Nodes::Packed(..) => packed,
        };
        Self { nodes, ..self }.guided()
    }

    fn guided(self) -> Self {
        Self { guide: Guide::new(self.size, &self.index, &self.nodes), ..self }
    }

    /// Pixels a side.
    pub fn size(&self) -> u32 {
        self.size
    }

    /// All nodes, pixel by pixel.
    pub fn nodes(&self) -> &Nodes {
        &self.nodes
    }

    /// Where each pixel's nodes start, row by row, and their end: n² + 1 numbers.
    pub fn index(&self) -> &[u32] {
        &self.index
    }

    /// How long the functions are.
    pub fn statistics(&self) -> Statistics {
        self.statistics
    }

    /// Pixels whose rays meet no shadow.
    pub fn empty_pixels(&self) -> u64 {
        self.index.windows(2).filter(|pair| pair[0] == pair[1]).count() as u64
    }

    /// Bytes held, with what leads lookups to their nodes.
    pub fn bytes(&self) -> u64 {
        (size_of_val(self.index.as_slice()) + size_of_val(self.nodes.words())) as u64 + self.guide.bytes()
    }

    pub(crate) fn guide(&self) -> &Guide {
        &self.guide
    }

    /// Where the nodes of the pixel in column `x`, row `y` lie.
    #[inline(always)]
    pub(crate) fn range(&self, x: i32, y: i32) -> [u32; 2] {
        let inside = 0..self.size as i32;
        if !inside.contains(&x) || !inside.contains(&y) {
            return [0; 2];
        }
        let pixel = y as usize * self.size as usize + x as usize;
        [self.index[pixel], self.index[pixel + 1]]
    }

    /// V at `t` along the ray of the pixel in column `x`, row `y`; 1 outside of the PDSM, where no shadow falls.
    #[inline]
    pub fn visibility(&self, x: i32, y: i32, t: f32) -> f32 {
        let [start, end] = self.range(x, y);
        self.nodes.evaluate(start as usize..end as usize, t)
    }
}
