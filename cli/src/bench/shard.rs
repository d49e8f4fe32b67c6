//! A part of a sweep: every n-th cell, so that each of n machines does a like share of every scene.

use std::fmt;
use std::str::FromStr;

/// Shard `index` of `count`, counted from 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Shard {
    index: usize,
    count: usize,
}

impl Shard {
    /// All of it.
    pub(crate) const WHOLE: Self = Self { index: 1, count: 1 };

    /// Whether the shard does the cell with this number.
    pub(crate) fn has(self, cell: usize) -> bool {
        cell % self.count == self.index - 1
    }
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parsed = text.split_once('/').and_then(|(index, count)| {
            Some(Self { index: index.trim().parse().ok()?, count: count.trim().parse().ok()? })
        });
        parsed
            .filter(|shard| (1..=shard.count).contains(&shard.index))
            .ok_or_else(|| "give it as I/N with 1 <= I <= N, such as 2/8".to_owned())
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.index, self.count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shards_share_all_cells_without_overlap() {
        for count in 1..7 {
            for cell in 0..50 {
                let of = |index| format!("{index}/{count}").parse::<Shard>().unwrap();
                assert_eq!((1..=count).filter(|&index| of(index).has(cell)).count(), 1);
            }
        }
        for bad in ["", "1", "0/4", "5/4", "a/b", "1/0", "-1/2"] {
            assert!(bad.parse::<Shard>().is_err(), "{bad}");
        }
    }
}
