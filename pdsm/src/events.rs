//! Visibility events of a PDSM pixel: where along its ray the shadow of one map begins or ends.

/// An event as a number that sorts by depth, entries before exits at the same depth.
///
/// The upper 31 bits are those of t in an order that whole numbers have (sign bit flipped, negative ones inverted); the
/// lowest is 1 for an exit. So t is kept to 2 ulps.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Event(u32);

impl Event {
    /// The shadow begins at `t`, or ends there.
    #[inline]
    pub fn new(t: f32, is_exit: bool) -> Self {
        let bits = t.to_bits();
        let ordered = bits ^ ((bits as i32 >> 31) as u32 | 0x8000_0000);
        Self(ordered & !1 | u32::from(is_exit))
    }

    /// Depth along the ray, to 2 ulps.
    #[inline]
    pub fn t(self) -> f32 {
        let ordered = self.0 & !1;
        let flip = if ordered & 0x8000_0000 != 0 { 0x8000_0000 } else { u32::MAX };
        f32::from_bits(ordered ^ flip)
    }

    /// Whether the shadow ends.
    #[inline]
    pub fn is_exit(self) -> bool {
        self.0 & 1 == 1
    }

    /// The number that it sorts by.
    #[inline]
    pub(crate) fn ordered(self) -> u32 {
        self.0
    }

    /// The event with this number.
    #[inline]
    pub(crate) fn from_ordered(ordered: u32) -> Self {
        Self(ordered)
    }
}

/// An event and where in its strip of rows the pixel is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PlacedEvent {
    /// Pixel of the strip, row by row.
    pub pixel: u32,
    /// What happens.
    pub event: Event,
}

/// Events of many maps, sorted into strips of PDSM rows as they come: what is kept between maps.
#[derive(Clone, Debug)]
pub struct EventStrips {
    size: u32,
    /// Rows of a strip are 2 to this power.
    row_bits: u32,
    strips: Vec<Strip>,
}

/// Events that are kept in one piece: 32 KiB, so that none is moved as more come.
const PIECE: usize = 4096;

#[derive(Clone, Debug, Default)]
struct Strip {
    full: Vec<Vec<PlacedEvent>>,
    last: Vec<PlacedEvent>,
}

impl Strip {
    #[cold]
    fn begin_piece(&mut self) {
        self.full.push(std::mem::replace(&mut self.last, Vec::with_capacity(PIECE)));
    }

    fn len(&self) -> usize {
        self.full.len() * PIECE + self.last.len()
    }
}

/// Rows of a strip are 2 to this power. Some 32 strips: enough to share among threads, few enough to be written to side by
/// side.
fn row_bits(size: u32) -> u32 {
    size.div_ceil(32).max(1).next_power_of_two().trailing_zeros()
}

impl EventStrips {
    /// Strips of a PDSM of `size` × `size` pixels.
    pub fn new(size: u32) -> Self {
        let row_bits = row_bits(size);
        Self { size, row_bits, strips: vec![Strip::default(); size.div_ceil(1 << row_bits) as usize] }
    }

    /// Pixels a side of the PDSM.
    pub fn size(&self) -> u32 {
        self.size
    }

    /// Adds an event of the pixel in column `x`, row `y`, both below [`size`](Self::size).
    #[inline]
    pub fn push(&mut self, x: u32, y: u32, event: Event) {
        let strip = y >> self.row_bits;
        let pixel = (y - (strip << self.row_bits)) * self.size + x;
        let strip = &mut self.strips[strip as usize];
        if strip.last.len() == PIECE {
            strip.begin_piece();
        }
        strip.last.push(PlacedEvent { pixel, event });
    }

    /// Strip and pixel in it of column `x`, row `y` of a PDSM of `size` × `size` pixels.
    #[inline]
    pub fn place(size: u32, x: u32, y: u32) -> (usize, u32) {
        let row_bits = row_bits(size);
        let strip = y >> row_bits;
        (strip as usize, (y - (strip << row_bits)) * size + x)
    }

    /// Events in all.
    pub fn len(&self) -> usize {
        self.strips.iter().map(Strip::len).sum()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// How many strips there are.
    pub fn strip_count(&self) -> usize {
        self.strips.len()
    }

    /// Rows of strip `index`.
    pub fn strip_rows(&self, index: usize) -> u32 {
        (self.size - ((index as u32) << self.row_bits)).min(1 << self.row_bits)
    }

    /// Events of strip `index`, in the order they came, in pieces.
    pub fn strip(&self, index: usize) -> impl Iterator<Item = &[PlacedEvent]> {
        let Strip { full, last } = &self.strips[index];
        full.iter().chain(std::iter::once(last)).map(Vec::as_slice)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sorting::SortedStrip;

    #[test]
    fn events_sort_by_depth_and_entries_come_first() {
        let depths = [-7.5f32, -1e-9, 0.0, 1e-30, 0.5, 0.75];
        for pair in depths.windows(2) {
            assert!(Event::new(pair[0], true) < Event::new(pair[1], false), "{pair:?}");
        }
        assert!(Event::new(0.5, false) < Event::new(0.5, true));
        for t in depths {
            let event = Event::new(t, true);
            assert!((event.t() - t).abs() <= t.abs() * 2.4e-7 + f32::MIN_POSITIVE && event.is_exit());
        }
    }

    #[test]
    fn a_strip_keeps_every_event_at_its_pixel() {
        let mut strips = EventStrips::new(100);
        // More than a piece in some strips.
        for i in 0..120_000u32 {
            strips.push(i * 7 % 100, i * 13 % 100, Event::new((i % 17) as f32, i % 2 == 1));
        }
        let mut sorted = SortedStrip::default();
        let mut count = 0;
        for index in 0..strips.strip_count() {
            let pixels = 100 * strips.strip_rows(index) as usize;
            let pieces: Vec<_> = strips.strip(index).collect();
            let all: Vec<_> = pieces.iter().copied().flatten().collect();
            sorted.sort(pixels, &pieces);
            for pixel in 0..pixels {
                let events: Vec<_> = sorted.pixel(pixel).collect();
                assert!(events.is_sorted());
                let mut expected: Vec<_> =
                    all.iter().filter(|e| e.pixel as usize == pixel).map(|e| e.event).collect();
                expected.sort();
                assert_eq!(events, expected);
                count += events.len();
            }
        }
        assert_eq!((count, strips.len()), (120_000, 120_000));
    }
}
