//! Welding: vertices at the very same position become one.
//!
//! Loaders and exporters split vertices along seams of normals and texture coordinates; topology must not see
//! those seams. Only bitwise equal positions are welded (with −0 equal to +0), so welding never moves a
//! point, needs no tolerance, and gives the same result at any scale.

use glam::Vec3;
use rayon::prelude::*;

use super::deal::{Dealt, MOST_BUCKETS};

/// Which vertices share a position.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Weld {
    /// For each vertex the first vertex at its position. It is an index into the very array that was welded,
    /// so positions need not be copied; a vertex is *representative* if it maps to itself.
    pub representative: Vec<u32>,
    /// Distinct positions, which is the number of representatives.
    pub unique: usize,
}

/// Vertices of a bucket, about: what is looked up in it fits into a core's cache.
const PER_BUCKET: usize = 8192;

/// Vertices that are dealt to buckets together.
const PER_CHUNK: usize = 1 << 17;

/// Welds `positions` by exact equality. Vertices are dealt to buckets by their hash, chunk by chunk, and looked up in a table
/// within each bucket: a table of all would miss the cache once a vertex.
///
/// NaN coordinates are welded if their bits are equal. An empty slice gives an empty weld. Positions beyond
/// the first `u32::MAX` are out of reach of 32-bit indices and are not read.
pub fn weld(positions: &[Vec3]) -> Weld {
    let positions = &positions[..positions.len().min(u32::MAX as usize)];
    let buckets = (positions.len() / PER_BUCKET).next_power_of_two().min(MOST_BUCKETS);
    let chunks: Vec<_> = positions
        .par_chunks(PER_CHUNK)
        .enumerate()
        .map(|(chunk, positions)| deal(positions, chunk * PER_CHUNK, buckets))
        .collect();
    let repeated: Vec<Vec<[u32; 2]>> = (0..buckets)
        .into_par_iter()
        .map_init(Vec::new, |table, bucket| {
            let parts = || chunks.iter().map(|chunk| chunk.bucket(bucket));
            repeated(positions, parts, table)
        })
        .collect();
    let mut representative: Vec<u32> = (0..positions.len() as u32).into_par_iter().collect();
    let mut unique = positions.len();
    for [vertex, first] in repeated.into_iter().flatten() {
        representative[vertex as usize] = first;
        unique -= 1;
    }
    Weld { representative, unique }
}

/// A chunk's vertices, of which `first` is the first, by their hashes' uppermost bits: the upper half of the hash above the vertex.
fn deal(positions: &[Vec3], first: usize, buckets: usize) -> Dealt<u64> {
    let bits = buckets.trailing_zeros();
    Dealt::new(buckets, || {
        (first as u64..).zip(positions).map(|(vertex, &position)| {
            let hash = hash(key(position));
            let bucket = hash.checked_shr(u64::BITS - bits).unwrap_or(0);
            (bucket as usize, hash >> 32 << 32 | vertex)
        })
    })
}

/// The vertices of one bucket, given in order, that lie where another has lain before, each with the first there.
fn repeated<'a, I>(positions: &[Vec3], parts: impl Fn() -> I, table: &mut Vec<u64>) -> Vec<[u32; 2]>
where
    I: Iterator<Item = &'a [u64]>,
{
    // No vertex has this number.
    const FREE: u64 = u64::MAX;
    let count: usize = parts().map(<[u64]>::len).sum();
    let slots = (2 * count).next_power_of_two();
    table.clear();
    table.resize(slots, FREE);
    let mut repeated = Vec::new();
    for &entry in parts().flatten() {
        let mut slot = (entry >> 32) as usize & (slots - 1);
        loop {
            let held = table[slot];
            if held == FREE {
                table[slot] = entry;
                break;
            }
            let (vertex, first) = (entry as u32, held as u32);
            // Positions are far away in memory: read only where the hashes are the same.
            if held >> 32 == entry >> 32 && key(positions[vertex as usize]) == key(positions[first as usize])
            {
                repeated.push([vertex, first]);
                break;
            }
            slot = (slot + 1) & (slots - 1);
        }
    }
    repeated
}

/// The bits of a position, with −0 turned into +0 (IEEE 754: −0 + 0 = +0).
#[inline]
fn key(position: Vec3) -> [u32; 3] {
    [position.x + 0.0, position.y + 0.0, position.z + 0.0].map(f32::to_bits)
}

/// Mixes by a folded 128-bit product: coordinates of meshes differ in few bits (grids, integers), and both
/// halves of the product together depend on all of them.
#[inline]
fn hash([x, y, z]: [u32; 3]) -> u64 {
    let a = (u64::from(x) | u64::from(y) << 32) ^ 0x9E37_79B9_7F4A_7C15;
    let b = u64::from(z).wrapping_mul(0xD6E8_FEB8_6659_FD93) ^ 0xA076_1D64_78BD_642F;
    let product = u128::from(a) * u128::from(b);
    let folded = (product as u64) ^ (product >> 64) as u64;
    folded ^ folded >> 32
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn equal_positions_meet_at_the_first_and_zeros_are_equal() {
        let p =
            [Vec3::ONE, Vec3::ZERO, Vec3::splat(-0.0), Vec3::ONE, Vec3::new(1.0, 1.0, 1.0 + f32::EPSILON)];
        assert_eq!(weld(&p), Weld { representative: vec![0, 1, 1, 0, 4], unique: 3 });
    }

    #[test]
    fn nothing_welds_to_nothing() {
        assert_eq!(weld(&[]), Weld { representative: vec![], unique: 0 });
    }

    #[test]
    fn grids_do_not_share_hashes() {
        // A power-of-two grid differs in few bits of each coordinate: a weak hash would take minutes here.
        let side = 64;
        let grid: Vec<Vec3> = (0..side * side * side)
            .map(|i| Vec3::new((i % side) as f32, (i / side % side) as f32, (i / side / side) as f32))
            .collect();
        assert_eq!(weld(&grid).unique, grid.len());
    }

    /// More than a chunk apart, in many buckets.
    #[test]
    fn all_repetitions_are_found_whatever_lies_between() {
        let place = |i: u32| Vec3::new((i % 300) as f32, (i / 300) as f32 * 0.1, -1.0);
        const COUNT: u32 = 150_000;
        let positions: Vec<Vec3> = (0..COUNT).chain((0..COUNT).rev()).map(place).collect();
        let expected = (0..COUNT).chain((0..COUNT).rev()).collect();
        assert_eq!(weld(&positions), Weld { representative: expected, unique: COUNT as usize });
    }

    proptest! {
        #[test]
        fn representatives_are_the_first_of_their_position(
            raw in prop::collection::vec((-2i8..3, -2i8..3, -2i8..3), 0..200)
        ) {
            let positions: Vec<Vec3> =
                raw.iter().map(|&(x, y, z)| Vec3::new(f32::from(x), f32::from(y), f32::from(z))).collect();
            let weld = weld(&positions);
            for (vertex, &p) in positions.iter().enumerate() {
                let first = positions.iter().position(|&q| q == p).unwrap();
                prop_assert_eq!(weld.representative[vertex] as usize, first);
            }
            let kept = (0..positions.len()).filter(|&v| weld.representative[v] as usize == v).count();
            prop_assert_eq!(weld.unique, kept);
        }
    }
}
