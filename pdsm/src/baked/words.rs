//! Numbers as 32-bit words, the lower half first where a number takes two.

use bytemuck::cast_slice;

/// Puts words one after the other.
#[derive(Debug, Default)]
pub(super) struct Writer {
    pub(super) words: Vec<u32>,
}

impl Writer {
    pub(super) fn u32(&mut self, value: u32) {
        self.words.push(value);
    }

    pub(super) fn u64(&mut self, value: u64) {
        self.words.extend([value as u32, (value >> 32) as u32]);
    }

    pub(super) fn f32s(&mut self, values: &[f32]) {
        self.words.extend_from_slice(cast_slice(values));
    }

    pub(super) fn f64(&mut self, value: f64) {
        self.u64(value.to_bits());
    }
}

/// Takes words in the order they were put; `None` where there are no more.
#[derive(Debug)]
pub(super) struct Reader<'a> {
    pub(super) words: &'a [u32],
}

impl<'a> Reader<'a> {
    pub(super) fn take(&mut self, count: usize) -> Option<&'a [u32]> {
        let (taken, rest) = self.words.split_at_checked(count)?;
        self.words = rest;
        Some(taken)
    }

    pub(super) fn u32(&mut self) -> Option<u32> {
        self.take(1).map(|words| words[0])
    }

    pub(super) fn u64(&mut self) -> Option<u64> {
        self.take(2).map(|words| u64::from(words[0]) | u64::from(words[1]) << 32)
    }

    pub(super) fn f32(&mut self) -> Option<f32> {
        self.u32().map(f32::from_bits)
    }

    /// Numbers that must be finite.
    pub(super) fn finite<const N: usize>(&mut self) -> Option<[f32; N]> {
        let mut values = [0.0; N];
        for value in &mut values {
            *value = self.f32().filter(|value| value.is_finite())?;
        }
        Some(values)
    }

    pub(super) fn f64(&mut self) -> Option<f64> {
        self.u64().map(f64::from_bits).filter(|value| value.is_finite())
    }

    pub(super) fn bool(&mut self) -> Option<bool> {
        match self.u32()? {
            0 => Some(false),
            1 => Some(true),
            _ => None,
        }
    }
}
