//! Events by pixel, each pixel's in ascending order: sixteen pixels side by side, a lane each.
//!
//! Neighbouring rays pass much the same, so that sixteen of them have about as many events each. They are kept as rows of
//! sixteen, the n-th of each pixel in row n, and a network of comparisons (Batcher's odd-even mergesort) sorts whole rows
//! at once, without a branch. What a pixel has less than the longest of its group is filled with `NOTHING`, which sorts
//! behind everything.

use bytemuck::{Pod, Zeroable};
use fearless_simd::prelude::*;
use fearless_simd::{Level, Simd, dispatch, u32x16};

use crate::events::{Event, PlacedEvent};

/// Pixels of a group.
pub(crate) const LANES: usize = 16;

/// Stands for no event: no number has these bits.
pub(crate) const NOTHING: u32 = u32::MAX;

/// One event of each pixel of a group, as numbers in their order.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C, align(64))]
pub(crate) struct Row(pub(crate) [u32; LANES]);

/// Events of a strip by pixel, each pixel's in ascending order.
#[derive(Clone, Debug)]
pub struct SortedStrip {
    level: Level,
    /// Events of each pixel.
    counts: Vec<u32>,
    /// Where each group's rows start, and their end.
    starts: Vec<u32>,
    /// Where each pixel's next event goes.
    next: Vec<u32>,
    rows: Vec<Row>,
}

impl Default for SortedStrip {
    fn default() -> Self {
        let (counts, starts, next) = Default::default();
        Self { level: Level::new(), counts, starts, next, rows: Vec::new() }
    }
}

impl SortedStrip {
    /// Sorts the events that several collections hold for one strip of `pixels` pixels: by pixel as they are placed, then
    /// each group by depth. The order in which they came leaves no trace.
    pub fn sort(&mut self, pixels: usize, parts: &[&[PlacedEvent]]) {
        self.counts.clear();
        self.counts.resize(pixels, 0);
        for placed in parts.iter().copied().flatten() {
            self.counts[placed.pixel as usize] += 1;
        }
        self.starts.clear();
        self.next.clear();
        let mut rows = 0;
        for counts in self.counts.chunks(LANES) {
            self.starts.push(rows);
            self.next.extend((0..counts.len() as u32).map(|lane| rows * LANES as u32 + lane));
            rows += counts.iter().max().copied().unwrap_or(0);
        }
        self.starts.push(rows);
        self.rows.clear();
        self.rows.resize(rows as usize, Row([NOTHING; LANES]));
        let flat: &mut [u32] = bytemuck::cast_slice_mut(&mut self.rows);
        for placed in parts.iter().copied().flatten() {
            let next = &mut self.next[placed.pixel as usize];
            flat[*next as usize] = placed.event.ordered();
            *next += LANES as u32;
        }
        let (level, starts, rows) = (self.level, &self.starts, &mut self.rows);
        dispatch!(level, simd => sort_groups(simd, starts, rows));
    }

    /// How many events each pixel has.
    pub(crate) fn counts(&self) -> &[u32] {
        &self.counts
    }

    /// How many groups there are.
    pub(crate) fn groups(&self) -> usize {
        self.starts.len().saturating_sub(1)
    }

    /// How many events the pixels of a group have, at most [`LANES`] of them, and these in rows.
    pub(crate) fn group(&self, group: usize) -> (&[u32], &[Row]) {
        let first = group * LANES;
        let counts = &self.counts[first..self.counts.len().min(first + LANES)];
        (counts, &self.rows[self.starts[group] as usize..self.starts[group + 1] as usize])
    }

    /// Events of a pixel, ascending.
    pub fn pixel(&self, pixel: usize) -> impl ExactSizeIterator<Item = Event> + '_ {
        let (group, lane) = (pixel / LANES, pixel % LANES);
        let (counts, rows) = self.group(group);
        rows[..counts[lane] as usize].iter().map(move |row| Event::from_ordered(row.0[lane]))
    }
}

#[inline(always)]
fn sort_groups<S: Simd>(simd: S, starts: &[u32], rows: &mut [Row]) {
    for range in starts.windows(2) {
        sort_rows(simd, &mut rows[range[0] as usize..range[1] as usize]);
    }
}

/// Batcher's odd-even mergesort (Knuth, 5.2.2, algorithm M) of any number of rows: sorted runs of `run` rows each become
/// runs of twice as many.
#[inline(always)]
fn sort_rows<S: Simd>(simd: S, rows: &mut [Row]) {
    let mut run = 1;
    while run < rows.len() {
        let mut apart = run;
        while apart > 0 {
            let mut first = apart % run;
            while first + apart < rows.len() {
                // Only what will be in one run is compared.
                if first / (2 * run) == (first + apart) / (2 * run) {
                    let (low, high) = rows[first..].split_at_mut(apart);
                    for (low, high) in low.iter_mut().zip(high) {
                        let a = u32x16::from_slice(simd, &low.0);
                        let b = u32x16::from_slice(simd, &high.0);
                        a.min(b).store_slice(&mut low.0);
                        a.max(b).store_slice(&mut high.0);
                    }
                }
                first += 2 * apart;
            }
            apart /= 2;
        }
        run *= 2;
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        /// Every event at its pixel, in order, however they were split: any number of them, alike ones, and pixels without.
        #[test]
        fn events_are_sorted_by_pixel_and_depth(
            events in prop::collection::vec((0u32..37, -9i32..9, any::<bool>()), 0..1200),
            crowd in 0u32..37,
            share in 0.0f64..1.0,
        ) {
            let placed: Vec<_> = events
                .iter()
                .enumerate()
                .map(|(i, &(pixel, t, is_exit))| PlacedEvent {
                    pixel: if i % 3 == 0 { crowd } else { pixel },
                    event: Event::new(t as f32 * 0.1, is_exit),
                })
                .collect();
            let (front, back) = placed.split_at((placed.len() as f64 * share) as usize);
            let mut sorted = SortedStrip::default();
            // What was sorted before leaves no trace.
            sorted.sort(50, &[back]);
            sorted.sort(37, &[back, front]);
            for pixel in 0..37 {
                let mut expected: Vec<_> =
                    placed.iter().filter(|e| e.pixel as usize == pixel).map(|e| e.event).collect();
                expected.sort();
                prop_assert_eq!(sorted.pixel(pixel).collect::<Vec<_>>(), expected);
            }
        }
    }
}
