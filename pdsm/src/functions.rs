//! Where the visibility functions of all PDSM pixels are kept: an index and a data array (section 4.1, figure 6), laid
//! out alike in memory, on the GPU and in files.

use rayon::prelude::*;

use crate::compression::{Node, compress, evaluate};
use crate::events::{EventStrips, SortedStrip};

/// The functions of a PDSM of n × n pixels.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Functions {
    /// Pixels a side.
    size: u32,
    /// n² + 1 numbers: where each pixel's nodes start in [`nodes`](Self::nodes), and their end.
    index: Vec<u32>,
    nodes: Vec<Node>,
    statistics: Statistics,
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
    pub fn new(size: u32, parts: &[EventStrips], views: u32, max_error: f32) -> Self {
        struct Strip {
            /// Nodes per pixel.
            counts: Vec<u32>,
            nodes: Vec<Node>,
            statistics: Statistics,
        }
        let layout = EventStrips::new(size);
        let strips: Vec<Strip> = (0..layout.strip_count())
            .into_par_iter()
            .map_init(SortedStrip::default, |sorted, index| {
                let events: Vec<_> = parts.iter().map(|part| part.strip(index)).collect();
                let pixels = (size * layout.strip_rows(index)) as usize;
                sorted.sort(pixels, &events);
                let mut strip = Strip {
                    counts: Vec::with_capacity(pixels),
                    nodes: Vec::new(),
                    statistics: Statistics::default(),
                };
                for pixel in 0..pixels {
                    let (events, start) = (sorted.pixel(pixel), strip.nodes.len());
                    compress(events, views, max_error, &mut strip.nodes);
                    let count = (strip.nodes.len() - start) as u32;
                    strip.counts.push(count);
                    let statistics = &mut strip.statistics;
                    statistics.events += events.len() as u64;
                    statistics.most_events = statistics.most_events.max(events.len() as u32);
                    statistics.most_nodes = statistics.most_nodes.max(count);
                }
                strip
            })
            .collect();
        let mut functions = Self { size, ..Self::default() };
        functions.index.reserve(size as usize * size as usize + 1);
        functions.nodes.reserve(strips.iter().map(|strip| strip.nodes.len()).sum());
        let mut start = 0;
        for strip in &strips {
            for count in &strip.counts {
                functions.index.push(start);
                start += count;
            }
            functions.nodes.extend_from_slice(&strip.nodes);
            let statistics = &mut functions.statistics;
            statistics.events += strip.statistics.events;
            statistics.most_events = statistics.most_events.max(strip.statistics.most_events);
            statistics.most_nodes = statistics.most_nodes.max(strip.statistics.most_nodes);
        }
        functions.index.push(start);
        functions
    }

    /// Pixels a side.
    pub fn size(&self) -> u32 {
        self.size
    }

    /// All nodes, pixel by pixel.
    pub fn nodes(&self) -> &[Node] {
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

    /// Bytes held.
    pub fn bytes(&self) -> u64 {
        (size_of_val(self.index.as_slice()) + size_of_val(self.nodes.as_slice())) as u64
    }

    /// V at `t` along the ray of the pixel in column `x`, row `y`; 1 outside of the PDSM, where no shadow falls.
    #[inline]
    pub fn visibility(&self, x: i32, y: i32, t: f32) -> f32 {
        let inside = 0..self.size as i32;
        if !inside.contains(&x) || !inside.contains(&y) {
            return 1.0;
        }
        let pixel = y as usize * self.size as usize + x as usize;
        evaluate(&self.nodes[self.index[pixel] as usize..self.index[pixel + 1] as usize], t)
    }
}
